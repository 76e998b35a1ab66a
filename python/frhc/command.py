"""The command of a cycle as a program follows it."""
from dataclasses import dataclass
from enum import Enum
from typing import Optional, Tuple

import numpy as np
from numpy.typing import NDArray

from . import messages

Array = NDArray[np.float64]


class Motion(Enum):
    """Kind of motion that is commanded."""

    RATE = 1
    POSE = 2


@dataclass(frozen=True)
class Command:
    """Command of a cycle. Without a motion, hold where the robot is: not where an earlier command was to lead."""

    motion: Optional[Motion] = None
    rate: Optional[Array] = None  # with RATE: twist of {MRF}, written in {MRF}: linear in m/s, then angular in rad/s
    pose: Optional[Tuple[Array, Array]] = None  # with POSE: of {MRF} in {b}: position in m, orientation as x, y, z, w
    gripper: Optional[Tuple[float, float]] = None  # position in m and force in N, where the hand controller has one
    engaged: bool = False  # the motion comes from the operator's hand; for records and displays


def command_of(message: Optional[messages.Command]) -> Command:
    """Returns the command of a message that acts; without one, to hold."""
    if message is None:
        return Command()
    gripper = message.gripper and (message.gripper.position, message.gripper.force)
    if isinstance(message.motion, messages.Rate):
        return Command(Motion.RATE, np.array(message.motion.twist), None, gripper, message.engaged)
    if isinstance(message.motion, messages.Pose):
        position, orientation = map(np.array, message.motion)
        return Command(Motion.POSE, None, (position, orientation), gripper, message.engaged)
    return Command(gripper=gripper, engaged=message.engaged)
