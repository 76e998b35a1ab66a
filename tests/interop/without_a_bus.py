"""The tests that need neither bus nor logs: other programs compute what ours prints.

usage: without_a_bus.py [--timed] [NAME...]

With --timed those alone whose result is a time: they need the machine for themselves, and are left out otherwise.
"""

import contextlib
import sys

import contract_ends
import decode_speed
import exports
import link
import mujoco_judge
import pages
import python_package
import report
import robots
import runner
import sessions
import top
import view
import view_access
import view_hostile
import view_judges
import view_live

TESTS = [*robots.TESTS, *mujoco_judge.TESTS, *link.TESTS, *contract_ends.TESTS, *python_package.TESTS,
         *sessions.TESTS, *exports.TESTS, *pages.TESTS, *report.TESTS, *view.TESTS,
         *view_judges.TESTS, *view_access.TESTS, *view_hostile.TESTS, *view_live.TESTS, *top.TESTS]

TIMED = [*decode_speed.TIMED, *view.TIMED, *view_live.TIMED]

if __name__ == "__main__":
    words = sys.argv[1:]
    is_timed = words[:1] == ["--timed"]
    sys.exit(runner.run(TIMED if is_timed else TESTS, contextlib.nullcontext, words[is_timed:]))
