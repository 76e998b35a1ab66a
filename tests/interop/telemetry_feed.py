"""A node's telemetry without a node: lines of docs/telemetry.md, made from the number of the cycle, on a Unix socket.

    with Feed(path, Motion(description())) as feed:
        ...                                   # readers get description, mode, and 50 snapshots a second
    telemetry_feed.py SOCKET [--plain] [--stop-at S] [--joints N] [--hostile]      the same, to look at

No code of the program: the kinematics are numpy's, after Craig 1989, 3.4.
"""

import argparse
import contextlib
import itertools
import json
import math
import socket
import threading
import time
import tomllib
from pathlib import Path

import numpy

ROOT = Path(__file__).resolve().parents[2]
ARM = ROOT / "config/kraft_like.toml"
PUMA = ROOT / "config/robots/puma560.toml"
PERIOD_US = 1000
CYCLES_PER_SNAPSHOT = 20
MODE_EVERY = 25  # snapshots: half a second
WALL_X = 0.45
HALF_EDGE = 0.025
STOP = "joint 3 (elbow): no sample for 3 cycles"
WAY_OUT = [
    "The drives of elbow did not report that they are off. Such a drive may push: press the emergency stop, which cuts its power by wire.",
    "Remove the cause at elbow: position samples of a drive missing for several cycles in a row.",
    "frhc ctl reset ends the stop; it boots the network again, since a node may have lost its configuration.",
    "frhc ctl arm with the deadman released, if the node is ready, not armed; then release the deadman and press it again: both contacts open for 25 ms, then closed for 25 ms.",
]
HOSTILE = ["<img src=x onerror=alert(1)>", "&amp;\u202egnirts", "\x00\x1b[31m\n\t", "a" * 1000, "\U0001f9be \"'`${1}", "</script><b>"]


def rotation_x(angle):
    sine, cosine = math.sin(angle), math.cos(angle)
    return numpy.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])


def rotation_z(angle):
    sine, cosine = math.sin(angle), math.cos(angle)
    return numpy.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])


def transform(rotation=None, position=(0, 0, 0)):
    """Returns a homogeneous transform."""
    x = numpy.eye(4)
    x[:3, :3] = numpy.eye(3) if rotation is None else rotation
    x[:3, 3] = position
    return x


def link(joint, q):
    """Returns the pose of a link in the one before it: Rx(alpha) Tx(a) Rz(theta + q) Tz(d), for a prismatic joint Rz(theta) Tz(d + q)."""
    is_prismatic = joint.get("kind") == "prismatic"
    theta, d = (joint["theta"], joint["d"] + q) if is_prismatic else (joint["theta"] + q, joint["d"])
    before = transform(rotation_x(joint["alpha"])) @ transform(position=(joint["a"], 0, 0))
    return before @ transform(rotation_z(theta)) @ transform(position=(0, 0, d))


def links(joints, q):
    """Returns the pose of each link in the base, base first."""
    return list(itertools.accumulate((link(*pair) for pair in zip(joints, q)), numpy.matmul))


