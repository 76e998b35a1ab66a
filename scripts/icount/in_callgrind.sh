#!/usr/bin/env bash
# in_callgrind.sh FOLDER: user instructions of the threads of `frhc run` in two runs, one a second longer than the other;
# on vcan in virtual time (with_vcan.sh -v), where computing takes no time, so that callgrind does not make the cycle late.
set -euo pipefail
frhc=$PWD/target/dist/frhc

# counted SECONDS: into FOLDER/run.SECONDS-THREAD
counted() {
  # With MALLOC_ARENA_MAX the node need not begin once more, which callgrind would not follow.
  export XDG_RUNTIME_DIR=$folder/$1 STATE_DIRECTORY=$folder/$1/state MALLOC_ARENA_MAX=1
  mkdir -p "$STATE_DIRECTORY"
  "$frhc" -q sim --config config/kraft_like.toml --scenario contact_10s >/dev/null &
  local drives=$! node
  valgrind --tool=callgrind --separate-threads=yes --callgrind-out-file="$folder/run.$1" \
    "$frhc" -q run --config config/kraft_like.toml >/dev/null 2>"$folder/log" &
  node=$!
  until "$frhc" ctl --wait arm >/dev/null 2>&1; do sleep 0.1; done
  sleep "$1"
  "$frhc" ctl status | sed -n "s/^cycle */$1 /p" >>"$folder/cycles"
  kill -INT $node && wait $node || true
  kill -KILL $drives && wait 2>/dev/null || true
}

folder=$1
counted 5
counted 6
