#!/usr/bin/env python3
"""Judge of an end of the link over a network: a zenoh session by docs/link.md, "Over a network", with keys of openssl.

    zenoh_peers.py [--far COMMAND | --near COMMAND] [NAME ...]

Judges examples/far_side.py, which is the package of python/ with a robot, a far end that COMMAND starts, or a near end. In COMMAND {keys} is the folder of its keys,
{port} the UDP port of 127.0.0.1 that a far end listens on and a near end connects to, {arm} the number of the arm.
The far end has a robot as `frhc robot` simulates it; the near end has a node that sends Commands every 2 ms.
Signals reach every process that COMMAND starts. Runs the tests whose name contains a NAME (all without one). Exit code
0 if they pass, 1 if not. Python 3.9 or later on Linux, with eclipse-zenoh, numpy and openssl.
"""
import argparse
import collections
import contextlib
import datetime
import json
import math
import os
import re
import secrets
import shlex
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import zenoh

import far_side as contract
from far_side import (END_OF_PROCESS, FAULT, FOLLOWING, HOLDING, NOT_ARMED, PERIOD_S, SILENCE, Node, assert_equal,
                      assert_orderly, assert_still, far, now)
from frhc import network
from frhc.clock import MILLISECOND, Clock
from frhc.command import command_of
from frhc.far_end import FarEnd as Machine
from frhc.measured import checked
from frhc.messages import Command

ARM = 1
LINK_TIMEOUT_S = 10.0  # for a link to come up
OUTAGE_S = 3.0  # longer than the lease of a link
IN_FLIGHT, SLOW_S = 128, 0.02
EXAMPLES = contract.ROOT / "examples"

sys.path.append(str(EXAMPLES))
sys.dont_write_bytecode = True
import far_side_local as local  # after far_side of this folder: examples/ has a file of that name, too

keys = None  # folder of the keys, set in main()


# Keys

def openssl(*arguments):
    subprocess.run(["openssl", *map(str, arguments)], check=True, capture_output=True)


def make_authority(folder):
    folder.mkdir()
    openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", 30, "-subj",
            f"/CN=frhc-{ARM}-authority", "-keyout", folder / "authority.key", "-out", folder / "authority.pem")


def make_certificate(folder, role, name, authority, days=(-1, 30)):
    """Makes `role`.pem and `role`.key of the common name `name` in `folder`, valid between two days from today."""
    folder.mkdir(exist_ok=True)
    first, last = ((datetime.datetime.now(datetime.timezone.utc) + datetime.timedelta(day)).strftime("%Y%m%d%H%M%SZ")
                   for day in days)
    with tempfile.TemporaryDirectory() as work:
        (Path(work) / "index").touch()
        (Path(work) / "serial").write_text(f"{int.from_bytes(os.urandom(8), 'big') >> 2:016X}")
        (Path(work) / "config").write_text(
            f"[ca]\ndefault_ca=d\n[d]\ndatabase={work}/index\nserial={work}/serial\nnew_certs_dir={work}\n"
            "default_md=sha256\npolicy=p\nx509_extensions=x\n[p]\ncommonName=supplied\n"
            f"[x]\nbasicConstraints=CA:FALSE\nsubjectAltName=DNS:{name}\n")
        openssl("req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-subj", f"/CN={name}",
                "-keyout", folder / f"{role}.key", "-out", f"{work}/request")
        openssl("ca", "-batch", "-notext", "-config", f"{work}/config", "-in", f"{work}/request",
                "-cert", authority / "authority.pem", "-keyfile", authority / "authority.key",
                "-startdate", first, "-enddate", last, "-out", folder / f"{role}.pem")


WRONG_KEYS = {  # name of the certificate by role, days of validity, authority
    "of_another_arm": ("frhc-2-{}", (-1, 30), "right"),
    "of_its_own_role": ("frhc-1-{other}", (-1, 30), "right"),
    "of_no_role": ("frhc-1-", (-1, 30), "right"),
    "expired": ("frhc-1-{}", (-30, -1), "right"),
    "not_yet_valid": ("frhc-1-{}", (1, 30), "right"),
    "of_another_authority": ("frhc-1-{}", (-1, 30), "other"),
}
WITH_A_LINK = "of_another_arm", "of_its_own_role", "of_no_role"  # of the authority: the access control denies the rest


