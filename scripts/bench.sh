#!/usr/bin/env bash
# bench.sh: what one step of the controller costs, in time and instructions, and what pinocchio takes for
# forward kinematics, Jacobian and gravity of the same arm.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

cargo bench --locked --bench cycle

if command -v valgrind >/dev/null; then
  bench=$(cargo bench --locked --bench cycle --no-run --message-format=json 2>/dev/null |
    sed -n 's/.*"executable":"\([^"]*\/cycle-[0-9a-f]*\)".*/\1/p' | tail -n 1)
  count() { # instructions of a run of $1 steps
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$bench" --steps "$1" 2>&1 |
      sed -n 's/.*Collected : \([0-9]*\).*/\1/p'
  }
  many=$(count 14000)
  few=$(count 4000)
  echo "Controller::step, everything on: $(((many - few) / 10000)) instructions"
else
  echo "no valgrind here: instructions not counted" >&2
fi

venv=target/bench-venv
if python3 -m venv "$venv" 2>/dev/null && "$venv/bin/pip" install -q pin numpy 2>/dev/null; then
  "$venv/bin/python" scripts/bench_pinocchio.py
else
  echo "no pinocchio here (pip install pin): not compared" >&2
fi
