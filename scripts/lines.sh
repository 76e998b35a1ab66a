#!/usr/bin/env bash
# lines.sh: lines of code by room: no blank lines, no comments, nothing that is compiled only for tests.
#
# usage: scripts/lines.sh [--json | --check | --functions]
#
#   --check      fails where a function of the rack is too long
#   --functions  prints the functions that are too long
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec python3 -B scripts/lines.py "$@"