def make_keys(root):
    """Makes the right keys in `root`/right and the wrong ones in folders named as in WRONG_KEYS."""
    for folder in (root / "right", root / "other"):
        make_authority(folder)
    for role in ("near", "far", "router"):
        make_certificate(root / "right", role, f"frhc-{ARM}-{role}", root / "right")
    for folder, (name, days, authority) in WRONG_KEYS.items():
        for role, other in (("near", "far"), ("far", "near")):
            make_certificate(root / folder, role, name.format(role, other=other), root / authority, days)
        (root / folder / "authority.pem").write_bytes((root / "right/authority.pem").read_bytes())


# Ends

def open_session(folder, role, listen=None, connect=None, mode="peer", denies=False, shows_certificate=True):
    """Opens a session with the certificate of `role`. Without `denies` it takes all that the other end lets pass."""
    local_host = lambda port: port and f"127.0.0.1:{port}"
    config = network.configuration(ARM, str(folder), local_host(listen), local_host(connect))
    values = {"mode": mode, "region_name": role, "access_control": dict(enabled=False),
              "transport/link/tls/enable_mtls": shows_certificate}
    if denies:  # a near end does what a far end lets it do
        mirror = {"ingress": "egress", "egress": "ingress", f"frhc-{ARM}-near": f"frhc-{ARM}-far"}
        rules = re.sub("|".join(mirror), lambda found: mirror[found[0]], config.get_json("access_control"))
        values["access_control"] = json.loads(rules)
    if mode == "router":  # it does not forward between two peers of one region
        values["gateway"] = dict(south=[dict(filters=[dict(region_names=[name])]) for name in ("near", "far")])
    for side in ("listen", "connect"):
        values[f"transport/link/tls/{side}_certificate"] = f"{folder}/{role}.pem"
        values[f"transport/link/tls/{side}_private_key"] = f"{folder}/{role}.key"
    for key, value in values.items():
        config.insert_json5(key, json.dumps(value))
    end = now() + LINK_TIMEOUT_S
    while True:
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:  # the port of a session is free some time after its end
            if "in use" not in str(error) or now() > end:
                raise
            time.sleep(0.1)


class NearEnd:
    """Session that sends Commands, and has a queue of the far end's messages."""

    def __init__(self, folder, **endpoint):
        self.session, self.waiting = open_session(folder, "near", **endpoint), collections.deque()
        self.publisher = self.session.declare_publisher(
            f"frhc/{ARM}/command", express=True, priority=zenoh.Priority.REAL_TIME,
            congestion_control=zenoh.CongestionControl.DROP, reliability=zenoh.Reliability.BEST_EFFORT)
        self.subscribers = [
            self.session.declare_subscriber(f"frhc/{ARM}/{name}", self.take, allowed_origin=zenoh.Locality.REMOTE)
            for name in ("feedback", "capability")]
        self.token = self.session.liveliness().declare_token(f"frhc/{ARM}/alive/near")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.session.close()  # Python does not end while a session is open

    def take(self, sample):
        self.waiting.append(bytes(sample.payload))

    def read(self):
        return self.waiting.popleft() if self.waiting else None

    def send(self, message):
        self.publisher.put(message)


class FarEnd:
    """Far side by the rules, with the robot of examples/far_side_local.py, and the Commands that it received."""

    def __init__(self, folder, port):
        self.session, self.clock = open_session(folder, "far", listen=port), Clock()
        self.link = network.NetworkLink(ARM, self.session)
        self.far_side = Machine(ARM, secrets.randbits(63) + 1, 100 * MILLISECOND)
        self.robot, self.commands = local.Robot((0.45, 0.0, 0.3), 0, 0.55), []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.session.close()

    def run(self, seconds, until=None, answers=True):
        """Cycles of 2 ms; with `answers` each sends a Feedback. Returns the head of the newest Command, or None."""
        end, newest = now() + seconds, None
        while now() < end and not (until and newest and until(newest)):
            while message := self.link.receive(self.clock.now()):
                newest = Command.decode(message).head
                assert newest.arm == ARM, f"not a Command of arm {ARM}: {message.hex()}"
                self.commands.append(newest)
                self.far_side.on_message(self.clock.now(), message)
            command = command_of(self.far_side.command(self.clock.now()))
            measured, _ = checked(*self.robot.step(command, PERIOD_S), local.CAPABILITY)
            if answers:
                self.link.send(self.clock.now(), self.far_side.feedback(self.clock.now(), measured))
            time.sleep(PERIOD_S)
        return newest

    def lead(self):
        """Waits until the node leads."""
        command = self.run(LINK_TIMEOUT_S, until=lambda c: self.far_side.leader == c.own.session)
        assert command and self.far_side.leader, "the node does not lead"
        return command


