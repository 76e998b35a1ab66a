#!/usr/bin/env bash
# test.sh: tests of the experiments.
#
# usage: lab/test.sh [--smoke]
#
# Before a release: every test, those that are left out elsewhere as they take minutes included; then Table I in full, computed
# again by dual_peg_table.py, and the peg against MuJoCo's, where scripts/setup.sh has installed numpy and MuJoCo. With --smoke, as scripts/test.sh calls it: builds the
# lab, and runs each experiment in its short form.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
case $* in
  "" | --smoke) ;;
  *) echo "usage: lab/test.sh [--smoke]" >&2; exit 2 ;;
esac

# tests FILTER...: the tests whose names contain one of these, or all.
tests() {
  cargo test --locked --manifest-path lab/Cargo.toml --target-dir target -- "$@"
}

if [[ $* == --smoke ]]; then
  tests _passes refused dual_peg figures settings tests
  exit
fi
tests --include-ignored
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cargo run --locked --release --manifest-path lab/Cargo.toml --target-dir target -- experiment dual-peg --out "$work/dual-peg"
python=target/interop/venv/bin/python
if [[ -x $python ]]; then
  "$python" -B lab/dual_peg_table.py "$work/dual-peg"
  OMP_NUM_THREADS=1 PYTHONPATH=tests/interop "$python" -B lab/mujoco_peg.py
else
  echo "lab: Table I is not computed again, nor the peg by MuJoCo: scripts/setup.sh tools installs them" >&2
fi
