"""Command and Feedback with values in range. docs/link.md has the tables; `capability` is the third message."""
import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import NamedTuple, NoReturn, Optional, Sequence, Tuple, Union

from . import codec
from .codec import ENCAPSULATION, VERSION, Layout
from .reasons import Reason, Reject, Rejected

MAX_RATE = 100.0  # m/s or rad/s
MAX_WRENCH = 1e5  # N or N·m
MAX_DISTANCE = 1e3  # m
MAX_GRIPPER = 1e3  # m or N
NORM_TOLERANCE = 1e-6

WRENCH_FLAG, POSE_FLAG, GRIPPER_FLAG = 1, 2, 4


class Echo(NamedTuple):
    """A message by its session and number; both zero for none."""

    session: int
    sequence: int


NO_ECHO = Echo(0, 0)


class Head(NamedTuple):
    """Head of a message."""

    arm: int
    epoch: int
    own: Echo
    echo: Echo


class Rate(NamedTuple):
    """Twist of {MRF}, written in {MRF}: linear in m/s, then angular in rad/s."""

    twist: Tuple[float, ...]


class Pose(NamedTuple):
    """Pose of {MRF} in {b}: position in m, orientation as unit quaternion x, y, z, w."""

    position: Tuple[float, ...]
    orientation: Tuple[float, ...]


class Gripper(NamedTuple):
    """Opening in m, force in N."""

    position: float
    force: float


IDENTITY = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def are_within(values: Sequence[float], limit: float) -> bool:
    """Returns whether all values are within ±limit; NaN is not."""
    return all(abs(value) <= limit for value in values)


def is_pose(values: Sequence[float]) -> bool:
    """Returns whether seven values are a pose in range."""
    x, y, z, w = values[3:]
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    return are_within(values[:3], MAX_DISTANCE) and abs(norm - 1.0) <= NORM_TOLERANCE


def impossible() -> NoReturn:
    """Rejects a message with a value out of range."""
    raise Rejected(Reject.IMPOSSIBLE)


def open_message(message: bytes, kind: int, layout: Layout) -> Tuple[Head, SimpleNamespace]:
    """Returns head and fields of a message of this kind. Raises Rejected."""
    if message[:4] != ENCAPSULATION:
        raise Rejected(Reject.FOREIGN)
    if len(message) < 6:
        raise Rejected(Reject.LENGTH)
    if message[5] != VERSION:
        raise Rejected(Reject.VERSION)
    if message[4] != kind:
        raise Rejected(Reject.FOREIGN)
    fields = codec.unpack(layout, message)
    if fields is None:
        raise Rejected(Reject.LENGTH)
    if fields.session == 0 or fields.sequence == 0:
        impossible()
    own, echo = Echo(fields.session, fields.sequence), Echo(fields.echoed_session, fields.echoed_sequence)
    return Head(fields.arm, fields.epoch, own, echo), fields


def pack_message(head: Head, kind: int, layout: Layout, **fields: object) -> bytes:
    """Encodes a message of this kind."""
    return codec.pack(layout, kind=kind, version=VERSION, arm=head.arm, epoch=head.epoch, session=head.own.session,
                      sequence=head.own.sequence, echoed_session=head.echo.session,
                      echoed_sequence=head.echo.sequence, **fields)


def pose_of(values: Tuple[float, ...]) -> Pose:
    """Returns the pose with these seven numbers. Raises Rejected."""
    if not is_pose(values):
        impossible()
    return Pose(values[:3], values[3:])


def gripper_of(fields: SimpleNamespace) -> Gripper:
    """Returns the gripper of a message. Raises Rejected."""
    gripper = Gripper(fields.gripper_position, fields.gripper_force)
    if not are_within(gripper, MAX_GRIPPER):
        impossible()
    return gripper


@dataclass(frozen=True)
class Command:
    """Command of a cycle, from the node. A motion of None is to hold."""

    head: Head
    motion: Union[None, Rate, Pose] = None
    engaged: bool = False
    asks_capability: bool = False
    gripper: Optional[Gripper] = None

    def encode(self) -> bytes:
        """Encodes the command."""
        rate = self.motion.twist if isinstance(self.motion, Rate) else (0.0,) * 6
        pose = self.motion if isinstance(self.motion, Pose) else IDENTITY
        mode = 0 if self.motion is None else 1 if isinstance(self.motion, Rate) else 2
        position, force = self.gripper or (0.0, 0.0)
        return pack_message(self.head, codec.COMMAND_KIND, codec.COMMAND, mode=mode, engaged=self.engaged,
                            asks_capability=self.asks_capability, has_gripper=self.gripper is not None, rate=rate,
                            pose=pose.position + pose.orientation, gripper_position=position, gripper_force=force)

    @classmethod
    def decode(cls, message: bytes) -> "Command":
        """Decodes a message. Raises Rejected."""
        head, fields = open_message(message, codec.COMMAND_KIND, codec.COMMAND)
        motion: Union[None, Rate, Pose] = None
        if fields.mode == 1 and are_within(fields.rate, MAX_RATE):
            motion = Rate(fields.rate)
        elif fields.mode == 2:
            motion = pose_of(fields.pose)
        elif fields.mode != 0:
            impossible()
        if max(fields.engaged, fields.asks_capability, fields.has_gripper) > 1:
            impossible()
        gripper = gripper_of(fields) if fields.has_gripper else None
        return cls(head, motion, fields.engaged == 1, fields.asks_capability == 1, gripper)


@dataclass(frozen=True)
class Measured:
    """Measurements of one cycle; None is not valid.

    The wrench is that of the environment on the object, at {S} in {S}: force in N, then moment in N·m.
    """

    wrench: Optional[Tuple[float, ...]] = None
    pose: Optional[Pose] = None
    gripper: Optional[Gripper] = None


@dataclass(frozen=True)
class Feedback:
    """Feedback of a cycle, from the far side."""

    head: Head
    reason: Reason
    obeyed_session: int = 0
    acted_sequence: int = 0
    measured: Measured = Measured()

    def encode(self) -> bytes:
        """Encodes the feedback."""
        wrench, pose, gripper = self.measured.wrench, self.measured.pose, self.measured.gripper
        valid = (WRENCH_FLAG * (wrench is not None) + POSE_FLAG * (pose is not None)
                 + GRIPPER_FLAG * (gripper is not None))
        position, orientation = pose or IDENTITY
        opening, force = gripper or (0.0, 0.0)
        return pack_message(self.head, codec.FEEDBACK_KIND, codec.FEEDBACK, state=self.reason == Reason.NONE,
                            reason=self.reason, valid=valid, obeyed_session=self.obeyed_session,
                            acted_sequence=self.acted_sequence, wrench=wrench or (0.0,) * 6,
                            pose=position + orientation, gripper_position=opening, gripper_force=force)

    @classmethod
    def decode(cls, message: bytes) -> "Feedback":
        """Decodes a message. Raises Rejected."""
        head, fields = open_message(message, codec.FEEDBACK_KIND, codec.FEEDBACK)
        if fields.reason > max(Reason) or fields.state != (fields.reason == Reason.NONE) or fields.valid > 7:
            impossible()
        wrench = fields.wrench if fields.valid & WRENCH_FLAG else None
        if wrench and not are_within(wrench, MAX_WRENCH):
            impossible()
        pose = pose_of(fields.pose) if fields.valid & POSE_FLAG else None
        gripper = gripper_of(fields) if fields.valid & GRIPPER_FLAG else None
        return cls(head, Reason(fields.reason), fields.obeyed_session, fields.acted_sequence,
                   Measured(wrench, pose, gripper))