class Program:
    """Process group with the program under test, or a router."""

    def __init__(self, command):
        self.output = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=self.output,
                                        stderr=self.output, start_new_session=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.signal(signal.SIGKILL)
        self.process.wait()
        self.output.close()

    def signal(self, number):
        try:
            os.killpg(self.process.pid, number)
        except ProcessLookupError:
            pass  # it has ended

    def end(self):
        """Sends SIGTERM. Returns exit code and error text."""
        self.signal(signal.SIGTERM)
        code = self.process.wait(5)
        return code, self.printed()

    def printed(self):
        """Returns what it has printed so far."""
        return os.pread(self.output.fileno(), 1 << 20, 0).decode(errors="replace")


def router(port, far_port):
    return Program([sys.executable, __file__, "router", str(keys / "right"), str(port), str(far_port)])


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Bench(contract.Bench):
    """The program under test and the near end of the link to it, if it is connected yet."""

    def __init__(self, *options, connect=True, far_listens=True):
        self.near, self.port = None, free_port()
        self.feedbacks, self.capabilities = [], []
        self.sent_after, self.arrivals, self.emptied = [], [], now()
        self.program = Program(contract.judged.command(keys / "right", self.port, options))
        self.process = self.program.process
        try:
            if connect:
                self.connect(**{"connect" if far_listens else "listen": self.port})
        except BaseException:
            self.__exit__()
            raise

    def __exit__(self, *_):
        self.program.__exit__()
        self.disconnect()

    def connect(self, **endpoint):
        """Connects with the right keys. Returns the first Feedback."""
        self.near = NearEnd(keys / "right", **endpoint or dict(connect=self.port))
        return self.wait()

    def wait(self):
        """Returns the next Feedback, and waits for the link if it is down."""
        count, end = len(self.feedbacks), now() + LINK_TIMEOUT_S
        while len(self.feedbacks) == count:
            assert now() < end, f"no link; {self.program.printed()}"
            time.sleep(0.01)
            self.receive()
        return self.feedbacks[count]

    def disconnect(self):
        if self.near:
            self.near.__exit__()
        self.near = None

    def read(self):
        return self.near.read() if self.near else None

    def send(self, message):
        if self.near:
            self.near.send(message)
        return True

    def keep_sending(self, node, seconds):
        """`node` sends a Command every 2 ms, whatever is received."""
        end = now() + seconds
        while now() < end:
            self.send(node.message())
            time.sleep(PERIOD_S)


class PythonExample(contract.PythonExample):
    """examples/far_side.py."""

    CONTACT_OPTIONS, CONTACT_RATE = ("--wall", "x", "0.46"), (0.2, 0, 0, 0, 0, 0)
    LEFT_OUT = {}

    def command(self, folder, port, options):
        where = () if "--connect" in options else ("--listen", f"127.0.0.1:{port}")
        options = [option.format(port=port) for option in options]
        return [sys.executable, self.path, str(folder), "--arm", str(ARM), *where, *options]


class PythonProgram(contract.PythonExample):
    """A program of a few lines on the package."""

    CONTACT_OPTIONS, CONTACT_RATE, LEFT_OUT = (), (), {}

    def command(self, folder, port, _options=()):
        begin = f"import frhc; far = frhc.FarSide({ARM}, keys={str(folder)!r}, listen='127.0.0.1:{port}')\n"
        return [sys.executable, "-B", "-c", begin + self.path]


class OtherProgram(contract.FrhcRobot):
    """Ends that a command starts."""

    CONTACT_OPTIONS, CONTACT_RATE = (), (0, 0, 0.4, 0, 0, 0)
    LEFT_OUT = {"far_example": "a test of options of the Python program"}

    def command(self, folder, port, _options=()):
        return shlex.split(self.path.format(keys=folder, port=port, arm=ARM))