def quaternion(rotation):
    """Returns [w, x, y, z] with w >= 0."""
    w = math.sqrt(max(0.0, 1 + numpy.trace(rotation))) / 2
    if w > 1e-6:
        xyz = [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
        return [w, *(float(part) / (4 * w) for part in xyz)]
    axis = numpy.sqrt(numpy.maximum(0, (numpy.diag(rotation) + 1) / 2))
    first = int(numpy.argmax(axis))
    signs = numpy.where(numpy.arange(3) == first, 1, numpy.sign(rotation[first] + rotation[:, first]))
    return [0.0, *(float(part) for part in axis * signs)]


def pose(x):
    """Returns a transform as the telemetry has it."""
    return {"position": [float(part) for part in x[:3, 3]], "quaternion": quaternion(x[:3, :3])}


def arm_joints(path=ARM):
    """Returns the joints of a hand controller's configuration as a description has them, and their start positions."""
    joints = tomllib.loads(path.read_text())["joint"]
    described = [
        {
            "name": joint["name"], "kind": "revolute", "alpha": math.radians(joint["alpha_deg"]), "a": joint["a_m"], "d": joint["d_m"],
            "theta": math.radians(joint["theta_deg"]), "range": [math.radians(end) for end in joint["limit_deg"]],
            "max_torque": joint["max_torque_nm"], "position_unit": "rad", "torque_unit": "N·m",
        }
        for joint in joints
    ]
    return described, [math.radians(joint["rest_deg"]) for joint in joints]


def robot_joints(path=PUMA):
    """Returns the joints of a robot's file, and their start positions."""
    joints = tomllib.loads(path.read_text())["joint"]
    described = [
        {
            "alpha": math.radians(joint["alpha_deg"]), "a": joint["a_m"], "d": joint["d_m"], "theta": math.radians(joint.get("theta_deg", 0)),
            "range": [math.radians(end) for end in joint["limit_deg"]],
        }
        for joint in joints
    ]
    return described, [math.radians(joint["start_deg"]) for joint in joints]


def description(robot_file=PUMA, tool="cube", scene=("wall",)):
    """Returns the description of an arm that commands a robot, or without `robot_file` an object alone."""
    joints, _ = arm_joints()
    robot, x_b_0 = None, numpy.eye(4)
    if robot_file is not None:
        settings = tomllib.loads(robot_file.read_text())
        turn = [math.radians(angle) for angle in settings.get("tool_deg", [0, 0, 0])]
        base_turn = [math.radians(angle) for angle in settings.get("base_deg", [0, 0, 0])]
        x_b_0 = transform(rotation_z(base_turn[2]), settings["base_m"])
        robot = {
            "name": settings["name"], "joints": robot_joints(robot_file)[0], "x_b_0": pose(x_b_0),
            "x_n_m": pose(transform(rotation_z(turn[2]), settings["tool_m"])),
        }
    tools = {
        "cube": {"kind": "cube", "half_edge": HALF_EDGE},
        "pegs": {
            "kind": "pegs", "x_m_t": pose(transform(rotation_x(math.pi), (0, 0, 0))), "count": 2, "radius": 0.0125, "length": 0.08, "spacing": 0.06,
        },
        None: None,
    }
    parts = {
        "wall": {"point": [WALL_X, 0.0, 0.0], "normal": [-1.0, 0.0, 0.0]},
        "box": {"centre": [0.42, 0.15, 0.2], "half_size": [0.05, 0.04, 0.06]},
        "sphere": {"centre": [0.4, -0.18, 0.25], "radius": 0.05},
        "plate": {
            "x_b_p": pose(transform(None, (0.4, 0.0, 0.15))), "half_size": [0.1, 0.07], "thickness": 0.03,
            "hole_count": 2, "hole_radius": 0.0128, "hole_spacing": 0.06,
        },
    }
    return {
        "version": 1, "kind": "description", "program": "frhc 0.1.0", "source": "demo", "configuration": "kraft_like.toml",
        "started_at": None, "period_us": PERIOD_US, "cycles_per_snapshot": CYCLES_PER_SNAPSHOT,
        "hand": {"joints": joints, "x_6_g": pose(transform(position=(0, 0, 0.075)))},
        "robot": robot, "x_m_s": pose(numpy.eye(4)), "tool": tools[tool],
        "scene": {name: parts[name] if name in scene else None for name in parts},
        "buses": [{"name": "joints", "bitrate": 1_000_000, "load_limit_percent": 90.0}],
        "stops_by": ["heartbeat consumer 5 ms, RPDO timer 5 ms"] * len(joints),
    }


def mode(cycle, name="engaged", cause=None, not_off=(), way_out=()):
    return {
        "version": 1, "kind": "mode", "cycle": cycle, "at_us": cycle * PERIOD_US, "mode": name, "stopped_by": cause,
        "not_off": list(not_off), "way_out": list(way_out),
    }


def percentiles(p50, p99, most):
    return {"count": 500, "p50": p50, "p99": p99, "p99.9": most, "max": most}


class Motion:
    """Motion of the arm, of the commanded side and of the wrenches, as functions of the cycle."""

    def __init__(self, described, stop_at=None):
        self.described = described
        self.stop_at = math.inf if stop_at is None else stop_at
        self.start = arm_joints()[1]
        self.robot_start = robot_joints()[1] if described["robot"] else None

    def q(self, seconds):
        phases = [0.9, 0.6, 0.75, 1.1, 1.3, 0.8]
        sizes = [0.25, 0.12, 0.18, 0.2, 0.25, 0.4]
        ends = [joint["range"] for joint in self.described["hand"]["joints"]]
        raw = [start + size * math.sin(phase * seconds) for start, size, phase in zip(self.start, sizes, phases)]
        return [min(max(value, low), high) for value, (low, high) in zip(raw, ends)]

    def q_r(self, seconds):
        if self.robot_start is None:
            return None
        sizes = [0.12, 0.06, 0.1, 0.1, 0.12, 0.2, 0.1, 0.1, 0.1]
        return [start + size * math.sin(0.7 * seconds + 0.3 * joint) for joint, (start, size) in enumerate(zip(self.robot_start, sizes))]

    def x_b_m(self, seconds):
        if self.robot_start is None:
            return transform(rotation_z(0.2 * math.sin(seconds)), (0.4 + 0.03 * math.sin(0.7 * seconds), 0.06 * math.sin(0.5 * seconds), 0.3))
        robot = self.described["robot"]
        return transform_of(robot["x_b_0"]) @ links(robot["joints"], self.q_r(seconds))[-1] @ transform_of(robot["x_n_m"])

    def snapshot(self, number):
        """Returns the snapshot with this number, from 0."""
        cycle = number * CYCLES_PER_SNAPSHOT
        seconds = cycle * PERIOD_US / 1e6
        is_stopped = seconds >= self.stop_at
        held = min(seconds, self.stop_at)
        q, x_b_m = self.q(held), self.x_b_m(held)
        hand = self.described["hand"]
        x_0_g = links(hand["joints"], q)[-1] @ transform_of(hand["x_6_g"])
        depth = 0.0 if is_stopped else max(0.0, x_b_m[0, 3] + HALF_EDGE + 0.012 - WALL_X)
        push = min(9.0, 600 * depth) + (0.15 * math.sin(40 * seconds) if depth else 0.0)
        force_in_b = numpy.array([-push, 0.12 * push * math.sin(3 * seconds), 0.05 * push])
        force = x_b_m[:3, :3].T @ force_in_b
        f_s = [*map(float, force), 0.0, 0.002 * push, 0.0]
        felt = 0.0 if is_stopped else 0.3
        f_task = [felt * part for part in f_s]
        f_g = [*map(float, x_0_g[:3, :3].T @ (felt * force_in_b)), 0.0, 0.0006 * push, 0.0]
        name = "drives-off" if is_stopped else "engaged"
        share = [abs(math.sin(0.4 * seconds + joint)) * 0.35 + 0.02 * push for joint in range(6)]
        share = [0.0] * 6 if is_stopped else share
        signed = [part * joint["max_torque"] * (-1) ** number for number, (part, joint) in enumerate(zip(share, hand["joints"]))]
        budget = {"task": [0.2 * part for part in signed], "gravity": [0.7 * part for part in signed], "centring": [0.05 * part for part in signed],
                  "damping": [-0.03 * part for part in signed], "passivity": [0.0] * 6, "soft_stops": [0.0] * 6, "friction": [0.08 * part for part in signed],
                  "assist_scale": 1.0, "rest_scale": 1.0, "limiting_joint": None, "slewing_joint": None}
        speed = [0.1 * math.cos(held * phase) for phase in (0.7, 0.5, 0.9, 1.0, 0.8, 0.6)]

        def span(values, width):
            return {"min": [value - width for value in values], "max": [value + width for value in values]}

        return {
            "version": 1, "kind": "snapshot", "cycle": cycle, "at_us": cycle * PERIOD_US, "mode": name, "stopped_by": STOP if is_stopped else None,
            "not_off": [3] if is_stopped else [], "overruns": 0, "missing_samples": 3 if is_stopped else 0,
            "lost": {"frames": 0, "records": 0, "inputs": 0, "events": 0, "of_session": 0, "of_faults": 0},
            "foreign_uploads": 0, "unread_settings": 0, "reflection": "on", "q": q, "tau": signed, "targets": [int(100 * part) for part in signed],
            "budget": budget, "f_g_task": f_task, "p_b_m": [float(part) for part in x_b_m[:3, 3]], "switches_online": True,
            "timing": {
                "wake_up_late_us": percentiles(12, 45, 80), "sync_to_last_sample_us": percentiles(502, 520, 560),
                "step_us": percentiles(9, 14, 22), "sync_to_last_target_us": percentiles(560, 610, 690),
                "sync_to_confirmation_us": percentiles(60, 70, 90),
                "sync_to_sample_us": {key: [200, 260, 320, 380, 440, 500] for key in ("p50", "p99", "p99.9", "max")},
            },
            "sampled": [joint != 2 or not is_stopped for joint in range(6)], "limit_used": share,
            "command": {"kind": "hold"} if is_stopped else {"kind": "rate", "v_m": speed},
            "x_0_g": pose(x_0_g), "x_0_h": pose(transform(position=(0.25, 0, 0.1))), "x_b_m": pose(x_b_m), "q_r": self.q_r(held),
            "f_s": f_s, "f_g": f_g, "energy": -0.02 + 0.012 * math.sin(0.6 * held), "tank": 0.05, "activity": 0.1 if depth else 0.0,
            "spans": {"f_s": span(f_s, 0.3), "f_g_task": span(f_task, 0.1), "tau": span(signed, 0.02), "v_g": span(speed, 0.01)},
            "buses": [{"load_percent": 79.7 + math.sin(seconds), "frames_per_s": 9710.0}], "sample_age_us": 1000.0,
            "watchdogs": [
                {"name": "samples missed in a row", "value": 3 if is_stopped else 0, "limit": 3, "unit": "cycles"},
                {"name": "SYNC late", "value": 45.0 + 20 * math.sin(seconds), "limit": 500.0, "unit": "µs"},
                {"name": "joint speed", "value": 0.3 * abs(math.cos(held)), "limit": 6.0, "unit": "rad/s"},
            ],
        }

    def mode(self, number):
        """Returns the mode at the snapshot with this number."""
        cycle = number * CYCLES_PER_SNAPSHOT
        if cycle * PERIOD_US / 1e6 >= self.stop_at:
            return mode(cycle, "drives-off", STOP, ["elbow"], WAY_OUT)
        return mode(cycle)


def transform_of(described):
    """Returns the transform of a pose of the telemetry."""
    w, x, y, z = described["quaternion"]
    turn = numpy.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])
    return transform(turn, described["position"])


