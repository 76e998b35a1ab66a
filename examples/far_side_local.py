#!/usr/bin/env python3
"""Far side of the link in docs/link.md over a Unix SEQPACKET socket, with a simulated robot.

    far_side_local.py SOCKET [--arm N] [--wall AXIS POSITION] [--start X Y Z]

Connects to the node that listens at SOCKET, again after each loss, and runs until SIGTERM or SIGINT.
To connect a robot, replace the class Robot and CAPABILITIES. FarSide decides which command acts and is
the same for every robot. Where the robot has a reason of its own to stop, call FarSide.hold(reason).
far_side.py is this far side over a network.

Simulation: an object without mass that moves at once, at most 0.25 m/s, within a box of {b}. It keeps the
orientation of {b}: angular rates and commanded orientations have no effect, and what is written in {MRF}
or {S} reads the same in {b}. Beyond a position on one axis a wall, a spring of 2000 N/m, pushes it back (inf: no wall).

Python 3.9 or later on Linux, standard library only. One message is one record of the socket.
"""
import argparse
import math
import secrets
import signal
import socket
import struct
import sys
import time
from types import SimpleNamespace

PERIOD_NS, HOLD_AFTER_NS, RETRY_NS = 2_000_000, 100_000_000, 100_000_000
MAX_MESSAGES = 16  # taken per period, so that a flood of messages cannot delay the robot
END_CYCLES = 5  # that send the reason "end of the process" before exit
MAX_SPEED, STIFFNESS, LOW, HIGH = 0.25, 2000.0, (-1.0, -1.0, 0.0), (1.0, 1.0, 1.0)  # m/s, N/m, m

RATE, POSE = 1, 2  # modes of a Command; 0 is hold
NO_REASON, NOT_ARMED, SILENCE, END_OF_PROCESS = 0, 1, 2, 7  # reasons in a Feedback, not all of them

# Fields of the messages, each with its struct format. Reserved bytes are "x": sent as zero and not read.
ENCAPSULATION = bytes([0, 1, 0, 0])
HEAD = dict(kind="B", version="B", arm="H", epoch="I", session="Q", sequence="Q", echoed_session="Q",
            echoed_sequence="Q")
COMMAND = HEAD | dict(mode="B", engaged="B", asks_capability="B", has_gripper="B", reserved1="4x", rate="6d",
                      pose="7d", gripper_position="d", gripper_force="d", reserved2="16x")
FEEDBACK = HEAD | dict(state="B", reason="B", valid="B", reserved1="5x", obeyed_session="Q", acted_sequence="Q",
                       wrench="6d", pose="7d", gripper_position="d", gripper_force="d", reserved2="8x")
CAPABILITY = HEAD | dict(senses="B", follows="B", payload_removal="B", reserved1="5x", accommodation="6d",
                         deadband="6d", servo_lag="d", sample_period="d", hold_after="d", sensor_range="2d",
                         stiffest_contact="d", max_speed="2d", workspace_low="3d", workspace_high="3d",
                         reserved2="16x")

# The object does not yield to force (K_FA 0), weighs nothing, does not rotate; its sensor has no limit (1e9).
CAPABILITIES = dict(senses=3, follows=3, payload_removal=0, accommodation=[0.0] * 6, deadband=[0.0] * 6,
                    servo_lag=0.0, sample_period=PERIOD_NS / 1e9, hold_after=HOLD_AFTER_NS / 1e9,
                    sensor_range=[1e9, 1e9], stiffest_contact=STIFFNESS, max_speed=[MAX_SPEED, 0.0],
                    workspace_low=LOW, workspace_high=HIGH)


