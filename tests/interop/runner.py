"""Runs all tests, or those whose names contain one of the arguments, and prints a line for each.

A failed test prints its reason and, for tests on the bus, the last frames.
"""

import sys
import time
import traceback


def passes(test, surroundings):
    """Runs one test in its surroundings; returns whether it passed."""
    start = time.monotonic()
    try:
        with surroundings(test.__name__) as given:
            test(given)
    except Exception as error:
        reason = (str(error).splitlines() or [""])[0]
        print(f"FAIL interop: {test.__name__}: {type(error).__name__}: {reason}", flush=True)
        traceback.print_exc(file=sys.stdout)
        print("\n".join(getattr(error, "frames", [])), flush=True)
        return False
    print(f"ok interop: {test.__name__} ({time.monotonic() - start:.1f} s)", flush=True)
    return True


def run(tests, surroundings, wanted):
    """Runs the tests; returns the exit code, 0 if all passed."""
    failed = 0
    for test in tests:
        name = test.__name__
        if wanted and not any(part in name for part in wanted):
            continue
        if not passes(test, surroundings):
            failed += 1
    return 1 if failed else 0
