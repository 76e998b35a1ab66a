#!/usr/bin/env python3
"""Judge of a far side: a node by the rules of docs/link.md that listens on a SEQPACKET socket.

    far_side.py [--frhc FILE] [--far-side FILE] [--page FILE] [NAME ...]

Judges examples/far_side_local.py, which is the package of python/ with a robot, or `FILE robot` with --frhc. The judge's
messages have the codec of the package. Runs the tests whose name contains a NAME (all without one). Exit code 0 if they
pass, 1 if not. Each test starts its own far side. Python 3.9 or later on Linux, with numpy.
"""
import argparse
import json
import math
import os
import random
import re
import secrets
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
import traceback
from pathlib import Path

import package
from frhc import codec as far
from frhc.far_end import FarEnd
from frhc.reasons import Reject

HOLD, RATE, POSE = 0, 1, 2
NOT_ARMED, SILENCE, WRENCH_LIMIT, END_OF_PROCESS, FAULT = 1, 2, 6, 7, 8
HOLDING, FOLLOWING = 0, 1
PERIOD_S, LIMIT_S = 0.002, 0.1  # the period is that of both ends
X_RATE = (0.1, 0, 0, 0, 0, 0)  # slower than the speed limits
ROOT = Path(__file__).resolve().parent.parent.parent

judged = None  # program under test, set in main()
page_path = None


def now():
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class PythonExample:
    """examples/far_side_local.py: an object without mass, which moves at once."""

    MAX_SPEED = 0.25  # in m/s
    SPEED_SHARES = 0.99, 1 + 1e-9  # least and greatest share of it on a longer way
    STOPPING_M = 0.0  # way from X_RATE to rest
    # After a pause: the signal may stop the process between its check and its motion.
    CONTINUED_M = MAX_SPEED * PERIOD_S
    EXACT_M = 1e-9
    CAPABILITY = dict(senses=7, follows=3, payload_removal=0, accommodation=(0.0,) * 6, sample_period=0.002,
                      hold_after=0.1)

    LEFT_OUT = {  # tests by how their names begin, each with the reason
        "wrench_above_the_limit": "the Python program has no limit of its own",
    }

    def __init__(self, path):
        self.path = path

    def command(self, socket_path, arm, options):
        return [sys.executable, self.path, socket_path, "--arm", str(arm), *options]


class FrhcRobot:
    """`frhc robot`: an arm with masses and servos of a lag of 10 ms. Its cycle is that of its configuration, 2 ms."""

    CONFIG, ROBOT = ROOT / "config/kraft_like_500hz.toml", ROOT / "config/robots/puma560.toml"
    MAX_SPEED = 0.5
    SPEED_SHARES = 0.95, 1.01  # the rates of its joints are those of the posture one lag before
    STOPPING_M = 0.0012  # 0.1 m/s times the lag, and a fifth for its limits of acceleration
    # The simulation moves on for ten periods at most, with the rates from before the pause.
    CONTINUED_M = 10 * 0.1 * PERIOD_S + STOPPING_M
    EXACT_M = 1e-4
    CAPABILITY = dict(senses=3, follows=3, payload_removal=1, accommodation=(0.01,) * 3 + (0.5,) * 3,
                      sample_period=0.002, hold_after=0.1)

    OF_THE_CODEC = "a test of the judge's codec, which is that of the Python package"
    OF_OPTIONS = "a test of options of the Python program; tests/program/robot_refused.rs has those of frhc robot"
    LEFT_OUT = {
        "vectors_decode_and_encode": OF_THE_CODEC,
        "lengths_and_offsets": OF_THE_CODEC,
        "wrong_arguments": OF_OPTIONS,
        "start_is_the_first_position": OF_OPTIONS,
        "wall_pushes_the_object_back": OF_OPTIONS,
    }

    def __init__(self, path):
        self.path = path

    def command(self, socket_path, arm, keys):
        """`keys` are lines of [remote.link]."""
        config = self.CONFIG
        if keys:
            text = config.read_text().replace('"../eds/', f'"{ROOT}/eds/')
            config = Path(socket_path).parent / "config.toml"
            config.write_text("\n".join([text, "[remote.link]", *keys, ""]))
        return [self.path, "robot", "--config", str(config), "--robot", str(self.ROBOT), "--socket", socket_path,
                "--arm", str(arm)]


