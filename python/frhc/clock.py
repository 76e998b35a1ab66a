"""The clock of the link: never set, and counting the time of a suspended host (CLOCK_BOOTTIME). Times are in ns."""
import time

MILLISECOND = 1_000_000
SECOND = 1_000_000_000


class Clock:
    """Reads the time and waits. Tests have one that does not wait."""

    def now(self) -> int:
        """Returns the time, in ns."""
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME)

    def wait(self, until: int) -> None:
        """Waits until that time; returns at once if it has passed."""
        time.sleep(max(0, until - self.now()) / SECOND)
