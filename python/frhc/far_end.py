"""The far side's end of the link: which node leads, which command acts, and when to hold.

The rules of docs/link.md without I/O and without a clock: bytes and times in ns are arguments.
"""
from typing import Dict, Optional, Tuple

from .capability import Capability
from .messages import Command, Echo, Feedback, Head, Measured
from .peers import Peers
from .reasons import Reason, Reject, Rejected
from .sent import Sent


class FarEnd:
    """End of an arm with a session, which must be random and not 0. Holds if the newest command is older than `hold_after`."""

    def __init__(self, arm: int, session: int, hold_after: int) -> None:
        self.arm = arm
        self.epoch = 0  # of the session that leads
        self.reason = Reason.NOT_ARMED  # why it holds; NONE while it follows
        self.acted = 0  # number of the newest command that acted
        self.rejects: Dict[Reject, int] = {}  # messages that had no effect, by reason
        self._hold_after = hold_after
        self._sent = Sent(session)
        self._peers = Peers(hold_after)
        self._newest: Optional[Tuple[int, Command]] = None  # of the session that leads, with the send time of its echo
        self._asks_capability = False

    @property
    def session(self) -> int:
        """Returns its own session."""
        return self._sent.session

    @property
    def sequence(self) -> int:
        """Returns the number of its newest message."""
        return self._sent.newest

    @property
    def leader(self) -> int:
        """Returns the session of the node that leads; 0 for none."""
        return self._peers.session

    @property
    def echo(self) -> Echo:
        """Returns the message that is echoed."""
        return self._peers.echo

    def on_message(self, now: int, message: bytes) -> Optional[Reject]:
        """Takes a message of a node. Read `now` after it was received. Returns why it had no effect, None if it had one."""
        try:
            self._take(now, message)
            return None
        except Rejected as rejected:
            self.rejects[rejected.reject] = self.rejects.get(rejected.reject, 0) + 1
            return rejected.reject

    def _take(self, now: int, message: bytes) -> None:
        command = Command.decode(message)
        head = command.head
        if head.arm != self.arm:
            raise Rejected(Reject.ARM)
        sent_at = lambda: self._sent.time_of(head.echo, now, self._hold_after)
        admission = self._peers.admit(now, head.own, head.echo, sent_at)
        if admission is None:
            return
        at, is_new_session = admission
        if is_new_session:
            # It may have been armed for another far side: its present epoch moves nothing here.
            self.epoch, self.acted, self.reason = head.epoch, 0, Reason.NOT_ARMED
        elif head.epoch < self.epoch:
            raise Rejected(Reject.LEFT)
        elif head.epoch > self.epoch:
            self.epoch, self.reason = head.epoch, Reason.NONE
        self._newest = at, command
        self._asks_capability = self._asks_capability or command.asks_capability

    def command(self, now: int) -> Optional[Command]:
        """Returns the command that acts; None to hold, from the first time without a fresh one until a later epoch."""
        if self._newest is None or now - self._newest[0] > self._hold_after:
            self.hold(Reason.SILENCE)
            return None
        if self.reason != Reason.NONE:
            return None
        self.acted = self._newest[1].head.own.sequence
        return self._newest[1]

    def hold(self, reason: Reason) -> None:
        """Holds until a later epoch. The first reason stays, but NOT_ARMED gives way to any but SILENCE."""
        if self.reason == Reason.NONE or self.reason == Reason.NOT_ARMED and reason != Reason.SILENCE:
            self.reason = reason

    def _head(self, now: int) -> Head:
        return Head(self.arm, self.epoch, self._sent.stamp(now), self._peers.echo)

    def feedback(self, now: int, measured: Measured) -> bytes:
        """Returns the next message to the node. Read `now` before it is sent."""
        return Feedback(self._head(now), self.reason, self.leader, self.acted, measured).encode()

    def capability(self, now: int, figures: Capability) -> Optional[bytes]:
        """Returns the message with these figures, if the node asked for them."""
        is_asked, self._asks_capability = self._asks_capability, False
        return figures.encode(self._head(now)) if is_asked else None