class Node:
    """One session of a node. Several of them may share a connection, to play two nodes."""

    def __init__(self, arm=1):
        self.arm, self.session, self.sequence = arm, 1 + secrets.randbelow(2**64 - 1), 0
        self.epoch, self.mode, self.rate, self.pose = 0, HOLD, (0.0,) * 6, (0.0,) * 6 + (1.0,)
        self.asks_capability, self.echo = 0, (0, 0)

    def message(self, **changes):
        """Next Command as bytes; `changes` replaces fields of it."""
        self.sequence += 1
        fields = dict(kind=1, version=1, arm=self.arm, epoch=self.epoch, session=self.session,
                      sequence=self.sequence, echoed_session=self.echo[0], echoed_sequence=self.echo[1],
                      mode=self.mode, engaged=0, asks_capability=self.asks_capability, has_gripper=0, rate=self.rate,
                      pose=self.pose, gripper_position=0.0, gripper_force=0.0)
        return far.pack(far.COMMAND, **{**fields, **changes})

    def move(self, rate=X_RATE):
        self.mode, self.rate = RATE, rate


class Bench:
    """The far side's process, with options that only this program has, and the node's end of the socket."""

    def __init__(self, *options, arm=1, listen=True):
        self.directory = tempfile.TemporaryDirectory()
        self.path = os.path.join(self.directory.name, "far_side")
        self.connection = self.listener = None
        self.feedbacks, self.capabilities = [], []
        # Per Feedback: it was sent after the first time and received before the second.
        self.sent_after, self.arrivals, self.emptied = [], [], now()
        if listen:
            self.listen()
        self.process = subprocess.Popen(judged.command(self.path, arm, options), stdout=subprocess.DEVNULL,
                                        stderr=subprocess.PIPE, text=True)
        if listen:
            self.accept()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()
        for end in (self.connection, self.listener):
            if end:
                end.close()
        self.directory.cleanup()

    def listen(self):
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.listener.bind(self.path)
        self.listener.listen(1)
        self.listener.settimeout(5)

    def accept(self):
        self.connection = self.listener.accept()[0]
        self.connection.setblocking(False)

    def send(self, message):
        """Sends a message; returns False if the socket was full."""
        try:
            self.connection.send(message)
            return True
        except BlockingIOError:
            return False

    def read(self):
        """Returns the next message that waits, None without one."""
        while True:
            try:
                return self.connection.recv(4096) or None
            except BlockingIOError:
                return None
            except ConnectionResetError:
                continue  # the far side closed with Commands unread; its last messages still follow

    def receive(self):
        """Decodes every message that waits. Returns the newest Feedback of them, or None."""
        newest = None
        while True:
            before = now()
            message = self.read()
            if message is None:
                self.emptied = before
                return newest
            if message[4] == 2:
                newest = far.unpack(far.FEEDBACK, message)
                assert newest is not None, "Feedback of a wrong length"
                assert_valid(newest)
                self.feedbacks.append(newest)
                self.sent_after.append(self.emptied)
                self.arrivals.append(now())
            else:
                capability = far.unpack(far.CAPABILITY, message)
                assert capability is not None and capability.kind == 3, "neither a Feedback nor a Capability"
                self.capabilities.append(capability)

    def run(self, *nodes, seconds=0.06, until=None, fresh=True, **changes):
        """Each of `nodes` sends a Command every 2 ms. Returns the newest Feedback of the run.

        Waits up to 2 s longer for the first Feedback, in case the computer is busy.
        """
        end, newest = now() + seconds, None
        while now() < (end if newest else end + 2):
            feedback = self.receive()
            newest = feedback or newest
            for node in nodes:
                if feedback and fresh:
                    node.echo = (feedback.session, feedback.sequence)
                self.send(node.message(**changes))
            if until and newest and until(newest):
                break
            time.sleep(PERIOD_S)
        assert newest, "no Feedback"
        return newest

    def settle(self):
        """Waits until the far side has acted on all that was sent; returns a Feedback that shows it."""
        self.receive()
        enough = len(self.feedbacks) + 3  # the first of them may have been under way
        end = now() + 2
        while len(self.feedbacks) < enough:
            assert now() < end, "no Feedback"
            time.sleep(PERIOD_S)
            self.receive()
        return self.feedbacks[-1]

    def send_one(self, node):
        """`node` sends a single Command with a fresh echo."""
        self.run(node, until=lambda _: True)

    def lead(self, node):
        """Makes `node` the current session, at its present epoch."""
        feedback = self.run(node, seconds=2, until=lambda f: f.obeyed_session == node.session)
        assert feedback.obeyed_session == node.session, "the node does not lead"
        return feedback

    def follow(self, node, rate=X_RATE):
        """Makes `node` lead and the far side follow `rate`."""
        self.lead(node)
        node.epoch += 1
        node.move(rate)
        feedback = self.run(node, seconds=2, until=lambda f: f.state == FOLLOWING)
        assert feedback.state == FOLLOWING, "the far side does not follow"
        return feedback

    def end(self, number=signal.SIGTERM):
        """Sends a signal. Returns exit code and error text."""
        self.process.send_signal(number)
        _, text = self.process.communicate(timeout=5)
        return self.process.returncode, text


