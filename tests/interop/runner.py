"""Runs tests, all of them or those whose names contain one of the arguments, and prints a line for each.

What fails tells why; a test on the bus shows the last lines candump saw, too.
"""

import sys
import time
import traceback


def passes(test, surroundings):
    """Runs one test in its surroundings; whether it passed."""
    began = time.monotonic()
    try:
        with surroundings(test.__name__) as given:
            test(given)
    except Exception as error:
        print(f"FAIL interop: {test.__name__}", flush=True)
        traceback.print_exc(file=sys.stdout)
        print("\n".join(getattr(error, "frames", [])), flush=True)
        return False
    print(f"ok interop: {test.__name__} ({time.monotonic() - began:.1f} s)", flush=True)
    return True


def run(tests, surroundings, wanted):
    """The exit code: 0 if all passed."""
    failed = 0
    for test in tests:
        name = test.__name__
        if wanted and not any(part in name for part in wanted):
            continue
        if not passes(test, surroundings):
            failed += 1
    return 1 if failed else 0
