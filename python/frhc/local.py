"""The link over a Unix socket of type SEQPACKET, on which the node listens. Connects again after each loss."""
import logging
import os
import socket
import stat
from typing import Optional, Union

from .clock import MILLISECOND, SECOND
from .paths import checked

LOG = logging.getLogger("frhc")
BUFFER = 4096  # bytes; longer than any message, or a longer packet would pass for a valid one
RETRY = 100 * MILLISECOND
REFUSED_RETRY = 2 * SECOND  # where the node closed the connection at once: it has another far side


class LocalLink:
    """Connection to the node, which is made again when it ends. Never blocks."""

    def __init__(self, path: "Union[str, os.PathLike[str]]") -> None:
        self._path = checked(path)
        self._socket: Optional[socket.socket] = None
        self._was_served = False  # the node has sent a message on this connection
        self._retry_at = 0
        self._state = ""

    def _report(self, state: str, level: int = logging.INFO) -> None:
        if state != self._state:
            LOG.log(level, "%s: %s", self._path, state)
            self._state = state

    def _connect(self, now: int) -> Optional[socket.socket]:
        if self._socket is None and now >= self._retry_at:
            self._retry_at = now + RETRY
            connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            connection.setblocking(False)
            try:
                connection.connect(self._path)
                self._socket, self._was_served = connection, False
            except OSError as error:
                connection.close()
                self._report(f"waits for a node: {absence(self._path, error)}", logging.WARNING)
        return self._socket

    def receive(self, now: int) -> Optional[bytes]:
        """Returns the next message, None while no message waits. Connects again where that is due."""
        connection = self._connect(now)
        if connection is None:
            return None
        try:
            message = connection.recv(BUFFER)
        except BlockingIOError:
            return None
        except OSError as error:
            self._lose(now, error.strerror or str(error))
            return None
        if not message:
            self._lose(now, "the node closed the connection")
            return None
        if not self._was_served:
            self._was_served = True
            self._report("connected to a node")
        return message

    def _lose(self, now: int, reason: str) -> None:
        self.close()
        if self._was_served:
            self._report(reason)
        else:
            self._retry_at = now + REFUSED_RETRY
            self._report("the node closed the connection at once; is another far side connected?")

    def send(self, now: int, message: bytes) -> None:
        """Sends a message; drops it if there is no node or no room."""
        try:
            if self._socket is not None:
                self._socket.send(message)
        except OSError:
            pass  # full, or closed by the node: `receive` finds the end of file

    def close(self) -> None:
        """Closes the connection."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


def absence(path: str, error: OSError) -> str:
    """Returns why no node is reached at the path, and what to do."""
    folder = os.path.dirname(path) or "."
    if isinstance(error, FileNotFoundError):
        if not os.path.isdir(folder):
            return f"no such folder: {folder}; is this the path of the node's link socket?"
        return "no such socket; start `frhc run` with remote.kind = \"link\", or give its remote.link.socket"
    if isinstance(error, ConnectionRefusedError):
        try:
            is_socket = stat.S_ISSOCK(os.stat(path).st_mode)
        except OSError:
            is_socket = True  # removed since
        return "no process listens on this socket" if is_socket else "not a socket; give that of the node"
    return error.strerror or str(error)