def assert_valid(f):
    """A Feedback is as its table says, every value that counts in its range."""
    assert (f.kind, f.version) == (2, 1) and f.session and f.sequence
    assert (f.state == FOLLOWING) == (f.reason == 0) and f.state <= 1 and f.reason <= 8 and f.valid <= 7
    assert all(abs(v) <= 1e5 for v in f.wrench) and all(abs(v) <= 1000 for v in f.pose[:3])
    assert abs(math.hypot(*f.pose[3:]) - 1) <= 1e-6


def assert_equal(got, expected):
    assert got == expected, f"expected {expected}, got {got}"


def assert_still(before, after, tolerance=None):
    """The far side holds: it moves by the way that it needs to stop, at most."""
    tolerance = judged.STOPPING_M if tolerance is None else tolerance
    distance = math.dist(before.pose[:3], after.pose[:3])
    assert distance <= tolerance, f"moved by {distance * 1e3:.3f} mm from {before.pose[:3]} to {after.pose[:3]}"


def assert_orderly(code, text):
    """The program ended by its own will."""
    assert_equal(code, 0)
    assert "Traceback" not in text and "panicked" not in text, text


def moved_in_tool(before, after):
    """Way from one pose to the next in m, written in {MRF} of the first."""
    x, y, z, w = before.pose[3:]
    way = [b - a for a, b in zip(before.pose[:3], after.pose[:3])]
    # Columns of the rotation matrix: the axes of {MRF} in {b}.
    axes = ((1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)),
            (2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)),
            (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)))
    return [sum(a * w for a, w in zip(axis, way)) for axis in axes]


# The page

def test_vectors_decode_and_encode_to_the_same_bytes():
    layouts = {"Command": far.COMMAND, "Feedback": far.FEEDBACK, "Capability": far.CAPABILITY}
    blocks = [json.loads(b) for b in re.findall(r"```json\n(.*?)```", Path(page_path).read_text(), re.S)]
    assert_equal(len(blocks), 4)
    for block in blocks:
        layout, message = layouts[block["type"].split("/")[-1]], bytes.fromhex("".join(block["bytes"]))
        fields = far.unpack(layout, message)
        expected = {name: numbers(value) for name, value in (block["fields"] | block["fields"]["head"]).items()}
        got = {name: numbers(value) for name, value in vars(fields).items()}
        for name in (set(expected) | set(got)) - {"head"}:
            if not name.startswith("reserved"):
                assert got[name] == expected[name], f"{name}: expected {expected[name]}, got {got[name]}"
        assert_equal(far.pack(layout, **vars(fields)), message)
        if layout is far.COMMAND:
            reject = {arm: FarEnd(arm, 1, 10**8).on_message(0, message) for arm in (7, 1)}
            # Its echo is of no message of these ends.
            assert_equal(reject, {7: Reject.SESSION, 1: Reject.ARM})


def numbers(value):
    """Numbers of a field, in order: interface files name x, y, z where the tables have arrays."""
    if isinstance(value, dict):
        value = list(value.values())
    return [n for v in value for n in numbers(v)] if isinstance(value, (list, tuple)) else [value]


def test_lengths_and_offsets_are_those_of_the_tables():
    page = Path(page_path).read_text()
    size = dict(uint8=1, uint16=2, uint32=4, uint64=8, float64=8)
    rows = lambda title: re.findall(r"\| (\d+) \| (\w+?)(?:\[(\d)\])? \| (\w+) \|", section(page, title))
    for title, layout in (("Command", far.COMMAND), ("Feedback", far.FEEDBACK), ("Capability", far.CAPABILITY)):
        offset, names = 0, []
        for at, kind, count, name in rows("Head") + rows(title):
            assert_equal(int(at), offset)
            offset += size[kind] * int(count or 1)
            names.append(name)
        assert_equal(list(layout.fields), names)
        assert_equal(int(re.search(r"(\d+) bytes", section(page, title))[1]), offset + 4)


def section(page, title):
    return page.split(f"### {title}\n")[1].split("\n##")[0]


# The process

