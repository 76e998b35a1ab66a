#!/usr/bin/env bash
# pictures.sh: makes the pictures of the running program in README.md and docs, from a headless browser at `frhc demo --view`.
#
# usage: scripts/pictures.sh [FOLDER]     (default: docs/img)
#
# Needs a build (target/dist/frhc, or the program in $FRHC) and scripts/setup.sh tools browser. Each picture is at most 200 kB.
# A picture is taken at a cycle of the scenario, as far as the browser keeps up; so two runs differ by some hundredths of a second.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export FRHC=${FRHC:-$PWD/target/dist/frhc}
[[ -x $FRHC ]] || { echo "pictures: $FRHC: no program; cargo build --profile dist" >&2; exit 69; }
exec target/interop/venv/bin/python tests/interop/pictures.py "${1:-docs/img}"