def clock():
    """Time in ns. This clock is never set and, unlike CLOCK_MONOTONIC, counts the time of a suspend."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


def pack(layout, **fields):
    """Encodes a message; a field is a number or a sequence of numbers. Reserved fields need not be given."""
    message = ENCAPSULATION
    for name, form in layout.items():
        value = () if form.endswith("x") else fields[name]
        message += struct.pack("<" + form, *(value if isinstance(value, (tuple, list)) else [value]))
    return message


def unpack(layout, message):
    """Decodes a message; None if its length or its encapsulation header is wrong."""
    if len(message) != 4 + struct.calcsize("<" + "".join(layout.values())) or message[:4] != ENCAPSULATION:
        return None
    fields, offset = SimpleNamespace(), 4
    for name, form in layout.items():
        values = struct.unpack_from("<" + form, message, offset)
        setattr(fields, name, values[0] if len(values) == 1 else values)
        offset += struct.calcsize("<" + form)
    return fields


def unpack_command(message, arm):
    """Decodes a Command; None unless it is for `arm` and each value that counts is in its range."""
    c = unpack(COMMAND, message)
    valid = (c and (c.kind, c.version, c.arm) == (1, 1, arm) and c.session > 0 and c.sequence > 0
             and c.mode <= 2 and max(c.engaged, c.asks_capability, c.has_gripper) <= 1
             and (c.mode != RATE or all(abs(v) <= 100 for v in c.rate))  # false for NaN
             and (c.mode != POSE or all(abs(v) <= 1000 for v in c.pose[:3])
                  and abs(math.hypot(*c.pose[3:]) - 1) <= 1e-6)
             and (not c.has_gripper or math.isfinite(c.gripper_position) and math.isfinite(c.gripper_force)))
    return c if valid else None


class FarSide:
    """Rules of docs/link.md. Has no I/O and no clock of its own; times are in ns."""

    def __init__(self, arm):
        self.arm = arm
        self.session = 1 + secrets.randbelow(2**64 - 1)
        self.sequence = 0
        self.send_times = {}  # by sequence, of the messages that still make a fresh echo
        self.echo = (0, 0)  # session and sequence
        self.leader = 0  # current session of the node; 0: none
        self.left_sessions = set()
        self.newest_sequence = 0  # taken from the leader
        self.echo_time = 0  # send time of the message in the leader's newest fresh echo
        self.epoch = 0
        self.reason = NOT_ARMED
        self.command = None  # newest command of the leader that acted
        self.capability_due = False

    def take(self, message, now):
        """Takes a message. Read `now` after the message: a process stopped in between must find it old."""
        command = unpack_command(message, self.arm)
        if command is None or command.session in self.left_sessions:
            return
        leads = command.session == self.leader
        if not leads and self.leader and now - self.echo_time <= HOLD_AFTER_NS:
            return  # another node while the leader is fresh
        newest = self.newest_sequence if leads else self.echo[1] if command.session == self.echo[0] else 0
        if command.sequence <= newest:
            return  # overtaken or repeated
        self.echo = (command.session, command.sequence)
        if leads:
            self.newest_sequence = command.sequence

        send_time = self.send_times.get(command.echoed_sequence) if command.echoed_session == self.session else None
        if send_time is None or now - send_time > HOLD_AFTER_NS:
            return  # no fresh echo: the command may be old
        if not leads:
            if self.leader:
                self.left_sessions.add(self.leader)
            self.leader, self.newest_sequence = self.echo
            self.epoch, self.reason, self.command = command.epoch, NOT_ARMED, None
        if command.epoch < self.epoch:
            return
        if command.epoch > self.epoch:
            self.epoch, self.reason = command.epoch, NO_REASON
        self.echo_time = send_time
        self.capability_due = self.capability_due or command.asks_capability == 1
        if self.reason == NO_REASON:
            self.command = command

    def hold(self, reason):
        """Holds until a later epoch. The first reason stays, but for "not armed", which only silence leaves."""
        if self.reason == NO_REASON or self.reason == NOT_ARMED and reason != SILENCE:
            self.reason = reason

    def current_command(self, now):
        """Returns the command to follow, None to hold where the robot is."""
        if now - self.echo_time > HOLD_AFTER_NS:
            self.hold(SILENCE)
        return self.command if self.reason == NO_REASON else None

    def head(self, kind, now):
        """Head of the next message. Read `now` before the message is sent: its echo must not look younger."""
        self.sequence += 1
        self.send_times = {number: t for number, t in self.send_times.items() if now - t <= HOLD_AFTER_NS}
        self.send_times[self.sequence] = now
        return dict(kind=kind, version=1, arm=self.arm, epoch=self.epoch, session=self.session,
                    sequence=self.sequence, echoed_session=self.echo[0], echoed_sequence=self.echo[1])

    def feedback(self, now, wrench, pose):
        return pack(FEEDBACK, **self.head(2, now), state=1 if self.reason == NO_REASON else 0, reason=self.reason,
                    valid=3, obeyed_session=self.leader, acted_sequence=self.command.sequence if self.command else 0,
                    wrench=wrench, pose=pose, gripper_position=0.0, gripper_force=0.0)

    def capability(self, now):
        self.capability_due = False
        return pack(CAPABILITY, **self.head(3, now), **CAPABILITIES)


class Robot:
    """Simulated object; see the head of this file. Positions in m, in {b}."""

    def __init__(self, start, axis, wall):
        self.position, self.axis, self.wall = list(start), axis, wall

    def move(self, command):
        """Moves for one period. Without a command it holds where it is."""
        step, max_step = [0.0] * 3, MAX_SPEED * PERIOD_NS / 1e9
        if command and command.mode == RATE:
            step = [v * PERIOD_NS / 1e9 for v in command.rate[:3]]
        if command and command.mode == POSE:
            step = [target - p for target, p in zip(command.pose, self.position)]
        scale = max_step / max(max_step, math.hypot(*step))
        self.position = [min(max(p + scale * s, low), high)
                         for p, s, low, high in zip(self.position, step, LOW, HIGH)]

    def wrench(self):
        """Wrench of the wall on the object, at {S} in {S}, in N and N·m."""
        wrench = [0.0] * 6
        wrench[self.axis] = min(0.0, STIFFNESS * (self.wall - self.position[self.axis]))
        return wrench

    def pose(self):
        return [*self.position, 0.0, 0.0, 0.0, 1.0]


class Link:
    """Socket to the node; never blocks. Messages are dropped while it is full or no node listens."""

    def __init__(self, path):
        self.path, self.socket, self.retry_time, self.status = path, None, 0, None

    def connect(self, now):
        if self.socket or now < self.retry_time:
            return
        self.retry_time = now + RETRY_NS
        link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        link.setblocking(False)
        try:
            link.connect(self.path)
            self.socket, status = link, "connected"
        except OSError as error:
            link.close()
            status = f"waiting for a node: {error.strerror or error}"
        if status != self.status:
            print(f"{self.path}: {status}", file=sys.stderr)
            self.status = status

    def receive(self):
        """Returns the next message, None while no message waits."""
        self.connect(clock())
        try:
            message = self.socket.recv(4096) if self.socket else None  # longer than any message of the link
        except BlockingIOError:
            return None
        except OSError:
            message = b""
        if message == b"":  # end of file: the node closed the connection
            self.socket.close()
            self.socket = None
        return message or None

    def send(self, message):
        try:
            if self.socket:
                self.socket.send(message)
        except OSError:
            pass  # full, or closed by the node: receive() finds the end of file


class Parser(argparse.ArgumentParser):
    def error(self, message):
        self.exit(2, f"{self.prog}: {message}\n")


def arguments(parser):
    """Adds the options of arm and robot to `parser`. Returns the program's arguments."""
    parser.add_argument("--arm", type=int, default=1, help="number of the arm (default 1)")
    parser.add_argument("--wall", nargs=2, default=["x", "0.55"], metavar=("AXIS", "POSITION"),
                        help="axis x, y or z that the wall stands across, and where, in m (default x 0.55)")
    parser.add_argument("--start", type=float, nargs=3, default=[0.45, 0.0, 0.3], metavar=("X", "Y", "Z"),
                        help="first position in m (default 0.45 0 0.3)")
    args = parser.parse_args()
    if not 0 <= args.arm <= 65535:
        parser.error(f"--arm must be within 0..65535, got {args.arm}")
    try:
        args.wall = ["x", "y", "z"].index(args.wall[0]), float(args.wall[1])
    except ValueError:
        parser.error(f"--wall must be x, y or z and a number, got {' '.join(args.wall)}")
    axis, position = args.wall
    if not position >= LOW[axis]:
        parser.error(f"--wall must be at least {LOW[axis]} m, got {position}")
    if not all(low <= p <= high for low, p, high in zip(LOW, args.start, HIGH)):
        parser.error(f"--start must be within {LOW} to {HIGH} m, got {tuple(args.start)}")
    return args