def test_wrong_arguments_give_one_error_line_and_exit_2():
    for arguments in ([], ["p", "q"], ["p", "--arm", "x"], ["p", "--arm", "70000"], ["p", "--wall", "x", "nan"],
                      ["p", "--start", "0", "0"], ["p", "--start", "0", "nan", "0"], ["p", "--start", "9", "0", "0"],
                      ["p", "--what"], ["p" * 200], [""]):
        done = subprocess.run([sys.executable, judged.path, *arguments], capture_output=True, text=True, timeout=5)
        assert_equal((done.returncode, done.stdout, done.stderr.count("\n")), (2, "", 1))


def test_far_side_waits_until_a_node_listens():
    with Bench(listen=False) as bench:
        time.sleep(0.4)
        assert bench.process.poll() is None
        bench.listen()
        bench.accept()
        bench.follow(Node())


def test_signal_without_a_node_exits_0():
    with Bench(listen=False) as bench:
        time.sleep(0.3)
        assert_orderly(*bench.end())


def test_sigterm_and_sigint_send_end_of_process_and_exit_0():
    for number in (signal.SIGTERM, signal.SIGINT):
        with Bench() as bench:
            bench.follow(Node())
            assert_orderly(*bench.end(number))
            bench.feedbacks.clear()
            bench.receive()
            ends = [f for f in bench.feedbacks if f.reason == END_OF_PROCESS]
            assert len(ends) >= 3, f"{len(ends)} with the reason"
            assert_still(ends[0], ends[-1])
            assert_equal(bench.feedbacks[-1].reason, END_OF_PROCESS)


def test_later_epoch_after_sigterm_has_no_effect():
    with Bench() as bench:
        node = Node()
        bench.follow(node)
        bench.process.send_signal(signal.SIGTERM)
        while bench.process.poll() is None:
            feedback = bench.receive()
            if feedback:
                node.echo = (feedback.session, feedback.sequence)
            node.epoch += 1
            try:
                bench.send(node.message())
            except OSError:
                break
        bench.process.wait(5)
        reasons = [f.reason for f in bench.feedbacks]
        assert set(reasons[reasons.index(END_OF_PROCESS):]) == {END_OF_PROCESS}


def test_first_reason_stays_at_sigterm():
    with Bench() as bench:
        bench.follow(Node())
        time.sleep(0.25)
        assert_equal(bench.end()[0], 0)
        bench.receive()
        assert_equal(bench.feedbacks[-1].reason, SILENCE)


def test_not_armed_gives_way_to_the_end_of_the_process():
    with Bench() as bench:
        bench.lead(Node())
        assert_equal(bench.end()[0], 0)
        bench.receive()
        assert_equal(bench.feedbacks[-1].reason, END_OF_PROCESS)


def test_end_of_file_holds_and_reconnection_keeps_the_session():
    with Bench() as bench:
        node = Node()
        before = bench.follow(node)
        bench.connection.close()
        time.sleep(0.25)
        bench.accept()
        after = bench.run(node)
        assert_equal((after.session, after.reason, after.obeyed_session), (before.session, SILENCE, node.session))
        node.epoch += 1
        assert_equal(bench.run(node).state, FOLLOWING)


def test_node_that_does_not_read_blocks_nothing():
    with Bench() as bench:
        node = Node()
        bench.follow(node)
        time.sleep(1.5)  # 750 Feedbacks; the socket holds fewer
        node.epoch += 1
        assert_equal(bench.run(node, seconds=0.3).state, FOLLOWING)
        gaps = [b.sequence - a.sequence for a, b in zip(bench.feedbacks, bench.feedbacks[1:])]
        assert max(gaps) > 1, "the socket was never full: the test is too short"


def test_flood_of_messages_delays_no_feedback():
    with Bench() as bench:
        node = Node()
        bench.follow(node, rate=(0.0,) * 6)
        for _ in range(250):
            bench.send(node.message())
        bench.receive()
        bench.arrivals.clear()
        bench.run(seconds=0.1)
        assert len(bench.arrivals) >= 20, f"{len(bench.arrivals)} Feedbacks in 100 ms"


# The messages of the far side

def test_feedback_every_2_ms_numbered_without_gap():
    with Bench() as bench:
        node = Node()
        node.asks_capability = 1
        bench.run(node, seconds=0.1)
        bench.run(node, seconds=0.5)
        numbers_seen = sorted(m.sequence for m in bench.feedbacks + bench.capabilities)
        assert_equal(numbers_seen, list(range(1, len(numbers_seen) + 1)))
        assert_equal(len({m.session for m in bench.feedbacks + bench.capabilities}), 1)
        span = bench.arrivals[-1] - bench.arrivals[0]
        period = span / (len(bench.arrivals) - 1)
        assert 0.0019 < period < 0.004, f"mean period {period * 1e3:.2f} ms"