# A far end

def test_far_contact_is_felt_and_the_way_back_is_free():
    force = lambda f: math.hypot(*f.wrench[:3])
    with Bench(*contract.judged.CONTACT_OPTIONS) as bench:
        node = Node()
        node.asks_capability = 1
        bench.follow(node, rate=contract.judged.CONTACT_RATE)
        felt = bench.run(node, seconds=3, until=lambda f: force(f) > 5)
        assert felt.state == FOLLOWING and force(felt) > 5, f"{force(felt)} N"
        node.rate = tuple(-v / 2 for v in node.rate)
        last = bench.run(node, seconds=0.5)
        assert last.state == FOLLOWING and force(last) < 1, f"{force(last)} N"
        assert bench.capabilities, "no Capability"


def test_far_silence_of_the_node_holds_until_a_later_epoch():
    with Bench() as bench:
        node = Node()
        before = bench.follow(node)
        time.sleep(0.3)
        bench.receive()
        held = bench.feedbacks[-1]
        assert_equal((held.state, held.reason), (HOLDING, SILENCE))
        after = bench.run(node, seconds=0.1)
        assert_equal((after.reason, after.session), (SILENCE, before.session))
        assert_still(held, after)
        node.epoch += 1
        assert_equal(bench.run(node, seconds=0.1).state, FOLLOWING)


def test_far_near_end_that_comes_back_finds_the_same_session():
    with Bench() as bench:
        node = Node()
        before = bench.follow(node)
        bench.disconnect()
        time.sleep(0.3)
        after = bench.connect()
        assert_equal((after.session, after.reason, after.obeyed_session), (before.session, SILENCE, node.session))
        bench.run(node)
        node.epoch += 1
        assert_equal(bench.run(node, seconds=0.1).state, FOLLOWING)


def test_far_stopped_process_acts_on_nothing_old():
    with Bench() as bench:
        node = Node()
        bench.follow(node)
        bench.program.signal(signal.SIGSTOP)
        time.sleep(0.05)
        bench.receive()
        before = bench.feedbacks[-1]
        node.echo = (before.session, before.sequence)
        bench.keep_sending(node, OUTAGE_S)
        bench.receive()
        assert_equal(bench.feedbacks[-1], before)
        bench.program.signal(signal.SIGCONT)
        first = bench.wait()
        time.sleep(0.3)
        bench.receive()
        after = bench.feedbacks[-1]
        assert_still(before, after, tolerance=contract.judged.CONTINUED_M)
        assert_still(first, after)
        assert_equal((after.session, after.reason, after.obeyed_session), (before.session, SILENCE, node.session))
        acted = after.acted_sequence - before.acted_sequence
        assert acted <= 16, f"{acted} commands acted"
        bench.run(node)
        node.epoch += 1
        assert_equal(bench.run(node, seconds=0.1).state, FOLLOWING)


def test_far_wrong_keys_pass_no_message():
    with Bench(connect=False) as bench:
        with contextlib.ExitStack() as stack:
            ends = {name: NearEnd(keys / name, connect=bench.port) for name in WRONG_KEYS}
            ends["not_shown"] = NearEnd(keys / "right", connect=bench.port, shows_certificate=False)
            nodes, linked, end = {name: Node() for name in ends}, set(), now() + 3
            for near in ends.values():
                stack.enter_context(near)
            while now() < end:
                for name, near in ends.items():
                    near.send(nodes[name].message())
                    if near.session.info.links():
                        linked.add(name)
                time.sleep(0.02)
            assert_equal({name: len(near.waiting) for name, near in ends.items()}, dict.fromkeys(ends, 0))
            assert_equal(linked, set(WITH_A_LINK))
        first = bench.connect()
        assert_equal((first.echoed_session, first.echoed_sequence, first.reason), (0, 0, NOT_ARMED))
        bench.follow(Node())


def test_far_end_of_the_process_is_reported():
    with Bench() as bench:
        bench.follow(Node())
        code, text = bench.program.end()
        time.sleep(0.1)
        bench.receive()
        assert_orderly(code, text)
        ends = [f for f in bench.feedbacks if f.reason == END_OF_PROCESS]
        assert len(ends) >= 3, f"{len(ends)} with the reason"
        assert_still(ends[0], ends[-1])