class Feed:
    """A socket that sends the lines of a motion, or those set by `show`, to each reader; `with` removes it."""

    def __init__(self, path, motion=None, per_second=50):
        self.path, self.motion, self.per_second = Path(path), motion, per_second
        self.lock = threading.Lock()
        self.shown = None
        self.readers = []
        self.number = 0
        self.is_ending = threading.Event()

    def __enter__(self):
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(FileNotFoundError):
            self.path.unlink()
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.listener.bind(str(self.path))
        self.listener.listen(16)
        self.threads = [threading.Thread(target=work, daemon=True) for work in (self.accept, self.send_snapshots)]
        for thread in self.threads:
            thread.start()
        return self

    def __exit__(self, *_):
        self.is_ending.set()
        with contextlib.suppress(OSError):
            self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        for thread in self.threads:
            thread.join()
        for reader in self.readers:
            reader.close()
        with contextlib.suppress(FileNotFoundError):
            self.path.unlink()

    def show(self, *lines):
        """Sends these lines to all readers, and to each that comes later; lines are objects, or text as it is."""
        with self.lock:
            self.shown = lines
            self.send(lines)

    def accept(self):
        while not self.is_ending.is_set():
            try:
                reader, _ = self.listener.accept()
            except OSError:
                return
            with self.lock:
                self.readers.append(reader)
                if self.shown is not None:
                    self.send(self.shown, [reader])
                elif self.motion is not None:
                    self.send([self.motion.described, self.motion.mode(self.number)], [reader])

    def send_snapshots(self):
        start = time.monotonic()
        while self.motion is not None and not self.is_ending.wait(max(0.0, start + self.number / self.per_second - time.monotonic())):
            with self.lock:
                if self.shown is None:
                    # A change of mode is sent at once.
                    now, before = self.motion.mode(self.number), self.motion.mode(max(0, self.number - 1))
                    if self.number % MODE_EVERY == 0 or now["mode"] != before["mode"]:
                        self.send([now])
                    self.send([self.motion.snapshot(self.number)])
                self.number += 1

    def send(self, lines, readers=None):
        text = "".join((line if isinstance(line, str) else json.dumps(line, ensure_ascii=False)) + "\n" for line in lines).encode()
        for reader in list(readers or self.readers):
            try:
                reader.sendall(text)
            except OSError:
                self.readers.remove(reader)
                reader.close()