def test_sessions_differ_between_processes():
    sessions = set()
    for _ in range(3):
        with Bench() as bench:
            sessions.add(bench.run(Node()).session)
    assert_equal(len(sessions), 3)


def test_capability_answers_only_a_command_that_asks():
    with Bench(arm=3) as bench:
        node = Node(arm=3)
        bench.lead(node)
        bench.run(node)
        assert_equal(bench.capabilities, [])
        node.asks_capability = 1
        bench.run(node)
        assert bench.capabilities, "no answer"
        node.asks_capability = 0
        bench.run(node)
        count = len(bench.capabilities)
        bench.run(node)
        assert_equal(len(bench.capabilities), count)

        c = bench.capabilities[0]
        assert_equal((c.arm, c.session), (3, bench.feedbacks[0].session))
        assert c.echoed_session == node.session and 0 < c.echoed_sequence <= node.sequence
        assert_equal({name: getattr(c, name) for name in judged.CAPABILITY}, judged.CAPABILITY)
        assert all(low < high for low, high in zip(c.workspace_low, c.workspace_high))


# Who leads and what acts

def test_without_a_node_the_far_side_holds_not_armed():
    with Bench() as bench:
        f = bench.run(seconds=0.15)
        assert_equal((f.state, f.reason, f.obeyed_session, f.acted_sequence, f.epoch), (HOLDING, NOT_ARMED, 0, 0, 0))
        assert_equal((f.echoed_session, f.echoed_sequence), (0, 0))
        assert f.valid & 3 == 3


def test_epoch_0_holds_not_armed():
    with Bench() as bench:
        node = Node()
        node.move()
        first = bench.lead(node)
        last = bench.run(node, seconds=0.3)
        assert_equal((last.state, last.reason, last.obeyed_session, last.acted_sequence),
                     (HOLDING, NOT_ARMED, node.session, 0))
        assert_still(first, last)
        assert last.echoed_session == node.session and node.sequence - last.echoed_sequence < 20


def test_present_epoch_of_a_new_session_moves_nothing():
    with Bench() as bench:
        node = Node()
        node.epoch = 5
        node.move()
        first = bench.lead(node)
        last = bench.run(node, seconds=0.2)
        assert_equal((last.reason, last.epoch), (NOT_ARMED, 5))
        assert_still(first, last)


def test_later_epoch_follows_at_the_commanded_rate():
    with Bench() as bench:
        node = Node()
        first = bench.follow(node)
        last = bench.run(node, seconds=0.3)
        assert_equal((last.state, last.reason, last.epoch), (FOLLOWING, 0, 1))
        assert node.sequence - last.acted_sequence < 20
        seconds = (last.sequence - first.sequence) * PERIOD_S
        x, y, z = moved_in_tool(first, last)
        # A servo comes behind by the way that it needs to stop.
        assert abs(x - 0.1 * seconds) < 0.05 * 0.1 * seconds + judged.STOPPING_M, f"{x / seconds} m/s"
        assert math.hypot(y, z) < judged.EXACT_M, f"{y} m and {z} m across"


def test_mode_hold_in_a_later_epoch_follows_and_stands_still():
    with Bench() as bench:
        node = Node()
        bench.follow(node)
        node.mode = HOLD
        first = bench.run(node)
        assert_equal(first.state, FOLLOWING)
        assert_still(first, bench.run(node))


def test_speed_is_limited_in_rate_and_pose():
    with Bench() as bench:
        node = Node()
        first = bench.follow(node, rate=(-3.0, 4.0, 0, 0, 0, 0))
        bench.run(node, seconds=0.2)
        node.mode, node.pose = POSE, (first.pose[0] - 0.3, *first.pose[1:])
        bench.run(node, seconds=0.2)
        speeds = [math.dist(a.pose[:3], b.pose[:3]) / (b.sequence - a.sequence) / PERIOD_S
                  for a, b in zip(bench.feedbacks, bench.feedbacks[1:])]
        least, greatest = (share * judged.MAX_SPEED for share in judged.SPEED_SHARES)
        assert max(speeds) <= greatest, f"{max(speeds)} m/s"
        speed = statistics.median(speeds[-50:])
        assert speed > least, f"{speed} m/s"


def test_pose_is_reached():
    with Bench() as bench:
        node = Node()
        x, y, z, *turn = bench.follow(node, rate=(0.0,) * 6).pose
        node.mode, node.pose = POSE, (x + 0.03, y, z - 0.04, *turn)
        last = bench.run(node, seconds=0.6)
        off = math.dist(last.pose[:3], node.pose[:3])
        assert off < judged.EXACT_M, f"{off} m"