def test_far_messages_without_an_echo_are_sent_every_20_ms():
    with Bench() as bench:
        node = Node()
        bench.lead(node)
        bench.run(node, seconds=0.2)
        bench.feedbacks.clear()
        bench.run(node, seconds=1.0, fresh=False)
        count = len(bench.feedbacks)
        assert IN_FLIGHT - 20 < count < IN_FLIGHT + 1.0 / SLOW_S, f"{count} Feedbacks in 1 s"
        bench.run(node, seconds=0.1)
        bench.feedbacks.clear()
        bench.run(node, seconds=0.3)
        assert len(bench.feedbacks) > 80, f"{len(bench.feedbacks)} Feedbacks in 0.3 s with an echo"


def test_far_router_that_goes_away_and_comes_back():
    with Bench(connect=False) as bench:
        node, port = Node(), free_port()
        with router(port, bench.port):
            before = bench.connect(connect=port)
            bench.follow(node)
        bench.keep_sending(node, OUTAGE_S)  # the router is killed
        bench.receive()
        with router(port, bench.port) as second:
            try:
                after = bench.wait()
            except AssertionError as error:
                raise AssertionError(f"{error}; router: {second.process.poll()}, {second.printed()}")
            assert_equal((after.session, after.reason), (before.session, SILENCE))
            bench.run(node)
            node.epoch += 1
            assert_equal(bench.run(node, seconds=0.2).state, FOLLOWING)


def test_far_example_connects_to_a_near_end_that_listens():
    with Bench("--connect", "127.0.0.1:{port}", far_listens=False) as bench:
        bench.follow(Node())
        assert_orderly(*bench.program.end())


def test_far_example_end_and_fault_of_a_program_are_reported():
    cycles = ("for _ in far:\n  far.send([0.0] * 6, ([0.0] * 3, [0.0, 0.0, 0.0, 1.0]))\n"
              "  if far.reason == 0: ")
    programs = ((cycles + "break", 0, END_OF_PROCESS),  # the interpreter ends, nothing is closed
                ("with far:\n " + cycles.replace("\n", "\n ") + "raise ValueError", 1, FAULT))
    judged = contract.judged
    for text, code, reason in programs:
        contract.judged = PythonProgram(text)
        try:
            with Bench() as bench:
                node = Node()
                bench.lead(node)
                node.epoch += 1
                bench.send(node.message())
                bench.keep_sending(node, 0.2)
                assert_equal(bench.process.wait(5), code)
                bench.receive()
                ends = [f for f in bench.feedbacks if f.reason == reason]
                assert len(ends) >= 3 and bench.feedbacks[-1].reason == reason, f"{len(ends)} with the reason {reason}"
        finally:
            contract.judged = judged


def test_far_example_wrong_arguments_exit_2_and_files_and_ports_exit_4():
    judged, right = contract.judged, str(keys / "right")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        busy = f"127.0.0.1:{taken.getsockname()[1]}"
        for arguments, code, word in (
                ([], 2, "keys"), ([right, "more"], 2, "more"), ([right, "--arm", "70000"], 2, "--arm"),
                ([right, "--listen", "nothing"], 2, "--listen"), ([right, "--listen", "a:70000"], 2, "--listen"),
                ([right, "--listen", "a:1", "--connect", "b:1"], 2, "--connect"), (["absent"], 4, "authority.pem"),
                ([str(keys / "other")], 4, "far.pem"), ([right, "--listen", busy], 4, "in use")):
            done = subprocess.run([sys.executable, judged.path, *arguments], capture_output=True, text=True, timeout=10)
            assert_equal((done.returncode, done.stdout, done.stderr.count("\n")), (code, "", 1))
            assert word in done.stderr, done.stderr


# A near end

def near_end(port):
    return Program(contract.judged.command(keys / "right", port))


def test_near_commands_echo_and_lead():
    port = free_port()
    with FarEnd(keys / "right", port) as end, near_end(port):
        first = end.lead()
        end.commands.clear()
        end.run(0.5)
        assert len(end.commands) > 100, f"{len(end.commands)} Commands in 0.5 s"
        last = end.commands[-1]
        assert_equal((last.own.session, last.echo.session), (first.own.session, end.far_side.session))
        behind = end.far_side.sequence - last.echo.sequence
        assert behind < 20, f"the echo is {behind} messages old"


