#!/usr/bin/env python3
"""Judge of the reader of a Net F/T sensor, in `frhc robot` and in python/frhc/net_ft.py, with the sensor of rdt_server.py.

    force_sensor.py [NAME ...]

PyPI's NetFT, which shares no code with either, judges that sensor first. A record says which one it is, so that its age is counted
in records: the newest one sent at that time, less the one that acted. Needs FRHC, and time that is virtual (scripts/with_vcan.sh -v).
"""
import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import NetFT
import runner

import far_side as contract
from rdt_server import BIAS, REALTIME, STOP, RdtServer, counts_of

ROOT = contract.ROOT
sys.path.insert(0, str(ROOT / "python"))

from frhc.net_ft import NetFT as FrhcNetFT  # noqa: E402

RATE, CYCLE_S = 7000, 0.001
WANDERING_RATE = 7001  # its records meet every phase of a cycle in a second
SENSOR_INVALID, SENSOR_SATURATED, SENSOR_SILENT = 3, 4, 5
FOLLOWS = 0
COUNTS_PER_UNIT = 1e6
SECTION = ["[remote.link.sensor]", 'address = "127.0.0.1"', "counts_per_n = 1e6", "counts_per_nm = 1e6"]


class Robot:
    """`frhc robot` with a cycle of 1 ms, and the node's end of its socket."""

    def __init__(self, *options):
        self.directory = tempfile.TemporaryDirectory()
        folder = Path(self.directory.name)
        text = (ROOT / "config/kraft_like.toml").read_text().replace('"../eds/', f'"{ROOT}/eds/')
        assert "mass_kg = 0.8 " in text
        text = text.replace("mass_kg = 0.8 ", "mass_kg = 0.0 ")
        (folder / "robot.toml").write_text("\n".join([text, *SECTION, ""]))
        self.log = folder / "log"
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        listener.bind(str(folder / "far.sock"))
        listener.listen(1)
        listener.settimeout(30)
        command = [os.environ["FRHC"], "robot", "--config", str(folder / "robot.toml"), "--robot",
                   str(ROOT / "config/robots/puma560.toml"), "--socket", str(folder / "far.sock"), "--json", *options]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self.log.open("w"), text=True)
        self.connection = listener.accept()[0]
        listener.close()
        self.node = contract.Node()
        self.commanded_at = 0.0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()
        self.connection.close()
        self.directory.cleanup()

    def feedback(self):
        """Waits for the next Feedback; sends a Command every 2 ms."""
        while True:
            assert select.select([self.connection], [], [], 5)[0], f"no Feedback: {self.log.read_text()}"
            message = self.connection.recv(4096)
            if time.monotonic() - self.commanded_at >= contract.PERIOD_S:
                self.commanded_at = time.monotonic()
                self.connection.send(self.node.message())
            if message[4] == 2:
                feedback = contract.far.unpack(contract.far.FEEDBACK, message)
                self.node.echo = (feedback.session, feedback.sequence)
                return feedback

    def run(self, seconds, until=lambda feedback: False):
        """Returns the feedbacks of that time, or until one meets the condition."""
        end, feedbacks = time.monotonic() + seconds, []
        while time.monotonic() < end and not (feedbacks and until(feedbacks[-1])):
            feedbacks.append(self.feedback())
        return feedbacks

    def follow(self):
        """Has the robot follow in a new epoch, slowly and away from its wall."""
        self.node.move((0.0, 0.0, -0.001, 0.0, 0.0, 0.0))
        self.node.epoch += 1
        last = self.run(2, lambda feedback: feedback.reason == FOLLOWS and feedback.epoch == self.node.epoch)[-1]
        assert last.reason == FOLLOWS, f"reason {last.reason}: {self.log.read_text()}"

    def status(self):
        self.process.send_signal(signal.SIGUSR1)
        return json.loads(self.process.stdout.readline())


def used(wrench):
    """Returns the RDT sequence of the record that a wrench is made of."""
    return round(wrench[0] * COUNTS_PER_UNIT)


def print_ages(who, ages):
    ages = sorted(ages)
    p50, p99 = (ages[int(len(ages) * share)] for share in (0.5, 0.99))
    print(f"   {who}: age p50 {p50}, p99 {p99}, at most {ages[-1]} records in {len(ages)} cycles", flush=True)


def test_netft_of_pypi_reads_the_sensor(_):
    with RdtServer() as server:
        theirs = NetFT.Sensor("127.0.0.1")
        theirs.getMeasurement()
        assert theirs.measurement() == list(counts_of(1)), theirs.measurement()
        theirs.getMeasurements(5)
        assert [theirs.receive()[0] for _ in range(5)] == [1, 2, 3, 4, 5]
        mean = theirs.tare(4)
        assert mean[0] == 2.5 and theirs.getMeasurement()[2:] == [0.0] * 4, mean
        theirs.zero()
        begun = time.monotonic()
        theirs.startStreaming(False)
        received = [theirs.receive() for _ in range(RATE)]
        assert [one[0] for one in received] == list(range(1, RATE + 1))
        assert abs(time.monotonic() - begun - 1) < 0.01, "7,000 records a second"
        assert received[-1] == list(counts_of(RATE))
        theirs.stopStreaming()
        time.sleep(0.1)
        assert server.requests[-2:] == [(REALTIME, 0), (STOP, 0)], server.requests


