"""Sessions of the other end: which of them is current, what to echo, and which were left. Times are in ns."""
from typing import Callable, Optional, Set, Tuple

from .messages import NO_ECHO, Echo
from .reasons import Reject, Rejected

MAX_LEFT = 4096  # sessions remembered as left; with more, no new one becomes current
WINDOW = 128  # newest numbers of a session, each of which is overtaken or repeated


class Received:
    """Numbers received of a session: the newest, and a bit for each of the 128 up to it."""

    def __init__(self, newest: int) -> None:
        self.newest = newest
        self._bits = (1 << WINDOW) - 1  # what comes late of before counts as repeated

    def take(self, sequence: int) -> None:
        """Takes a number. Raises Rejected unless it is the newest."""
        if sequence > self.newest:
            ahead = sequence - self.newest
            self._bits = (self._bits << ahead) % (1 << WINDOW) | 1 if ahead < WINDOW else 1
            self.newest = sequence
            return
        bit = 1 << (self.newest - sequence) if self.newest - sequence < WINDOW else 0
        if bit == 0 or self._bits & bit:
            raise Rejected(Reject.REPLAYED)
        self._bits |= bit
        raise Rejected(Reject.OVERTAKEN)


class Peers:
    """Sessions of the other end."""

    def __init__(self, max_age: int) -> None:
        self._max_age = max_age
        self._received = Received(0)
        self._fresh_at = 0  # send time of the newest fresh echo of the current session
        self._left: Set[int] = set()
        self.session = 0  # the current one; 0 for none
        self.echo = NO_ECHO  # newest message of the current session, or of one that may become current

    def admit(self, now: int, message: Echo, echo: Echo,
              sent_at: Callable[[], int]) -> Optional[Tuple[int, bool]]:
        """Checks a message by its session and number, and by `sent_at`, the send time of its echo. Raises Rejected.

        Returns that time, and whether its session has become current; None for a first message, without an echo.
        A message of the current session is echoed even if its own echo is old: else two ends would never find back
        to each other after an interruption.
        """
        if self.session and message.session == self.session:
            self._received.take(message.sequence)
            self.echo = message
            at = sent_at()
            self._fresh_at = max(self._fresh_at, at)
            return at, False
        self._check_other(now, message)
        self.echo = message
        if echo == NO_ECHO:
            return None
        at = sent_at()
        if self.session:
            self._left.add(self.session)
        self.session, self._received, self._fresh_at = message.session, Received(message.sequence), at
        return at, True

    def _check_other(self, now: int, message: Echo) -> None:
        """Checks that a session other than the current one may become current. Raises Rejected."""
        if self.session and now - self._fresh_at <= self._max_age:
            raise Rejected(Reject.NOT_LEADER)
        if message.session in self._left or len(self._left) >= MAX_LEFT:
            raise Rejected(Reject.LEFT)
        if message.session == self.echo.session and message.sequence <= self.echo.sequence:
            raise Rejected(Reject.OVERTAKEN)
