"""Measurements as a program has them, checked and as the messages have them."""
import math
from typing import Any, Optional, Tuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .capability import Capability
from .messages import MAX_GRIPPER, MAX_WRENCH, Gripper, Measured, Pose, are_within, is_pose
from .reasons import Reason

MAX_SKEW = 1e-3  # deviation of an orientation from a unit quaternion or a rotation matrix, beyond which it is a fault


def numbers(name: str, value: ArrayLike, *shapes: Tuple[int, ...]) -> NDArray[np.float64]:
    """Returns an array of one of the shapes. Raises ValueError."""
    array = np.asarray(value, dtype=np.float64)
    if array.shape not in shapes:
        raise ValueError(f"{name} must have the shape {' or '.join(map(str, shapes))}, got {array.shape}")
    return array


def checked(wrench: Optional[ArrayLike], pose: Any, gripper: Optional[Tuple[float, float]],
            figures: Capability) -> Tuple[Measured, Reason]:
    """Returns the valid measurements, and the reason to hold that they give. Raises ValueError for a wrong shape."""
    reasons = []
    valid_wrench, reason = checked_wrench(wrench, figures)
    reasons.append(reason)
    valid_pose = None
    if pose is not None:
        valid_pose = pose_of(pose)
        reasons.append(Reason.NONE if valid_pose else Reason.FAULT)
    valid_gripper = None
    if gripper is not None:
        valid_gripper = Gripper(*numbers("gripper", gripper, (2,)).tolist())
        if not are_within(valid_gripper, MAX_GRIPPER):
            valid_gripper = None
            reasons.append(Reason.FAULT)
    reason = next((one for one in reasons if one != Reason.NONE), Reason.NONE)
    return Measured(valid_wrench, valid_pose, valid_gripper), reason


def checked_wrench(wrench: Optional[ArrayLike], figures: Capability) -> Tuple[Optional[Tuple[float, ...]], Reason]:
    """Returns the wrench if it is valid, else the reason to hold."""
    if wrench is None:
        return None, Reason.NONE
    values = tuple(numbers("wrench", wrench, (6,)).tolist())
    if not all(map(math.isfinite, values)):
        return None, Reason.SENSOR_INVALID
    force, moment = (min(limit, MAX_WRENCH) for limit in figures.sensor_range)
    if max(map(abs, values[:3])) >= force or max(map(abs, values[3:])) >= moment:
        return None, Reason.SENSOR_SATURATED
    return values, Reason.NONE


def pose_of(pose: Any) -> Optional[Pose]:
    """Returns a pose from (position, orientation x y z w) or a 4x4 matrix; None if a value is out of range."""
    if isinstance(pose, (tuple, list)) and len(pose) == 2:
        position = numbers("position", pose[0], (3,))
        orientation = numbers("orientation", pose[1], (4,))
    else:
        matrix = numbers("pose", pose, (4, 4))
        if not is_rotation(matrix):
            return None
        position, orientation = matrix[:3, 3], quaternion_of(matrix[:3, :3])
    norm = float(np.linalg.norm(orientation))
    if not abs(norm - 1.0) <= MAX_SKEW:
        return None
    found = Pose(tuple(position.tolist()), tuple((orientation / norm).tolist()))
    return found if is_pose(found.position + found.orientation) else None


def is_rotation(matrix: NDArray[np.float64]) -> bool:
    """Returns whether a 4x4 matrix is of a rotation and a translation."""
    if not np.isfinite(matrix).all():
        return False
    turn = matrix[:3, :3]
    skew = np.abs(turn @ turn.T - np.eye(3)).max()
    return bool(skew <= MAX_SKEW and np.linalg.det(turn) > 0.0 and np.abs(matrix[3] - [0, 0, 0, 1]).max() <= MAX_SKEW)


def quaternion_of(turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the unit quaternion x, y, z, w of a rotation matrix: from the largest of its four parts."""
    diagonal, trace = np.diag(turn), float(np.trace(turn))
    largest = int(np.argmax([*diagonal, trace]))
    quaternion = np.empty(4)
    if largest == 3:
        quaternion[:3] = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
        quaternion[3] = 1.0 + trace
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        quaternion[i] = 1.0 + 2.0 * diagonal[i] - trace
        quaternion[j], quaternion[k] = turn[j, i] + turn[i, j], turn[k, i] + turn[i, k]
        quaternion[3] = turn[k, j] - turn[j, k]
    unit: NDArray[np.float64] = quaternion / np.linalg.norm(quaternion)
    return unit