def test_start_is_the_first_position():
    with Bench("--start", "0.1", "-0.1", "0.2") as bench:
        assert_equal(bench.run().pose, (0.1, -0.1, 0.2, 0.0, 0.0, 0.0, 1.0))


def test_wall_pushes_the_object_back():
    with Bench("--wall", "x", "0.46") as bench:
        node = Node()
        first = bench.follow(node, rate=(0.2, 0, 0, 0, 0, 0))
        assert_equal(first.wrench, (0.0,) * 6)
        last = bench.run(node, seconds=0.2)
        expected = 2000 * (0.46 - last.pose[0])
        assert expected < -10 and abs(last.wrench[0] - expected) < 1e-6, f"{last.wrench[0]} N"
        assert_equal(last.wrench[1:], (0.0,) * 5)


def test_wrench_above_the_limit_holds_and_a_later_epoch_lets_it_fall():
    force = lambda f: math.hypot(*f.wrench[:3])
    with Bench("wrench_limit_n = 30.0") as bench:
        node = Node()
        bench.follow(node, rate=(0, 0, 0.4, 0, 0, 0))
        held = bench.run(node, seconds=3, until=lambda f: f.reason == WRENCH_LIMIT)
        assert_equal((held.state, held.reason), (HOLDING, WRENCH_LIMIT))
        bench.feedbacks.clear()
        for _ in range(25):  # and on in the same direction
            node.epoch += 1
            bench.run(node, seconds=0.1)
        forces = [force(f) for f in bench.feedbacks if f.valid & 1]
        assert 30 < max(forces) < 45, f"{max(forces)} N"
        node.epoch, node.rate = node.epoch + 1, (0, 0, -0.1, 0, 0, 0)
        out = bench.run(node, seconds=0.6)
        assert_equal(out.state, FOLLOWING)
        assert force(out) < 1, f"{force(out)} N"


def test_silence_after_100_ms_without_fresh_echo():
    with Bench() as bench:
        node = Node()
        bench.follow(node)
        stale_from = bench.run(node, seconds=0.1)
        assert_equal(stale_from.state, FOLLOWING)
        bench.run(node, seconds=0.3, fresh=False)  # commands go on, the echo stays
        numbers_seen = [f.sequence for f in bench.feedbacks]
        echoed = numbers_seen.index(node.echo[1])
        holds = [f for f in bench.feedbacks[echoed:] if f.state == HOLDING]
        assert holds and {f.reason for f in holds} == {SILENCE}
        age = bench.arrivals[numbers_seen.index(holds[0].sequence)] - bench.sent_after[echoed]
        assert age >= LIMIT_S, f"held at an echo of at most {age * 1e3:.1f} ms"
        cycles = holds[0].sequence - node.echo[1]  # fewer where the computer is busy and cycles are skipped
        assert cycles <= 53, f"held only {cycles} cycles of 2 ms after the echoed message"
        assert_still(holds[0], holds[-1])
        assert holds[-1].echoed_sequence > stale_from.echoed_sequence + 20, "stale commands must be echoed"

        again = bench.run(node, seconds=0.15)  # a fresh echo, the same epoch
        assert_equal((again.reason, again.obeyed_session), (SILENCE, node.session))
        assert_still(holds[0], again)
        node.epoch += 1
        assert_equal(bench.run(node).state, FOLLOWING)


def test_silence_after_the_last_command():
    with Bench() as bench:
        bench.follow(Node())
        bench.feedbacks.clear()
        last = bench.run(seconds=2, until=lambda f: f.state == HOLDING)  # no node sends
        assert_equal(last.reason, SILENCE)
        assert len(bench.feedbacks) <= 55, f"{len(bench.feedbacks)} Feedbacks"


def test_queue_of_old_commands_moves_nothing():
    with Bench() as bench:
        node = Node()
        bench.follow(node)
        bench.process.send_signal(signal.SIGSTOP)
        time.sleep(0.05)
        before = bench.receive() or bench.feedbacks[-1]
        node.echo = (before.session, before.sequence)
        sent = 0
        for _ in range(500):
            sent += bench.send(node.message())
            time.sleep(PERIOD_S)
        assert sent > 100, f"only {sent} queued"
        assert bench.receive() is None, "the process was not stopped"
        bench.process.send_signal(signal.SIGCONT)
        time.sleep(0.3)
        bench.feedbacks.clear()
        after = bench.receive()
        assert_still(before, after, tolerance=judged.CONTINUED_M)
        assert_still(bench.feedbacks[0], after)
        assert_equal(after.reason, SILENCE)
        assert after.echoed_sequence > before.echoed_sequence + 50, "the queue was not read"
        assert after.acted_sequence - before.acted_sequence <= 16


