"""Send times of the newest own messages: from an echo follows a maximum age of what comes with it."""
from typing import List

from .messages import Echo
from .reasons import Reject, Rejected

LENGTH = 4096  # messages whose send times are kept: a second at 4 kHz


class Sent:
    """Numbers and send times of the messages of one session. Times are in ns."""

    def __init__(self, session: int) -> None:
        self.session = session
        self.newest = 0
        self._times: List[int] = [0] * LENGTH

    def stamp(self, now: int) -> Echo:
        """Returns session and number of the message that is sent now."""
        self.newest += 1
        self._times[self.newest % LENGTH] = now
        return Echo(self.session, self.newest)

    def time_of(self, echo: Echo, now: int, max_age: int) -> int:
        """Returns when the echoed message was sent: what carries the echo was made after that. Raises Rejected."""
        if echo.session != self.session:
            raise Rejected(Reject.SESSION)
        if not 0 < echo.sequence <= self.newest:
            raise Rejected(Reject.NEVER_SENT)
        time = self._times[echo.sequence % LENGTH]
        if self.newest - echo.sequence >= LENGTH or now - time > max_age:
            raise Rejected(Reject.OLD)
        return time
