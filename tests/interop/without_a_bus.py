"""The tests that need neither bus nor logs: other programs compute what ours prints."""

import contextlib
import sys

import contact
import link
import robots
import runner
import sessions

TESTS = [*robots.TESTS, *contact.TESTS, *link.TESTS, *sessions.TESTS]

if __name__ == "__main__":
    sys.exit(runner.run(TESTS, contextlib.nullcontext, sys.argv[1:]))
