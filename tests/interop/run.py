"""Runs the interoperability tests: all of them, or those whose names contain one of the arguments.

Prints one line for each test. What fails tells why, with the last lines candump saw.
"""

import logging
import sys
import time
import traceback

import hostile
import our_drives
import our_master
from bench import Bench

# What waits for something this program cannot do yet: the test's name and what it waits for.
PENDING = {
    "drive_reads_and_writes_in_blocks": "block transfer in the drives",
}

TESTS = [*our_master.TESTS, *our_drives.TESTS, *hostile.TESTS]


def passes(test):
    """Runs one test; whether it passed."""
    began = time.monotonic()
    try:
        with Bench() as bench:
            test(bench)
    except Exception as error:
        print(f"FAIL interop: {test.__name__}", flush=True)
        traceback.print_exc(file=sys.stdout)
        print("\n".join(getattr(error, "frames", [])), flush=True)
        return False
    print(f"ok interop: {test.__name__} ({time.monotonic() - began:.1f} s)", flush=True)
    return True


def main(wanted):
    logging.disable(logging.CRITICAL)
    failed = 0
    for test in TESTS:
        name = test.__name__
        if wanted and not any(part in name for part in wanted):
            continue
        if name in PENDING:
            print(f"skip interop: {name} (waits for {PENDING[name]})", flush=True)
        elif not passes(test):
            failed += 1
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
