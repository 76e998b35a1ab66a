"""Reasons to hold, which the node shows to the operator, and reasons not to act on a message. Codes of docs/link.md."""
from enum import Enum, IntEnum
from typing import Dict


class Reason(IntEnum):
    """Reason to hold. Only a later epoch, an arming or a reset of the node, ends it."""

    NONE = 0  # it follows
    NOT_ARMED = 1
    SILENCE = 2
    SENSOR_INVALID = 3
    SENSOR_SATURATED = 4
    SENSOR_SILENT = 5
    WRENCH_LIMIT = 6
    END_OF_PROCESS = 7
    FAULT = 8  # of the robot


class Reject(Enum):
    """Reason not to act on a message, in the words of `frhc ctl status`."""

    LENGTH = "length"
    FOREIGN = "foreign"
    VERSION = "version"
    ARM = "arm"
    IMPOSSIBLE = "impossible"
    SESSION = "session"
    NEVER_SENT = "never sent"
    OLD = "old"
    OVERTAKEN = "overtaken"
    REPLAYED = "replayed"
    NOT_LEADER = "not leader"
    LEFT = "left"


class Rejected(Exception):
    """A message that has no effect."""

    def __init__(self, reject: Reject) -> None:
        super().__init__(reject.value)
        self.reject = reject


Rejects = Dict[Reject, int]