def test_older_epoch_has_no_effect():
    with Bench() as bench:
        node = Node()
        bench.follow(node)
        node.epoch, node.rate = 2, (0.0,) * 6
        first = bench.run(node)
        assert_equal((first.state, first.epoch), (FOLLOWING, 2))
        for _ in range(50):  # one old command per current one
            feedback = bench.receive()
            if feedback:
                node.echo = (feedback.session, feedback.sequence)
            bench.send(node.message())
            bench.send(node.message(epoch=1, rate=X_RATE))
            time.sleep(PERIOD_S)
        last = bench.run(node)
        assert_equal((last.state, last.epoch), (FOLLOWING, 2))
        assert_still(first, last)
        acted = bench.run(node, seconds=0.05, epoch=1, rate=X_RATE)
        assert_still(first, acted)
        assert acted.acted_sequence < acted.echoed_sequence - 5, "an old command counts as acted"


def test_commands_while_holding_do_not_count_as_acted():
    with Bench() as bench:
        node = Node()
        bench.follow(node)
        bench.run(node, seconds=0.15, fresh=False)
        first = bench.run(node)
        last = bench.run(node)
        assert_equal(first.reason, SILENCE)
        assert first.acted_sequence == last.acted_sequence < first.echoed_sequence < last.echoed_sequence


def test_other_session_is_not_followed_while_the_first_is_fresh():
    with Bench() as bench:
        first, other = Node(), Node()
        before = bench.follow(first, rate=(0.0,) * 6)
        other.epoch = 7
        other.move()
        bench.feedbacks.clear()
        bench.run(first, other, seconds=0.1)
        other.epoch = 8
        bench.run(first, other, seconds=0.1)
        for f in bench.feedbacks:
            assert_equal((f.state, f.epoch), (FOLLOWING, 1))
            assert_equal((f.obeyed_session, f.echoed_session), (first.session, first.session))
        assert_still(before, bench.feedbacks[-1])


def test_session_that_was_left_never_leads_again():
    with Bench() as bench:
        first, other = Node(), Node()
        other.move()
        other.epoch = 3
        bench.follow(first)
        bench.run(other, seconds=0.2)
        before = bench.run(other)
        assert_equal((before.obeyed_session, before.reason, before.epoch, before.acted_sequence),
                     (other.session, NOT_ARMED, 3, 0))
        bench.feedbacks.clear()
        first.epoch = 9
        bench.run(first, seconds=0.3)  # the other one is silent now
        for f in bench.feedbacks:
            assert_equal((f.obeyed_session, f.state, f.echoed_session), (other.session, HOLDING, other.session))
        assert_still(before, bench.feedbacks[-1])
        other.epoch = 4
        assert_equal(bench.run(other).state, FOLLOWING)


def test_echo_of_a_message_never_sent_does_not_lead():
    with Bench() as bench:
        f = bench.run()
        for echo in ((f.session, f.sequence + 10**6), (f.session ^ 1, f.sequence), (0, 0), (f.session, 0)):
            node = Node()
            node.echo = echo
            f = bench.run(node, fresh=False)
            assert_equal((f.obeyed_session, f.reason), (0, NOT_ARMED))
            assert_equal(f.echoed_session, node.session)


def test_session_0_does_not_lead():
    with Bench() as bench:
        node = Node()
        node.session, node.epoch = 0, 1
        node.move()
        first = bench.run(node)
        last = bench.run(node)
        assert_equal((last.reason, last.epoch, last.echoed_sequence), (NOT_ARMED, 0, 0))
        assert_still(first, last)


def test_repeated_and_overtaken_commands_have_no_effect():
    with Bench() as bench:
        node = Node()
        bench.follow(node)
        moving, still = [node.message() for _ in range(2)], node.message(rate=(0.0,) * 6)
        for message in (still, *moving):  # the newest first
            bench.send(message)
        node.rate = (0.0,) * 6
        before = bench.settle()
        for _ in range(10):
            bench.send(moving[0])
        after = bench.settle()
        assert_still(before, after)
        assert_equal((before.acted_sequence, after.acted_sequence), (node.sequence, node.sequence))


