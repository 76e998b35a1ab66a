"""Plays python/examples/felt.py on vcan0, and judges what was felt of the MuJoCo arm by the session that the node recorded.

    mujoco_felt.py [--seconds S] [NAME...]

Needs vcan0 and time that is virtual (scripts/with_vcan.sh -v). One round of 20 s, or as many as fit into S; docs/mujoco.md has
ten minutes.
"""

import argparse
import contextlib
import sys
import tempfile
from pathlib import Path

import package  # noqa: F401  (frhc of python/, also for the arm's process)
import runner
from bench import FRHC, INTERFACE, ROOT, check, same

sys.path.insert(0, str(ROOT / "python/examples"))

import felt  # noqa: E402
import felt_session  # noqa: E402
from mujoco_world import STIFFNESS  # noqa: E402

WRENCH_GAIN = 0.3
"""K_T of mujoco_arm.toml: with K_P of 1 the hand is shown this share of the stiffness."""
ONE_ROUND = felt.BEFORE + felt.ROUND + felt.AFTER


def mujoco_arm_is_felt_through_the_node(seconds):
    felt.FRHC, rounds = FRHC, felt.rounds_in(seconds)
    with tempfile.TemporaryDirectory(prefix="frhc-interop-") as folder:
        session = felt.play(Path(folder), f"{folder}/sessions", seconds, INTERFACE)
        found = felt_session.read(FRHC, session)
    print(found.text(), flush=True)
    same(found.trips, [], "trips")
    check(found.engaged_s > rounds * felt.ROUND, f"engaged for {found.engaged_s} s of {seconds} s")
    same(found.wall_contacts, rounds, "contacts with the wall")
    same(found.insertions, rounds, "insertions of the peg")
    check(found.depth > 0.02, f"inserted by {found.depth} m")
    check(2.0 < found.felt_at_wall < 10.0, f"{found.felt_at_wall} N at the hand, at the wall")
    check(0.5 < found.felt_in_hole < 10.0, f"{found.felt_in_hole} N at the hand, in the hole")
    displayed = found.displayed_stiffness / (WRENCH_GAIN * STIFFNESS)
    check(0.95 < displayed < 1.05, f"{found.displayed_stiffness} N/m at the hand")
    check(found.across < 0.2, f"{found.across} N across the push: the loop shakes")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=ONE_ROUND)
    parser.add_argument("names", nargs="*")
    args = parser.parse_args()
    surroundings = lambda _: contextlib.nullcontext(args.seconds)
    return runner.run([mujoco_arm_is_felt_through_the_node], surroundings, args.names)


if __name__ == "__main__":
    sys.exit(main())
