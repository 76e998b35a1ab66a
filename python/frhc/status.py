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
    """Returns what `frhc ctl status --json` has as `status`. Waits at most `timeout`, in s.

    Asks the node whose control socket is `path`; without it the user's own, then that of the service. Raises NoNode.
    """
    paths = [checked(path)] if path is not None else control_sockets()
    end = time.monotonic() + timeout
    while True:
        reason = "the node closed the connection"
        line = ask(paths, max(0.001, end - time.monotonic()))
        if line:
            answer = json.loads(line)
            if answer.get("ok") is True and isinstance(answer.get("status"), dict):
                found: Dict[str, Any] = answer["status"]
                return found
            reason = str(answer.get("error") or "the node has no status yet")
        if time.monotonic() >= end:
            raise NoNode(f"{', '.join(paths)}: {reason}")
        time.sleep(RETRY_S)


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
