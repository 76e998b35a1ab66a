#!/usr/bin/env python3
"""Far side of the link in docs/link.md over a Unix SEQPACKET socket, with a simulated robot.

    far_side_local.py SOCKET [--arm N] [--wall AXIS POSITION] [--start X Y Z]

Connects to the node that listens at SOCKET, again after each loss, and runs until SIGTERM or SIGINT. Needs the package
frhc (pip install ./python), which decides which command acts. To connect a robot, replace the class Robot and CAPABILITY.
far_side.py is this far side over a network.

Its gripper goes to each commanded opening at 0.1 m/s, 0.08 m at most, with nothing between its fingers.

Simulation: an object without mass that moves at once, at most 0.25 m/s, within a box of {b}. It keeps the
orientation of {b}: angular rates and commanded orientations have no effect, and what is written in {MRF}
or {S} reads the same in {b}. Beyond a position on one axis a wall, a spring of 2000 N/m, pushes it back (inf: no wall).
"""
import argparse
import logging
import math
import signal

import frhc

MAX_SPEED, STIFFNESS, LOW, HIGH = 0.25, 2000.0, (-1.0, -1.0, 0.0), (1.0, 1.0, 1.0)  # m/s, N/m, m

# The object does not yield to force (K_FA 0), weighs nothing, does not rotate; its sensor has no limit.
MAX_OPENING, GRIPPER_SPEED = 0.08, 0.1  # m, m/s
CAPABILITY = frhc.Capability(has_gripper=True, sample_period=0.002, hold_after=0.1, stiffest_contact=STIFFNESS,
                             max_speed=(MAX_SPEED, 0.0), workspace_low=LOW, workspace_high=HIGH)


class Robot:
    """Simulated object; see the head of this file. Positions in m, in {b}."""

    def __init__(self, start, axis, wall):
        self.position, self.axis, self.wall = list(start), axis, wall
        self.opening = self.opening_d = MAX_OPENING

    def step(self, command, period):
        """Moves for one period, in s; without a motion it holds where it is. Returns wrench, pose and gripper."""
        way, max_way = [0.0] * 3, MAX_SPEED * period
        if command.motion is frhc.Motion.RATE:
            way = [v * period for v in command.rate[:3]]
        if command.motion is frhc.Motion.POSE:
            way = [target - p for target, p in zip(command.pose[0], self.position)]
        scale = max_way / max(max_way, math.hypot(*way))
        self.position = [min(max(p + scale * s, low), high) for p, s, low, high in zip(self.position, way, LOW, HIGH)]
        return self.wrench(), (self.position, (0.0, 0.0, 0.0, 1.0)), self.grip(command, period)

    def grip(self, command, period):
        """Moves the gripper for one period; without a command it goes on to the last opening. Returns opening and force."""
        if command.gripper is not None:
            self.opening_d = min(max(command.gripper[0], 0.0), MAX_OPENING)
        way = GRIPPER_SPEED * period
        self.opening = min(max(self.opening_d, self.opening - way), self.opening + way)
        return self.opening, 0.0

    def wrench(self):
        """Returns the wrench of the wall on the object, at {S} in {S}, in N and N·m."""
        wrench = [0.0] * 6
        wrench[self.axis] = min(0.0, STIFFNESS * (self.wall - self.position[self.axis]))
        return wrench


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


def run(args, far):
    """Moves the robot by the commands of `far` until SIGTERM or SIGINT."""
    robot, end_signals = Robot(args.start, *args.wall), []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _: end_signals.append(received))
    with far:
        for command in far:
            far.send(*robot.step(command, far.period))
            if end_signals:
                break  # the far side holds, and says why


def main():
    parser = Parser(description="Far side of docs/link.md with a simulated robot.", allow_abbrev=False)
    parser.add_argument("socket", help="path of the node's SEQPACKET socket")
    args = arguments(parser)
    logging.basicConfig(format="%(message)s", level=logging.INFO)
    try:
        far = frhc.FarSide(args.arm, socket=args.socket, capability=CAPABILITY)
    except ValueError as error:
        parser.error(str(error))
    run(args, far)


if __name__ == "__main__":
    main()
