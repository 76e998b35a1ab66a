"""The tests that need neither bus nor logs: other programs compute what ours prints."""

import contextlib
import sys

import contact
import decode_speed
import exports
import link
import pages
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

TESTS = [*robots.TESTS, *contact.TESTS, *link.TESTS, *sessions.TESTS, *exports.TESTS, *decode_speed.TESTS, *pages.TESTS, *report.TESTS, *view.TESTS,
         *view_judges.TESTS, *view_access.TESTS, *view_hostile.TESTS, *view_live.TESTS, *top.TESTS]

if __name__ == "__main__":
    sys.exit(runner.run(TESTS, contextlib.nullcontext, sys.argv[1:]))