def hostile(described):
    """Gives the joints, the robot and the buses names that a page must show, never obey."""
    for joint, name in zip(described["hand"]["joints"], itertools.cycle(HOSTILE)):
        joint["name"] = name
    described["configuration"] = HOSTILE[0]
    described["buses"] = [{"name": name, "bitrate": 1_000_000, "load_limit_percent": 90.0} for name in HOSTILE[:2]]
    if described["robot"]:
        described["robot"]["name"] = HOSTILE[0] + "b" * 1000
    return described


def main():
    parser = argparse.ArgumentParser(description="Offers the telemetry of an arm that moves, to look at.")
    parser.add_argument("socket", type=Path)
    parser.add_argument("--plain", action="store_true", help="no robot: the object alone")
    parser.add_argument("--tool", choices=["cube", "pegs"], default="cube")
    parser.add_argument("--scene", default="wall", help="parts of the scene, with commas")
    parser.add_argument("--stop-at", type=float, metavar="S", help="stops after this time")
    parser.add_argument("--hostile", action="store_true", help="hostile names")
    args = parser.parse_args()
    described = description(None if args.plain else PUMA, args.tool, args.scene.split(","))
    if args.hostile:
        hostile(described)
    with Feed(args.socket, Motion(described, args.stop_at)), contextlib.suppress(KeyboardInterrupt):
        threading.Event().wait()


if __name__ == "__main__":
    main()
