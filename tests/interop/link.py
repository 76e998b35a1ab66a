"""The messages of docs/link.md, decoded and encoded by rosbags from share/frhc_msgs alone.

`link.py --write` prints the test vectors of the page anew, encoded by rosbags.
"""

import dataclasses
import json
import pathlib
import re
import sys

import numpy
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
PAGE = ROOT / "docs/link.md"
MESSAGES = ROOT / "share/frhc_msgs/msg"

HEAD = {"arm": 7, "epoch": 2, "session": 81985529216486895, "sequence": 41, "echoed_session": 1147797409030816545,
        "echoed_sequence": 39}
POSE = {"position": {"x": 0.5, "y": -0.25, "z": 0.125}, "orientation": {"x": 0.5, "y": -0.5, "z": 0.5, "w": 0.5}}
AT_REST = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}


def six(first, second, *numbers):
    """Returns two vectors by their names."""
    return {first: dict(zip("xyz", numbers[:3])), second: dict(zip("xyz", numbers[3:]))}


def head(kind, **others):
    return {"kind": kind, "version": 1, **HEAD, **others}


VALUES = [
    ("Command", {"head": head(1), "mode": 1, "engaged": 1, "asks_capability": 0, "has_gripper": 0, "reserved1": 0,
                 "rate": six("linear", "angular", 0.1, -0.2, 0.3, -0.4, 0.5, -0.6), "pose": AT_REST,
                 "gripper_position": 0.0, "gripper_force": 0.0, "reserved2": [0, 0]}),
    ("Command", {"head": head(1, sequence=42), "mode": 2, "engaged": 0, "asks_capability": 1, "has_gripper": 1,
                 "reserved1": 0, "rate": six("linear", "angular", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), "pose": POSE,
                 "gripper_position": 0.04, "gripper_force": 12.5, "reserved2": [0, 0]}),
    ("Feedback", {"head": head(2, session=1147797409030816545, sequence=40, echoed_session=81985529216486895,
                               echoed_sequence=41),
                  "state": 0, "reason": 6, "valid": 3, "reserved1": [0] * 5, "obeyed_session": 81985529216486895,
                  "acted_sequence": 38, "wrench": six("force", "torque", 1.5, -2.5, 30.0, 0.25, -0.5, 0.75),
                  "pose": POSE, "gripper_position": 0.0, "gripper_force": 0.0, "reserved2": 0}),
    ("Capability", {"head": head(3, session=1147797409030816545, sequence=43, echoed_session=81985529216486895,
                                 echoed_sequence=42),
                    "senses": 3, "follows": 3, "payload_removal": 2, "reserved1": [0] * 5,
                    "accommodation": [0.002, 0.002, 0.002, 0.05, 0.05, 0.05], "deadband": [1.5, 1.5, 1.5, 0.1, 0.1, 0.1],
                    "servo_lag": 0.02, "sample_period": 0.001, "hold_after": 0.1, "sensor_range": [200.0, 10.0],
                    "stiffest_contact": 5000.0, "max_speed": [0.5, 2.0], "workspace_low": [-1.0, -1.0, 0.0],
                    "workspace_high": [1.0, 1.0, 1.5], "reserved2": [0, 0]}),
]


def typestore():
    """Returns the types of ROS 2 and those of our interface files."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = {}
    for file in sorted(MESSAGES.glob("*.msg")):
        types.update(get_types_from_msg(file.read_text(), f"frhc_msgs/msg/{file.stem}"))
    store.register(types)
    return store


def made(store, kind, fields):
    """Returns the object of rosbags with these fields."""
    spec = dict(store.get_msgdef(kind).fields)
    built = {}
    for name, value in fields.items():
        inner = spec[name]
        if isinstance(value, dict):
            built[name] = made(store, inner[1], value)
        elif isinstance(value, list):
            built[name] = numpy.array(value, dtype=inner[1][0][1][0])
        else:
            built[name] = value
    return store.types[kind](**built)


def plain(value):
    """Returns an object of rosbags as dictionaries, lists and numbers."""
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value) if field.name[0].islower()]
        return {name: plain(getattr(value, name)) for name in names}
    return value.tolist() if isinstance(value, numpy.ndarray) else value


def rosbags_decodes_and_encodes_every_message(_):
    store = typestore()
    vectors = [json.loads(text) for text in re.findall(r"```json\n(.*?)```", PAGE.read_text(), re.S)]
    assert len(vectors) == len(VALUES), f"{len(vectors)} vectors"
    for vector in vectors:
        kind, data = vector["type"], bytes.fromhex("".join(vector["bytes"]))
        decoded = store.deserialize_cdr(data, kind)
        assert plain(decoded) == vector["fields"], f"{kind}: {plain(decoded)}"
        assert bytes(store.serialize_cdr(decoded, kind)) == data, f"{kind}: encoded differently"


TESTS = [rosbags_decodes_and_encodes_every_message]


def write():
    """Prints the test vectors of the page."""
    store = typestore()
    for name, fields in VALUES:
        kind = f"frhc_msgs/msg/{name}"
        data = bytes(store.serialize_cdr(made(store, kind, fields), kind)).hex()
        rows = [f'  "{field}": {json.dumps(value)}' for field, value in fields.items()]
        lines = ",\n".join(f'  "{data[start:start + 80]}"' for start in range(0, len(data), 80))
        print(f'```json\n{{"type": "{kind}", "fields": {{\n' + ",\n".join(rows) +
              f'\n}}, "bytes": [\n{lines}\n]}}\n```\n')


if __name__ == "__main__" and sys.argv[1:] == ["--write"]:
    write()