def run(args, link):
    """Moves the robot by the messages of `link` until SIGTERM or SIGINT."""
    far_side, robot = FarSide(args.arm), Robot(args.start, *args.wall)
    end_signals = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _: end_signals.append(received))

    cycles_left, next_cycle = END_CYCLES, clock()
    while cycles_left > 0:
        if end_signals:
            far_side.hold(END_OF_PROCESS)
            cycles_left -= 1
        for _ in range(MAX_MESSAGES):
            message = link.receive()
            if message is None:
                break
            if not end_signals:  # a later epoch must not end the last hold
                far_side.take(message, clock())
        robot.move(far_side.current_command(clock()))
        link.send(far_side.feedback(clock(), robot.wrench(), robot.pose()))
        if far_side.capability_due:
            link.send(far_side.capability(clock()))
        next_cycle = max(next_cycle + PERIOD_NS, clock())  # skips missed cycles
        time.sleep(max(0, next_cycle - clock()) / 1e9)


def main():
    parser = Parser(description="Far side of docs/link.md with a simulated robot.", allow_abbrev=False)
    parser.add_argument("socket", help="path of the node's SEQPACKET socket")
    args = arguments(parser)
    length = len(args.socket.encode())
    if not 0 < length <= 107:
        parser.error(f"socket must be a path of 1 to 107 bytes, got {length}")
    run(args, Link(args.socket))


if __name__ == "__main__":
    main()