def test_reader_of_one_record_a_cycle_is_late(_):
    """What drivers in the field do: the figures of the others mean something."""
    with RdtServer() as server:
        theirs = NetFT.Sensor("127.0.0.1")
        theirs.startStreaming(False)
        ages = []
        for _ in range(5_000):
            ages.append(server.sent - theirs.receive()[0])
            time.sleep(CYCLE_S)
        theirs.sock.close()
    print_ages("one record a cycle", ages[1_000:])
    print(f"   {1e3 * ages[-1] / RATE:.0f} ms behind, goodput {100 / (RATE * CYCLE_S):.0f} %", flush=True)
    assert ages[-1] > 0.1 * RATE, ages[-1]


def test_robot_uses_a_record_of_at_most_one_sample(_):
    with RdtServer(rate=WANDERING_RATE) as server, Robot() as robot:
        robot.run(0.3)
        begun, ages = server.record_count, []
        for _ in range(10_000):
            feedback = robot.feedback()
            assert feedback.valid & 1, f"no wrench: {robot.status()}"
            ages.append(server.sent - used(feedback.wrench))
        assert ages and feedback.wrench[1] == -feedback.wrench[0] and feedback.wrench[2:] == (0.1, 0.0025, -0.005, 0.0075)
        status, sent = robot.status()["sensor"], server.record_count
        print_ages("frhc robot", ages)
        print(f"   {sent} records sent, {status['records']} received, {status['lost']} lost", flush=True)
        assert 0 <= min(ages) and max(ages) <= 1, max(ages)
        assert sent - begun > 9.9 * RATE and sent - status["records"] <= 20 and status["requests"] == 1, status
        assert all(status[name] == 0 for name in ("lost", "overtaken", "frozen", "waited", "invalid", "foreign")), status


def test_python_reader_uses_a_record_of_at_most_one_sample(_):
    with RdtServer(rate=WANDERING_RATE) as server, FrhcNetFT("127.0.0.1", COUNTS_PER_UNIT, COUNTS_PER_UNIT) as sensor:
        for _ in range(100):
            time.sleep(CYCLE_S)
            sensor.read()
        ages = []
        for _ in range(10_000):
            time.sleep(CYCLE_S)
            wrench = sensor.read()
            assert wrench is not None, sensor.counts
            ages.append(server.sent - used(wrench))
        print_ages("python/frhc/net_ft.py", ages)
        counts = sensor.counts
        assert 0 <= min(ages) and max(ages) <= 1, max(ages)
        assert counts["lost"] == counts["overtaken"] == counts["foreign"] == 0 and counts["requests"] == 1, counts


@contextlib.contextmanager
def following():
    """A robot that follows, with its sensor."""
    with RdtServer() as server, Robot() as robot:
        robot.run(0.3)
        robot.follow()
        yield server, robot


def holds(robot, reason, within_s=0.01):
    """Asserts that the robot holds for the reason in time, and sends no wrench then."""
    begun = time.monotonic()
    last = robot.run(within_s, lambda feedback: feedback.reason != FOLLOWS)[-1]
    assert last.reason == reason, f"reason {last.reason} after {time.monotonic() - begun} s: {robot.log.read_text()}"
    assert not last.valid & 1, "a wrench that is not valid"


def goes_on(robot):
    """Asserts that the robot still holds, though the sensor is well again, until a new epoch."""
    assert robot.run(0.3)[-1].reason != FOLLOWS
    robot.follow()
    assert robot.run(0.1)[-1].reason == FOLLOWS


def test_status_other_than_zero_holds_the_robot(_):
    with following() as (server, robot):
        server.status = 0x80010000
        holds(robot, SENSOR_INVALID)
        robot.run(0.2)
        assert "status 80010000h: its readings are invalid" in robot.log.read_text()
        assert robot.status()["sensor"]["condition"] == "status 80010000h"
        server.status = 0
        goes_on(robot)


def test_sensor_that_falls_silent_holds_the_robot(_):
    with following() as (server, robot):
        server.is_silent = True
        holds(robot, SENSOR_SILENT)
        robot.run(0.3)
        assert "127.0.0.1:49152: no new record" in robot.log.read_text()
        server.is_silent = False
        goes_on(robot)


def test_sensor_that_is_started_again_is_found(_):
    with following() as (server, robot):
        for _ in range(3):
            server.restart()
            holds(robot, SENSOR_SILENT)
            goes_on(robot)
            assert robot.status()["sensor"]["overtaken"] == 0
        assert server.requests.count((REALTIME, 0)) == 4, server.requests


