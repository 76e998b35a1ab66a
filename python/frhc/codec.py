"""Bytes of the messages: little-endian CDR of fixed length. docs/link.md has the tables; ranges are checked in `messages`."""
import struct
from types import SimpleNamespace
from typing import Any, Dict, Optional

ENCAPSULATION = bytes([0, 1, 0, 0])
VERSION = 1
COMMAND_KIND, FEEDBACK_KIND, CAPABILITY_KIND = 1, 2, 3


class Layout:
    """Fields of a message in their order, each with its struct format. Reserved bytes are "x": sent as zero, not read."""

    def __init__(self, **fields: str) -> None:
        self.fields = fields
        self.struct = struct.Struct("<4s" + "".join(fields.values()))
        self.length = self.struct.size
        self.counts = {name: int(form[:-1] or 1) for name, form in fields.items() if not form.endswith("x")}


HEAD: Dict[str, str] = dict(kind="B", version="B", arm="H", epoch="I", session="Q", sequence="Q", echoed_session="Q",
                            echoed_sequence="Q")
COMMAND = Layout(**HEAD, mode="B", engaged="B", asks_capability="B", has_gripper="B", reserved1="4x", rate="6d",
                 pose="7d", gripper_position="d", gripper_force="d", reserved2="16x")
FEEDBACK = Layout(**HEAD, state="B", reason="B", valid="B", reserved1="5x", obeyed_session="Q", acted_sequence="Q",
                  wrench="6d", pose="7d", gripper_position="d", gripper_force="d", reserved2="8x")
CAPABILITY = Layout(**HEAD, senses="B", follows="B", payload_removal="B", reserved1="5x", accommodation="6d",
                    deadband="6d", servo_lag="d", sample_period="d", hold_after="d", sensor_range="2d",
                    stiffest_contact="d", max_speed="2d", workspace_low="3d", workspace_high="3d", reserved2="16x")


def pack(layout: Layout, **fields: Any) -> bytes:
    """Encodes a message; a field is a number or a sequence of numbers. Reserved fields need not be given."""
    values = [ENCAPSULATION]
    for name, count in layout.counts.items():
        values.extend(fields[name] if count > 1 else [fields[name]])
    return layout.struct.pack(*values)


def unpack(layout: Layout, message: bytes) -> Optional[SimpleNamespace]:
    """Decodes a message, whatever its values; None if its length or its encapsulation header is wrong."""
    if len(message) != layout.length or message[:4] != ENCAPSULATION:
        return None
    values, at, fields = layout.struct.unpack(message), 1, SimpleNamespace()
    for name, count in layout.counts.items():
        setattr(fields, name, values[at] if count == 1 else values[at:at + count])
        at += count
    return fields
