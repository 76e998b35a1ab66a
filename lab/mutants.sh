#!/usr/bin/env bash
# mutants.sh: mutation test: applies faults to the sources, and reports which the unit tests and the tests on the
# in-memory bus detect.
#
# usage: lab/mutants.sh [--count N] [--seed N] [--only TEXT] [--edits FILE] [--list] [--limit SECONDS]
#        lab/mutants.sh --replay
#
# --replay has `frhc replay` find the ten mutants of the control law in lab/mutants_of_the_law.json, in one session.
# 120 mutants take an hour or two. Not in CI. Builds below target/mutants, which may be deleted at any time.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec python3 -B lab/mutants.py "$@"
