"""Capability: what a far side says of itself. docs/link.md has the table. The node compares it before arming."""
from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Sequence, Tuple

from . import codec
from .messages import GRIPPER_FLAG, POSE_FLAG, WRENCH_FLAG, Head, are_within, impossible, open_message, pack_message

MAX_FIGURE = 1e9  # stands for no limit
FOLLOWS_RATES, FOLLOWS_POSES = 1, 2
ARRAYS = dict(accommodation=6, deadband=6, sensor_range=2, max_speed=2, workspace_low=3, workspace_high=3)
SCALARS = "servo_lag", "sample_period", "hold_after", "stiffest_contact"
FIGURES = *ARRAYS, *SCALARS
SIGNED = "workspace_low", "workspace_high"


def is_ordered(figures: Any) -> bool:
    """Returns whether no position of workspace_low is above that of workspace_high."""
    return all(low <= high for low, high in zip(figures.workspace_low, figures.workspace_high))


class PayloadRemoval(IntEnum):
    """Part of the load on the sensor that is removed from its reading."""

    NONE = 0
    WEIGHT = 1
    WEIGHT_AND_INERTIA = 2


@dataclass(frozen=True)
class Capability:
    """Figures of a far side. None is negative but the workspace's; what is above 1e9, or infinite, is no limit."""

    senses_wrench: bool = True
    senses_pose: bool = True
    has_gripper: bool = False
    follows_rates: bool = True
    follows_poses: bool = True
    payload_removal: PayloadRemoval = PayloadRemoval.NONE
    accommodation: Sequence[float] = (0.0,) * 6  # K_FA by axis of {MRF}, in m/(s·N) and rad/(s·N·m)
    deadband: Sequence[float] = (0.0,) * 6  # wrench that K_FA does not answer, in N and N·m
    servo_lag: float = 0.0  # time constant of the servos, in s
    sample_period: float = 0.002  # of the far side's cycle, in s
    hold_after: float = 0.1  # age of the newest command after which it holds, in s
    sensor_range: Sequence[float] = (math.inf, math.inf)  # force in N, moment in N·m; beyond it the sensor is saturated
    stiffest_contact: float = math.inf  # N/m
    max_speed: Sequence[float] = (math.inf, math.inf)  # of {MRF}, in m/s and rad/s
    workspace_low: Sequence[float] = (-math.inf,) * 3  # least position of {MRF} in {b}, in m
    workspace_high: Sequence[float] = (math.inf,) * 3  # greatest position

    def __post_init__(self) -> None:
        for name in FIGURES:
            value = getattr(self, name)
            numbers = tuple(float(one) for one in value) if name in ARRAYS else (float(value),)
            if len(numbers) != ARRAYS.get(name, 1):
                raise ValueError(f"{name} must have {ARRAYS[name]} numbers, got {len(numbers)}")
            if any(math.isnan(one) or one < 0.0 and name not in SIGNED for one in numbers):
                raise ValueError(f"{name} must be {'a number' if name in SIGNED else 'at least 0'}, got {value}")
            numbers = tuple(max(-MAX_FIGURE, min(one, MAX_FIGURE)) for one in numbers)
            object.__setattr__(self, name, numbers if name in ARRAYS else numbers[0])
        if not is_ordered(self):
            raise ValueError(f"workspace_high must be at least workspace_low, {self.workspace_low}, got {self.workspace_high}")

    def encode(self, head: Head) -> bytes:
        """Encodes the figures."""
        senses = (WRENCH_FLAG * self.senses_wrench + POSE_FLAG * self.senses_pose + GRIPPER_FLAG * self.has_gripper)
        follows = FOLLOWS_RATES * self.follows_rates + FOLLOWS_POSES * self.follows_poses
        return pack_message(head, codec.CAPABILITY_KIND, codec.CAPABILITY, senses=senses, follows=follows,
                            payload_removal=self.payload_removal, **{name: getattr(self, name) for name in FIGURES})

    @classmethod
    def decode(cls, message: bytes) -> Tuple[Head, Capability]:
        """Decodes a message. Raises Rejected."""
        head, fields = open_message(message, codec.CAPABILITY_KIND, codec.CAPABILITY)
        for name in FIGURES:
            value = getattr(fields, name)
            numbers = value if name in ARRAYS else (value,)
            if not are_within(numbers, MAX_FIGURE) or name not in SIGNED and any(one < 0.0 for one in numbers):
                impossible()
        if not is_ordered(fields):
            impossible()
        if fields.senses > 7 or fields.follows > 3 or fields.payload_removal > max(PayloadRemoval):
            impossible()
        return head, cls(
            senses_wrench=bool(fields.senses & WRENCH_FLAG), senses_pose=bool(fields.senses & POSE_FLAG),
            has_gripper=bool(fields.senses & GRIPPER_FLAG), follows_rates=bool(fields.follows & FOLLOWS_RATES),
            follows_poses=bool(fields.follows & FOLLOWS_POSES), payload_removal=PayloadRemoval(fields.payload_removal),
            **{name: getattr(fields, name) for name in FIGURES})
