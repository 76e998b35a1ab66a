"""The tests on the bus: python-canopen as drives, as master, and frames of unknown stations. Needs vcan0, and time
that is virtual (scripts/with_vcan.sh -v). Leaves what candump saw of each test in $INTEROP_LOGS."""

import logging
import sys

import any_master
import cia402
import faults
import hostile
import lely
import our_drives
import our_master
import our_tools
import python_far_side
import runner
from bench import Bench

MODULES = [our_master, our_drives, any_master, cia402, faults, lely, our_tools, hostile, python_far_side]
TESTS = [test for module in MODULES for test in module.TESTS]

if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    sys.exit(runner.run(TESTS, Bench, sys.argv[1:]))
