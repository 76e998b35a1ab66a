#!/usr/bin/env bash
# mutants.sh: mutation test: applies faults to the sources, and reports which the unit tests and the tests on the
# in-memory bus detect.
#
# usage: scripts/mutants.sh [--count N] [--seed N] [--only TEXT] [--edits FILE] [--list] [--limit SECONDS]
#        scripts/mutants.sh --replay
#
# --replay has `frhc replay` find the ten mutants of the control law in scripts/mutants_of_the_law.json, in one session.
# 120 mutants take an hour or two. Not in CI. Builds below target/mutants, which may be deleted at any time.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec python3 -B scripts/mutants.py "$@"
