"""The tests on the bus: python-canopen as drives, as master, and strangers' frames. Needs vcan0, and time
that is virtual (scripts/with_vcan.sh -v). Leaves what candump saw of each test in $INTEROP_LOGS."""

import logging
import sys

import any_master
import cia402
import hostile
import lely
import our_drives
import our_master
import our_tools
import runner
from bench import Bench

TESTS = [*our_master.TESTS, *our_drives.TESTS, *any_master.TESTS, *cia402.TESTS, *lely.TESTS, *our_tools.TESTS, *hostile.TESTS]

if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    sys.exit(runner.run(TESTS, Bench, sys.argv[1:]))
