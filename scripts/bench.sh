#!/usr/bin/env bash
# bench.sh: cost of one step of the controller in time and instructions, of the commanded side's part of a cycle, and of a
# millisecond of the simulation. lab/bench_pinocchio.py times the same arm in pinocchio.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

cargo bench --locked --bench cycle
cargo bench --locked --bench world
cargo bench --locked --bench commanded_side

if command -v valgrind >/dev/null; then
  executable() { # of benchmark $1
    cargo bench --locked --bench "$1" --no-run --message-format=json 2>/dev/null |
      sed -n 's/.*"executable":"\([^"]*\/'"$1"'-[0-9a-f]*\)".*/\1/p' | tail -n 1
  }
  count() { # instructions of a run of "$@"
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$@" 2>&1 |
      sed -n 's/.*Collected : \([0-9]*\).*/\1/p'
  }
  count_of() { # instructions in function "$1" in a run of the rest
    valgrind --tool=callgrind --callgrind-out-file=/dev/null --collect-atstart=no "--toggle-collect=*$1*" "${@:2}" 2>&1 |
      sed -n 's/.*Collected : \([0-9]*\).*/\1/p'
  }
  each() { # instructions of one of $3 that "$1 $2" plays
    many=$(count "$1" "$2" $((4000 + $3)))
    few=$(count "$1" "$2" 4000)
    echo $(((many - few) / $3))
  }
  cycle=$(executable cycle)
  echo "Controller::step, everything on: $(each "$cycle" --steps 10000) instructions"
  side=$(executable commanded_side)
  for kind in virtual arm link; do
    many=$(count_of cycle_part "$side" $kind --steps 3000)
    few=$(count_of cycle_part "$side" $kind --steps 2000)
    echo "the commanded side's part of a cycle, $kind: $(((many - few) / 1000)) instructions"
  done
  world=$(executable world)
  echo "dynamics, hand holding, a millisecond of it: $(each "$world" --dynamics 2000) instructions"
  echo "the whole world, a millisecond of it: $(each "$world" --cycles 2000) instructions"
else
  echo "valgrind is missing: instructions not counted" >&2
fi
