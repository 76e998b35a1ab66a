"""Status of a running node, by its control socket."""
import json
import os
import socket
import time
from typing import Any, Dict, List, Optional, Union

from .paths import checked, control_sockets

RETRY_S = 0.02  # a node with too many clients closes the connection
MAX_ANSWER = 1 << 20  # bytes


class NoNode(ConnectionError):
    """No node answers. The message has the path of its control socket, and the reason."""


def status(path: "Optional[Union[str, os.PathLike[str]]]" = None, *, timeout: float = 3.0) -> Dict[str, Any]:
    """Returns what `frhc ctl status --json` has as `status`; during a boot its `mode` alone. Waits at most `timeout`, in s.

    Asks the node whose control socket is `path`; without it the user's own, then that of the service. Raises NoNode.
    """
    paths = [checked(path)] if path is not None else control_sockets()
    end = time.monotonic() + timeout
    while True:
        line = ask(paths, max(0.001, end - time.monotonic()))
        if line:
            break
        if time.monotonic() >= end:
            raise NoNode(f"{', '.join(paths)}: the node closed the connection")
        time.sleep(RETRY_S)
    answer = json.loads(line)
    if answer.get("ok") is not True:
        raise NoNode(f"{', '.join(paths)}: {answer.get('error', 'invalid response from the node')}")
    found: Dict[str, Any] = answer.get("status") or {"mode": answer.get("mode")}
    return found


def ask(paths: List[str], timeout: float) -> bytes:
    """Returns the node's answer as a line; empty if it closed the connection. Raises NoNode."""
    reasons = []
    for path in paths:
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(timeout)
            try:
                connection.connect(path)
            except OSError as error:
                reasons.append(f"{path}: no node listens: {error.strerror or error}")
                continue
            try:
                connection.sendall(b'{"ask":"status"}\n')
                return connection.makefile("rb").readline(MAX_ANSWER)
            except ConnectionError:
                return b""
            except OSError as error:
                raise NoNode(f"{path}: the node does not answer: {error.strerror or error}") from error
    raise NoNode("; ".join(reasons))
