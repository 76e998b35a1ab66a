"""A node by the rules, a clock that does not wait, and a link in memory, for the tests."""
import sys
from collections import deque
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from frhc.clock import MILLISECOND, Clock
from frhc.messages import NO_ECHO, Command, Echo, Feedback, Head
from frhc.reasons import Rejected

ROOT = Path(__file__).resolve().parents[2]
ARM, NODE, FAR = 7, 11, 22  # number of the arm, sessions


def ms(count):
    """Returns a time in ns from one in ms."""
    return round(count * MILLISECOND)


class VirtualClock(Clock):
    """Time that passes by waiting alone."""

    def __init__(self):
        self.time = ms(1000)

    def now(self):
        return self.time

    def wait(self, until):
        self.time = max(self.time, until)


class Node:
    """One session of a node; each of its commands echoes the newest feedback."""

    def __init__(self, session=NODE, arm=ARM):
        self.arm, self.session, self.sequence, self.epoch, self.echo = arm, session, 0, 0, NO_ECHO
        self.feedbacks = []

    def command(self, motion=None, **others):
        """Returns the next command as bytes."""
        self.sequence += 1
        head = Head(self.arm, self.epoch, Echo(self.session, self.sequence), self.echo)
        return Command(head, motion, **others).encode()

    def take(self, message):
        """Takes a message of the far side; returns it if it is a feedback."""
        try:
            feedback = Feedback.decode(message)
        except Rejected:
            return None
        self.echo = feedback.head.own
        self.feedbacks.append(feedback)
        return feedback


class MemoryLink:
    """Link whose other end a test has: `waiting` is for the far side, `sent` is of it."""

    def __init__(self):
        self.waiting, self.sent, self.is_closed = deque(), [], False

    def receive(self, now):
        return self.waiting.popleft() if self.waiting else None

    def send(self, now, message):
        self.sent.append(message)

    def close(self):
        self.is_closed = True

    def answer(self, node, motion=None, **others):
        """`node` takes what the far side sent, and sends a command."""
        for message in self.sent:
            node.take(message)
        self.sent.clear()
        self.waiting.append(node.command(motion, **others))