def test_records_of_another_port_hold_the_robot(_):
    with following() as (server, robot):
        server.is_foreign = True
        holds(robot, SENSOR_SILENT)
        robot.run(1.5)
        assert "drops datagrams from 127.0.0.1:" in robot.log.read_text(), robot.log.read_text()
        assert robot.status()["sensor"]["foreign"] > 7_000
        server.is_foreign = False
        goes_on(robot)


def test_wrench_beyond_the_range_holds_the_robot(_):
    with following() as (server, robot):
        server.zero = (int(-200 * COUNTS_PER_UNIT), 0, 0, 0, 0, 0)
        holds(robot, SENSOR_SATURATED)
        server.zero = (0,) * 6
        goes_on(robot)


def test_lost_and_repeated_records_disturb_nothing(_):
    with following() as (server, robot):
        server.gap_every, server.is_repeating = 50, True
        feedbacks = robot.run(3)
        assert all(feedback.reason == FOLLOWS for feedback in feedbacks)
        ages = [server.sent - used(feedback.wrench) for feedback in feedbacks[-1:]]
        status = robot.status()["sensor"]
        assert ages[0] <= 2 and status["lost"] > 300 and status["overtaken"] > 15_000, (ages, status)


def test_gap_before_every_record_holds_the_robot(_):
    with following() as (server, robot):
        server.gap_every = 2
        holds(robot, SENSOR_SILENT)
        server.gap_every = 0
        goes_on(robot)


def test_records_kept_back_by_the_network_hold_the_robot(_):
    with following() as (server, robot):
        server.burst(350)
        holds(robot, SENSOR_SILENT, within_s=0.06)
        goes_on(robot)


def test_continued_robot_uses_no_record_that_waited(_):
    with following() as (server, robot):
        robot.process.send_signal(signal.SIGSTOP)
        time.sleep(3)
        while select.select([robot.connection], [], [], 0)[0]:
            robot.connection.recv(4096)
        robot.process.send_signal(signal.SIGCONT)
        ages, missing = [], 0
        for _ in range(500):
            feedback = robot.feedback()
            if feedback.valid & 1:
                ages.append(server.sent - used(feedback.wrench))
            else:
                missing += 1
        status = robot.status()["sensor"]
        print_ages("frhc robot, continued after 3 s", ages)
        assert max(ages) <= 1 and missing and status["waited"] > 100, (max(ages), missing, status)


def test_robot_without_a_sensor_holds_and_finds_it_later(_):
    with Robot() as robot:
        feedbacks = robot.run(1)
        assert feedbacks[-1].reason == SENSOR_SILENT and not any(one.valid & 1 for one in feedbacks)
        assert "127.0.0.1:49152: no new record" in robot.log.read_text()
        with RdtServer():
            robot.run(0.3)
            robot.follow()
            assert robot.run(0.1)[-1].valid & 1


def test_bias_is_sent_on_command_alone(_):
    with following() as (server, robot):
        server.restart()
        robot.run(1)
        assert BIAS not in [command for command, _ in server.requests]
    with RdtServer() as server, Robot("--bias") as robot:
        feedback = robot.run(1)[-1]
        assert [command for command, _ in server.requests] == [REALTIME, BIAS, REALTIME], server.requests
        age = server.sent - server.zero[0] - used(feedback.wrench)
        assert 0 <= age <= 1 and server.zero[0] > 0 and feedback.wrench[2:] == (0.0,) * 4, (age, feedback.wrench)


def test_end_of_the_robot_stops_the_sensor(_):
    with following() as (server, robot):
        robot.process.send_signal(signal.SIGTERM)
        robot.process.wait(10)
        time.sleep(0.1)
        sent = server.record_count
        time.sleep(0.1)
        assert server.requests[-1] == (STOP, 0) and server.record_count == sent


TESTS = [
    test_netft_of_pypi_reads_the_sensor,
    test_reader_of_one_record_a_cycle_is_late,
    test_robot_uses_a_record_of_at_most_one_sample,
    test_python_reader_uses_a_record_of_at_most_one_sample,
    test_status_other_than_zero_holds_the_robot,
    test_sensor_that_falls_silent_holds_the_robot,
    test_sensor_that_is_started_again_is_found,
    test_records_of_another_port_hold_the_robot,
    test_wrench_beyond_the_range_holds_the_robot,
    test_lost_and_repeated_records_disturb_nothing,
    test_gap_before_every_record_holds_the_robot,
    test_records_kept_back_by_the_network_hold_the_robot,
    test_continued_robot_uses_no_record_that_waited,
    test_robot_without_a_sensor_holds_and_finds_it_later,
    test_bias_is_sent_on_command_alone,
    test_end_of_the_robot_stops_the_sensor,
]


if __name__ == "__main__":
    sys.exit(runner.run(TESTS, lambda _: contextlib.nullcontext(), sys.argv[1:]))
