"""The tests on what candump saw of the tests on the bus: Wireshark's CANopen dissector and cantools read it.

Needs no bus; on_the_bus.py has left a log of each of its tests in $INTEROP_LOGS.
"""

import sys

import dbc
import runner
import wireshark
from logs import Logs

TESTS = [*wireshark.TESTS, *dbc.TESTS]

if __name__ == "__main__":
    sys.exit(runner.run(TESTS, Logs, sys.argv[1:]))
