"""Cycles of a far side: waits, takes messages, decides, sends. The last few say why it ends."""
import os
from typing import Optional

from .capability import Capability
from .clock import MILLISECOND, SECOND, Clock
from .far_end import FarEnd
from .link import Link
from .messages import Command, Measured
from .reasons import Reason

END_CYCLES = 5  # that send the reason of the end
NOTHING = Measured()


class Cycles:
    """The cycles of one far side. Times are in ns; missed cycles are skipped."""

    def __init__(self, far_end: FarEnd, link: Link, clock: Clock, figures: Capability) -> None:
        self.far_end = far_end
        self.is_ended = False
        self._link = link
        self._clock = clock
        self._figures = figures
        self._period = round(figures.sample_period * SECOND)
        # Bounds a flood of messages, which must not delay the robot. A node sends at most four per ms.
        self._max_messages = 16 + 4 * (self._period // MILLISECOND)
        self._next_cycle: Optional[int] = None
        self._measured: Optional[Measured] = None  # of the present cycle
        self._standing = Reason.NONE  # reason to hold that the newest measurement gave
        self._process = os.getpid()

    def begin(self) -> Optional[Command]:
        """Waits for the next period, and takes the messages that came. Returns the command that acts, None to hold."""
        now = self._clock.now()
        if self._next_cycle is None:
            self._next_cycle = now
        else:
            if self._measured is None:
                self.send(NOTHING, Reason.NONE)
            self._next_cycle = max(self._next_cycle + self._period, now)
            self._clock.wait(self._next_cycle)
        self._measured = None
        for _ in range(self._max_messages):
            message = self._link.receive(self._clock.now())
            if message is None:
                break
            self.far_end.on_message(self._clock.now(), message)
        if self._standing != Reason.NONE:
            self.far_end.hold(self._standing)
        return self.far_end.command(self._clock.now())

    def send(self, measured: Measured, standing: Reason) -> None:
        """Sends what was measured in this cycle. Holds for the reason `standing` as long as measurements give it."""
        if self.is_ended:
            return
        self._measured, self._standing = measured, standing
        if standing != Reason.NONE:
            self.far_end.hold(standing)
        self._send(measured)

    def _send(self, measured: Measured) -> None:
        now = self._clock.now()
        self.far_end.command(now)  # the program may have taken long: it is silence then
        self._link.send(now, self.far_end.feedback(now, measured))
        now = self._clock.now()
        capability = self.far_end.capability(now, self._figures)
        if capability is not None:
            self._link.send(now, capability)

    def end(self, reason: Reason) -> None:
        """Holds, says why for a few periods, and closes the link. Takes no message: a later epoch must not end the hold."""
        if self.is_ended:
            return
        self.is_ended = True
        if os.getpid() == self._process:  # the connection is not that of a forked child
            self.far_end.hold(reason)
            for cycle in range(END_CYCLES):
                if cycle:
                    self._clock.wait(self._clock.now() + self._period)
                # A value is younger than the echo beside it only if it is of the cycle that took the echoed message.
                self._send(self._measured or NOTHING)
        self._link.close()
