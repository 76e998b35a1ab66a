#!/usr/bin/env python3
"""One end of a link over a network for zenoh_peers.py: `frhc-link`, and what is behind it.

    link_end.py near|far KEYS PORT

A far end listens on PORT of 127.0.0.1, with `frhc robot` behind it; a near end connects there, with a node of the judge at
its socket. Needs FRHC and FRHC_LINK, the two programs. Signals reach all of them, since they are in one process group.
"""
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import far_side as contract
from far_side import FrhcRobot, Node, far


def start(role, keys, network, folder):
    settings = Path(folder) / "link.toml"
    settings.write_text(f'keys = "{keys}"\nsocket = "{folder}/s"\n{network}\n')
    return subprocess.Popen([os.environ["FRHC_LINK"], role, "--config", str(settings)])


def run_far(keys, port, folder):
    """Ends when both have ended, after a stop signal to all."""
    signal.signal(signal.SIGTERM, lambda *_: None)
    ends = [start("far", keys, f'listen = ["127.0.0.1:{port}"]', folder)]
    while not os.path.exists(f"{folder}/s"):
        time.sleep(0.01)
    ends.append(subprocess.Popen(FrhcRobot(os.environ["FRHC"]).command(f"{folder}/s", 1, ())))
    return max(end.wait() for end in ends)


def run_near(keys, port, folder):
    """Sends Commands with the newest echo every 2 ms."""
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listener.bind(f"{folder}/s")
    listener.listen(1)
    start("near", keys, f'connect = ["127.0.0.1:{port}"]', folder)
    connection, node = listener.accept()[0], Node()
    connection.setblocking(False)
    while True:
        try:
            while message := connection.recv(4096):
                feedback = message[4] == 2 and far.unpack(far.FEEDBACK, message)
                node.echo = (feedback.session, feedback.sequence) if feedback else node.echo
        except BlockingIOError:
            pass
        try:
            connection.send(node.message())
        except BlockingIOError:
            pass  # a link that is stopped
        time.sleep(contract.PERIOD_S)


def main():
    role, keys, port = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        return {"far": run_far, "near": run_near}[role](keys, port, folder)


if __name__ == "__main__":
    sys.exit(main())
