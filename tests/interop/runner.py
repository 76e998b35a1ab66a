"""Runs tests, all of them or those whose names contain one of the arguments, and prints a line for each.

What fails tells why; a test on the bus shows the last lines candump saw, too.
"""

import sys
import time
import traceback

# What waits for something this program cannot do yet: the test's name and what it waits for.
PENDING = {
    "drive_reads_and_writes_in_blocks": "block transfer in the drives",
    "drive_keeps_a_large_value_in_blocks": "block transfer in the drives",
    "scan_finds_pythons_nodes": "frhc scan",
    "sdo_reads_and_writes_pythons_objects": "frhc sdo",
    "sdo_writes_a_large_value_that_python_takes_in_segments": "frhc sdo, and block transfer",
    "nmt_moves_pythons_nodes": "frhc nmt",
    "drive_is_given_its_node_id_by_pythons_lss_master": "LSS in the simulated drives",
    "wireshark_agrees_with_frhc_decode": "frhc decode",
    "cantools_knows_every_pdo": "frhc export dbc",
    "cantools_reads_every_signal_as_frhc_decode_does": "frhc export dbc",
    "cantools_reads_the_lines_of_the_recorder": "frhc export dbc",
}


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
        if name in PENDING:
            print(f"skip interop: {name} (waits for {PENDING[name]})", flush=True)
        elif not passes(test, surroundings):
            failed += 1
    return 1 if failed else 0
