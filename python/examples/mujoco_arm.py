#!/usr/bin/env python3
"""Far side of docs/link.md: the MuJoCo arm of mujoco_world.py, followed through the package frhc.

    mujoco_arm.py [--socket PATH] [--arm N]

Connects to the node that listens at PATH (without it the socket of `frhc run`), and runs until SIGTERM or SIGINT.
mujoco_arm.toml beside it is a configuration of the node; felt.py starts both. docs/mujoco.md has the rest.
"""
import argparse
import logging
import signal
import sys

import frhc

import resolved_rate
from mujoco_world import ACCOMMODATION, SENSOR_RANGE, SERVO_LAG, STIFFNESS, World

CAPABILITY = frhc.Capability(
    payload_removal=frhc.PayloadRemoval.WEIGHT,
    accommodation=ACCOMMODATION,
    servo_lag=SERVO_LAG,
    sample_period=0.002,
    sensor_range=SENSOR_RANGE,
    stiffest_contact=STIFFNESS,
    max_speed=resolved_rate.MAX_SPEED,
    workspace_low=resolved_rate.WORKSPACE[0],
    workspace_high=resolved_rate.WORKSPACE[1],
)


def main():
    parser = argparse.ArgumentParser(description="Far side with a MuJoCo arm.", allow_abbrev=False)
    parser.add_argument("--socket", help="socket of the node (default: that of frhc run)")
    parser.add_argument("--arm", type=int, default=1, help="number of the arm (default 1)")
    args = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    # Without it SIGTERM ends Python at once, and the arm would be silent where it can say that it ends.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    world = World()
    with frhc.FarSide(args.arm, socket=args.socket, capability=CAPABILITY) as far:
        for command in far:
            far.send(*world.step(command, far.period))


if __name__ == "__main__":
    main()
