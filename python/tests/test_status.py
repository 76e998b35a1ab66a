"""Status of a node, by a control socket of the test."""
import json
import os
import socket
import tempfile
import threading
import unittest
from unittest import mock

import far  # noqa: F401  the path of the package
import frhc
from frhc import paths


class Console:
    """Answers requests with lines, one per connection; an empty line closes the connection without an answer."""

    def __init__(self, path, *lines):
        os.makedirs(os.path.dirname(path), exist_ok=True)
        self.requests, self.listener = [], socket.socket(socket.AF_UNIX)
        self.listener.bind(path)
        self.listener.listen(8)
        self.thread = threading.Thread(target=self.serve, args=(lines,), daemon=True)
        self.thread.start()

    def serve(self, lines):
        for line in lines:
            connection, _ = self.listener.accept()
            with connection:
                if line:
                    self.requests.append(connection.makefile().readline())
                    connection.sendall(line)

    def close(self):
        self.thread.join(5)
        self.listener.close()


class Status(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.path = os.path.join(folder.name, "frhc/node.sock")

    def console(self, *lines):
        console = Console(self.path, *lines)
        self.addCleanup(console.close)
        return console

    def test_status_of_the_node_is_returned(self):
        answer = {"mode": "armed", "link": {"far_side": "following"}}
        console = self.console(json.dumps({"ok": True, "mode": "armed", "status": answer}).encode() + b"\n")
        self.assertEqual(frhc.status(self.path), answer)
        self.assertEqual(console.requests, ['{"ask":"status"}\n'])

    def test_user_s_node_is_asked_by_default(self):
        self.console(b'{"ok": true, "status": {"mode": "ready"}}\n')
        with mock.patch.dict(os.environ, {"XDG_RUNTIME_DIR": self.folder}):
            os.environ.pop("RUNTIME_DIRECTORY", None)
            self.assertEqual(frhc.status(), {"mode": "ready"})

    def test_node_that_is_busy_is_asked_again(self):
        self.console(b"", b"", b'{"ok": true, "status": {"mode": "ready"}}\n')
        self.assertEqual(frhc.status(self.path), {"mode": "ready"})

    def test_absent_node_is_one_error_with_its_path(self):
        with self.assertRaisesRegex(frhc.NoNode, f"^{self.path}: no node listens: No such file or directory$"):
            frhc.status(self.path)
        with mock.patch.object(paths, "SERVICE_FOLDER", "/nowhere/frhc"):
            with mock.patch.dict(os.environ, {"XDG_RUNTIME_DIR": self.folder}):
                with self.assertRaisesRegex(frhc.NoNode, f"{self.path}: .*; /nowhere/frhc/node.sock: no node listens"):
                    frhc.status()

    def test_stale_socket_is_an_error_with_its_path(self):
        self.console().close()
        with self.assertRaisesRegex(frhc.NoNode, f"^{self.path}: no node listens: Connection refused$"):
            frhc.status(self.path)

    def test_node_that_boots_has_a_mode_alone(self):
        self.console(b'{"ok": true, "mode": "boot"}\n')
        self.assertEqual(frhc.status(self.path), {"mode": "boot"})

    def test_node_that_refuses_is_an_error_with_its_path(self):
        self.console(b'{"ok": false, "error": "unknown request"}\n')
        with self.assertRaisesRegex(frhc.NoNode, f"^{self.path}: unknown request$"):
            frhc.status(self.path)

    def test_silent_node_is_an_error_with_its_path(self):
        self.console()
        with self.assertRaisesRegex(frhc.NoNode, f"^{self.path}: the node does not answer: timed out$"):
            frhc.status(self.path, timeout=0.001)

    def test_folders_are_those_of_frhc_ctl(self):
        for environment, expected in (({}, "/run/frhc"), ({"XDG_RUNTIME_DIR": "/u"}, "/u/frhc"),
                                      ({"RUNTIME_DIRECTORY": "/run/frhc:/run/x", "XDG_RUNTIME_DIR": "/u"}, "/run/frhc"),
                                      ({"RUNTIME_DIRECTORY": "", "XDG_RUNTIME_DIR": "u"}, "/run/frhc"),
                                      ({"RUNTIME_DIRECTORY": "x", "XDG_RUNTIME_DIR": "/u"}, "/u/frhc")):
            self.assertEqual(paths.default_folder(environment), expected)


if __name__ == "__main__":
    unittest.main()