def test_malformed_messages_have_no_effect():
    nan = float("nan")
    changed = [dict(arm=2), dict(arm=0), dict(version=2), dict(version=0), dict(kind=2), dict(kind=0), dict(mode=3),
               dict(mode=255), dict(engaged=2), dict(asks_capability=2), dict(has_gripper=2), dict(session=0),
               dict(sequence=0), dict(rate=(nan, 0, 0, 0, 0, 0)), dict(rate=(0, 0, 0, 0, 0, -100.001)),
               dict(rate=(float("inf"), 0, 0, 0, 0, 0)), dict(mode=POSE, pose=(0, 0, 0, 0, 0, 0, 1.00001)),
               dict(mode=POSE, pose=(1001, 0, 0, 0, 0, 0, 1)), dict(mode=POSE, pose=(nan, 0, 0, 0, 0, 0, 1)),
               dict(mode=POSE, pose=(0, 0, 0, 0, 0, 0, nan)), dict(mode=POSE, pose=(0.0,) * 7),
               dict(has_gripper=1, gripper_position=nan)]
    # From a well-formed Command that would end the hold, one ill-formed message each.
    spoil = [lambda good, length=length: good[:length] for length in (1, 4, 40, 187)]
    spoil += [lambda good: good + b"\0", lambda good: good + good, lambda good: good * 20]
    spoil += [lambda good: bytes(4) + good[4:], lambda good: bytes((0, 1, 0, 1)) + good[4:]]
    spoil += [lambda good: random.randbytes(random.choice((188, 196, 276, 50)))] * 20
    spoil += [lambda good: good[:4] + random.randbytes(184)] * 20
    spoil += [lambda good, change=change: replace(good, **change) for change in changed]
    with Bench() as bench:
        node = Node()
        first = bench.lead(node)
        for number, ill_formed in enumerate(spoil):
            bench.send_one(node)
            good = node.message(epoch=1, mode=RATE, rate=X_RATE, asks_capability=1)
            bench.send(ill_formed(good))
            last = bench.settle()
            assert (last.reason, last.epoch, last.echoed_session) == (NOT_ARMED, 0, node.session), f"number {number}"
            assert_equal(last.echoed_sequence, node.sequence - 1)
        assert_still(first, last)
        assert_equal(bench.capabilities, [])
        bench.send_one(node)
        bench.send(node.message(epoch=1, mode=RATE, rate=X_RATE, asks_capability=1))
        assert_equal(bench.settle().state, FOLLOWING)  # the same command, well formed
        assert bench.capabilities


def replace(message, **changes):
    """Returns the Command with other values of some fields."""
    return far.pack(far.COMMAND, **{**vars(far.unpack(far.COMMAND, message)), **changes})


def test_values_that_mode_and_flags_exclude_are_not_read():
    nan = float("nan")
    with Bench() as bench:
        node = Node()
        bench.follow(node)
        node.pose, node.epoch = (nan,) * 7, 2
        assert_equal(bench.run(node, gripper_position=nan).epoch, 2)
        node.mode, node.rate, node.pose, node.epoch = POSE, (nan,) * 6, (0.4, 0, 0.3, 0, 0, 0, 1), 3
        assert_equal(bench.run(node).epoch, 3)


def main():
    global judged, page_path
    parser = argparse.ArgumentParser(description="Judge of a far side.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="runs the tests whose name contains it")
    parser.add_argument("--frhc", metavar="FILE", help="program whose command `robot` is judged")
    parser.add_argument("--far-side", default=str(ROOT / "examples/far_side_local.py"), metavar="FILE",
                        help="Python far side that is judged without --frhc")
    parser.add_argument("--page", default=str(ROOT / "docs/link.md"))
    args = parser.parse_args()
    page_path = args.page
    judged = FrhcRobot(args.frhc) if args.frhc else PythonExample(args.far_side)

    return run_tests(globals(), args.names)


def run_tests(functions, names):
    """Runs the tests among `functions`, and prints a line for each. Returns the exit code."""
    passed = failed = left_out = 0
    for name, test in list(functions.items()):
        name = name[5:] if name.startswith("test_") else None
        if not name or names and not any(part in name for part in names):
            continue
        reason = next((reason for part, reason in judged.LEFT_OUT.items() if name.startswith(part)), None)
        if reason:
            left_out += 1
            print(f"left out  {name}: {reason}", flush=True)
            continue
        try:
            test()
            passed += 1
            print(f"pass  {name}", flush=True)
        except Exception as error:  # each test reports for itself
            failed += 1
            place = traceback.extract_tb(error.__traceback__)[-1].lineno
            print(f"FAIL  {name}: line {place}: {type(error).__name__}: {error}", flush=True)
    print(f"{type(judged).__name__}: {passed} passed, {failed} failed, {left_out} left out")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
