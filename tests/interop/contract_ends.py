"""The package of python/ against the contract in Rust: the same bytes, rejects and decisions for random messages and events.

The Rust side is contract_ends.rs, an example of the crate `frhc-contract`; CONTRACT_ENDS is its program.
"""

import json
import os
import random
import struct
import subprocess
from pathlib import Path

import package  # the path of the package
from frhc import codec
from frhc.capability import Capability, PayloadRemoval
from frhc.far_end import FarEnd
from frhc.messages import Command, Echo, Feedback, Gripper, Head, Measured, Pose, Rate
from frhc.reasons import Reason, Rejected

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("CONTRACT_ENDS", str(ROOT / "target/debug/examples/contract_ends"))
COUNT, SEED = 1200, 35
ARM, FAR, MICROSECOND = 7, 22, 1000
LAYOUTS = {"Command": codec.COMMAND, "Feedback": codec.FEEDBACK, "Capability": codec.CAPABILITY}
FLAGS = "senses_wrench", "senses_pose", "has_gripper", "follows_rates", "follows_poses"
NUMBERS = 0.0, -0.0, 1.0, -1.0, 100.0, 1000.0, 1e5, 1e9, 5e-324, float("inf"), -float("inf"), float("nan")


def rust(*arguments, lines=()):
    """Runs the Rust side; returns the lines that it prints."""
    text = "".join(f"{line}\n" for line in lines)
    done = subprocess.run([PROGRAM, *map(str, arguments)], input=text, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout.splitlines()


def pose_of(values):
    return values and Pose(tuple(values[:3]), tuple(values[3:]))


def encoded(row):
    """Encodes the fields of a message of the Rust side."""
    arm, epoch, *numbers = row["head"]
    head = Head(arm, epoch, Echo(*numbers[:2]), Echo(*numbers[2:]))
    gripper = Gripper(*row["gripper"]) if row.get("gripper") else None
    if row["kind"] == "Command":
        motion = Rate(tuple(row["rate"])) if row["rate"] else pose_of(row["pose"])
        return Command(head, motion, row["engaged"], row["asks_capability"], gripper).encode()
    if row["kind"] == "Feedback":
        measured = Measured(row["wrench"] and tuple(row["wrench"]), pose_of(row["pose"]), gripper)
        return Feedback(head, Reason(row["reason"]), row["obeyed_session"], row["acted_sequence"], measured).encode()
    servo_lag, sample_period, hold_after = row["times"]
    arrays = "accommodation", "deadband", "sensor_range", "stiffest_contact", "max_speed", "workspace_low", "workspace_high"
    return Capability(**dict(zip(FLAGS, row["flags"])), payload_removal=PayloadRemoval(row["payload_removal"]),
                      servo_lag=servo_lag, sample_period=sample_period, hold_after=hold_after,
                      **{name: row[name] for name in arrays}).encode(head)


def decoded(message):
    """Returns what each decoder makes of a message, as the Rust side prints it."""
    found = {}
    for kind in (Command, Feedback, Capability):
        try:
            result = kind.decode(message)
            again = result[1].encode(result[0]) if kind is Capability else result.encode()
            found[kind.__name__] = again.hex()
        except Rejected as rejected:
            found[kind.__name__] = rejected.reject.value
    return found


def rows():
    found = [json.loads(line) for line in rust("messages", SEED, COUNT)]
    assert len(found) == COUNT
    return found


def python_encodes_messages_to_the_bytes_of_rust(_):
    for number, row in enumerate(rows()):
        assert encoded(row).hex() == row["bytes"], f"message {number}: {row}"


def python_and_rust_decode_each_other_s_messages(_):
    """Each message is encoded again by both: what one wrote, the other reads to the same values."""
    messages = [encoded(row) for row in rows()]
    for number, (message, line) in enumerate(zip(messages, rust("decode", lines=[one.hex() for one in messages]))):
        ours, theirs = decoded(message), json.loads(line)
        assert ours == theirs, f"message {number}: {ours}, {theirs}"
        assert message.hex() in ours.values(), f"message {number} is rejected: {ours}"


def mutated(draw, message, kind):
    """Changes a message: bytes, length, kind, or a number at a field."""
    message, way = bytearray(message), draw.randrange(5)
    if way == 0:  # bytes of head and codes
        for _ in range(draw.randrange(1, 4)):
            message[draw.randrange(52)] = draw.choice((0, 1, 2, 3, 4, 7, 8, 9, 255))
    elif way == 1:
        message[draw.randrange(len(message))] ^= 1 << draw.randrange(8)
    elif way == 2:
        length = draw.choice((0, 3, 4, 5, 6, 7, 43, 44, 188, 196, 276, draw.randrange(300)))
        message = (message + bytes(300))[:length]
    elif way == 3:
        places = range(52 if kind == "Command" else 68 if kind == "Feedback" else 52, len(message) - 8, 8)
        for _ in range(draw.randrange(1, 4)):
            struct.pack_into("<d", message, draw.choice(places), draw.choice(NUMBERS) * draw.choice((1.0, 1.0, 1.0000001)))
    else:
        message[4] = draw.randrange(5)
    return bytes(message)


def python_and_rust_reject_mutated_messages_for_the_same_reason(_):
    draw, messages = random.Random(SEED), []
    for row in rows():
        for _ in range(10):
            messages.append(mutated(draw, bytes.fromhex(row["bytes"]), row["kind"]))
    answers = rust("decode", lines=[message.hex() for message in messages])
    seen = {}
    for message, line in zip(messages, answers):
        ours, theirs = decoded(message), json.loads(line)
        assert ours == theirs, f"{message.hex()}: {ours}, {theirs}"
        for name, result in ours.items():
            seen.setdefault(name, set()).add(result if " " in result or len(result) < 20 else "accepted")
    for name, results in seen.items():
        assert results == {"accepted", "length", "foreign", "version", "impossible"}, f"{name}: {results}"


class Play:
    """Events of a far side with three nodes, over a network that delays, loses, repeats and reorders."""

    def __init__(self, seed):
        self.draw, self.far, self.now = random.Random(seed), FarEnd(ARM, FAR, 100_000 * MICROSECOND), 1_000_000
        self.lines, self.outcomes, self.on_the_way, self.sent = [], [], [], []
        self.nodes = [dict(session=100 + n, sequence=0, epoch=0, echo=Echo(0, 0)) for n in range(3)]

    def event(self, line, outcome):
        self.lines.append(line)
        self.outcomes.append(outcome)

    def send(self):
        """A node sends a command."""
        draw = self.draw
        node = self.nodes[0] if draw.random() < 0.85 else draw.choice(self.nodes)
        node["epoch"] += draw.random() < 0.05
        node["sequence"] += 1 if draw.random() < 0.99 else draw.randrange(1, 300)
        echo = node["echo"] if draw.random() < 0.95 else Echo(draw.choice((0, 1, FAR)), draw.randrange(5000))
        arm = ARM if draw.random() < 0.99 else ARM + 1
        motion = draw.choice((None, Rate((0.25 * draw.randrange(9),) + (0.0,) * 5), Pose((0.5, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))))
        head = Head(arm, node["epoch"], Echo(node["session"], node["sequence"]), echo)
        message = Command(head, motion, asks_capability=draw.random() < 0.1).encode()
        for _ in range(draw.choice((0, 1, 1, 1, 1, 1, 1, 1, 2))):
            delay = draw.randrange(3_000) if draw.random() < 0.9 else draw.randrange(200_000)
            self.on_the_way.append((self.now + delay, message))

    def cycle(self):
        draw = self.draw
        self.now += draw.choice((1_000, 2_000, 2_000, 2_000, 5_000)) if draw.random() < 0.98 else draw.randrange(400_000)
        self.send()
        due = [message for at, message in self.on_the_way if at <= self.now]
        self.on_the_way = [item for item in self.on_the_way if item[0] > self.now]
        time = self.now * MICROSECOND
        for message in draw.sample(due, len(due)) if draw.random() < 0.2 else due:
            reject = self.far.on_message(time, message)
            self.event(f"take {self.now} {message.hex()}", reject.value if reject else "-")
        if draw.random() < 0.02:
            reason = draw.choice(list(Reason)[3:])
            self.far.hold(reason)
            self.event(f"hold {int(reason)}", "-")
        motion = (command := self.far.command(time)) and command.motion
        values = list(motion.twist if isinstance(motion, Rate) else motion.position + motion.orientation) if motion else "hold"
        self.event(f"command {self.now}", str(values))
        feedback = self.far.feedback(time, Measured())
        self.event(f"feedback {self.now}", feedback.hex())
        capability = self.far.capability(time, Capability())
        self.event(f"capability {self.now}", capability.hex() if capability else "-")
        if draw.random() < 0.9:
            head = Feedback.decode(feedback).head
            self.sent.append(head.own)
            for node in self.nodes:
                if draw.random() < 0.9:
                    node["echo"] = head.own if draw.random() < 0.9 else draw.choice(self.sent[-100:])


def python_and_rust_decide_alike_on_random_events(_):
    rejects, reasons, moves = set(), set(), 0
    for seed in range(30):
        play = Play(seed)
        for _ in range(1000):
            play.cycle()
        answers = rust("far-end", ARM, FAR, lines=play.lines)
        assert len(answers) == len(play.lines)
        for number, (line, ours, theirs) in enumerate(zip(play.lines, play.outcomes, answers)):
            assert ours == theirs, f"seed {seed}, event {number}, {line}: {ours}, {theirs}"
            if line.startswith("feedback"):
                reasons.add(Feedback.decode(bytes.fromhex(ours)).reason)
            moves += line.startswith("command") and ours != "hold"
        rejects |= {reject.value for reject in play.far.rejects}
    assert moves > 1000, f"{moves} moves"
    assert reasons == set(Reason), f"reasons: {reasons}"
    expected = {"arm", "session", "never sent", "old", "overtaken", "replayed", "not leader", "left"}
    assert rejects == expected, f"rejects: {rejects}"


TESTS = [python_encodes_messages_to_the_bytes_of_rust, python_and_rust_decode_each_other_s_messages,
         python_and_rust_reject_mutated_messages_for_the_same_reason, python_and_rust_decide_alike_on_random_events]