def test_near_commands_without_an_echo_are_sent_every_20_ms():
    port = free_port()
    with FarEnd(keys / "right", port) as end, near_end(port):
        end.lead()
        end.run(0.2)
        end.commands.clear()
        end.run(1.0, answers=False)
        assert len(end.commands) < IN_FLIGHT + 1.0 / SLOW_S, f"{len(end.commands)} Commands in 1 s"
        end.run(0.1)
        end.commands.clear()
        end.run(0.3)
        assert len(end.commands) > 80, f"{len(end.commands)} Commands in 0.3 s with an echo"


def test_near_stopped_process_sends_fresh_echoes_again():
    port = free_port()
    with FarEnd(keys / "right", port) as end, near_end(port) as program:
        first = end.lead()
        program.signal(signal.SIGSTOP)
        end.run(OUTAGE_S)
        sequence, end.commands = end.far_side.sequence, []
        program.signal(signal.SIGCONT)
        command = end.run(LINK_TIMEOUT_S, until=lambda c: c.echo.sequence > sequence)
        assert command and command.echo.sequence > sequence, "no fresh echo"
        assert_equal(command.own.session, first.own.session)


def test_near_wrong_keys_pass_no_message():
    for name in WRONG_KEYS:
        port = free_port()
        with near_end(port):
            with FarEnd(keys / name, port) as end:
                command = end.run(1.5)
                assert command is None, f"a Command for keys {name}"
            with FarEnd(keys / "right", port) as end:
                command = end.run(LINK_TIMEOUT_S, until=lambda _: True, answers=False)
                assert command, f"no Command after keys {name}"
                assert_equal((name, *command.echo), (name, 0, 0))


def test_near_router_that_goes_away_and_comes_back():
    port, far_port = free_port(), free_port()
    with FarEnd(keys / "right", far_port) as end, near_end(port):
        with router(port, far_port):
            first = end.lead()
        end.run(OUTAGE_S)
        sequence = end.far_side.sequence
        with router(port, far_port):
            command = end.run(LINK_TIMEOUT_S, until=lambda c: c.echo.sequence > sequence)
            assert command and command.echo.sequence > sequence, "no fresh echo"
            assert_equal(command.own.session, first.own.session)


# Processes of the judge

def run_router(folder, port, far_port):
    zenoh.init_log_from_env_or("error")
    with open_session(folder, "router", listen=port, connect=far_port, mode="router"):
        signal.pause()


def run_node(folder, port):
    """A near end to judge the tests of one: --near "PYTHON zenoh_peers.py node {keys} {port}"."""
    near, node, next_send = NearEnd(folder, connect=port, denies=True), Node(), 0
    while True:
        while message := near.read():
            feedback = message[4] == 2 and far.unpack(far.FEEDBACK, message)
            if feedback:
                node.echo = (feedback.session, feedback.sequence)
                echoed = feedback.echoed_sequence if feedback.echoed_session == node.session else 0
                node.echoed = max(getattr(node, "echoed", 0), echoed)
        if node.sequence - getattr(node, "echoed", 0) < IN_FLIGHT or now() >= next_send:
            near.send(node.message())
            next_send = now() + SLOW_S
        time.sleep(PERIOD_S)


def main():
    global keys
    if sys.argv[1:2] == ["router"]:
        return run_router(*sys.argv[2:])
    if sys.argv[1:2] == ["node"]:
        return run_node(*sys.argv[2:])
    parser = argparse.ArgumentParser(description="Judge of an end of the link over a network.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="runs the tests whose name contains it")
    end = parser.add_mutually_exclusive_group()
    end.add_argument("--far", metavar="COMMAND", help="starts a far end and its robot")
    end.add_argument("--near", metavar="COMMAND", help="starts a near end and its node")
    args = parser.parse_args()
    command = args.far or args.near
    contract.judged = OtherProgram(command) if command else PythonExample(str(EXAMPLES / "far_side.py"))
    kind = "test_near_" if args.near else "test_far_"
    tests = {name: test for name, test in globals().items() if name.startswith(kind)}
    with tempfile.TemporaryDirectory() as folder:
        keys = Path(folder)
        make_keys(keys)
        return contract.run_tests(tests, args.names)


if __name__ == "__main__":
    sys.exit(main())
