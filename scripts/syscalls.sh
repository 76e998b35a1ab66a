#!/usr/bin/env bash
# syscalls.sh: counts the system calls of the cycle's thread of `frhc run` in a second of contact, with an object in the
# node's own scene, the same with 20 readers of the telemetry of which 5 are stopped, and with a robot in another process.
#
# usage: scripts/with_vcan.sh -v -t 300 -i vcan0 -- scripts/syscalls.sh
#
# Needs strace and a release build. Under strace clock readings are system calls, too.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
frhc=target/dist/frhc
work=$(mktemp -d)
trap 'kill -9 $(jobs -p) 2>/dev/null; rm -rf "$work"' EXIT

# linked: kraft_like with the robot in another process, its paths absolute.
linked() {
  sed -e "s|\"\.\./eds/|\"$PWD/eds/|; s|\"curves/|\"$PWD/config/curves/|" -e 's/^kind = "virtual"/kind = "link"/' \
    -e '/^\[remote.wall\]/,/^\[safety\]/{//!d}' \
    -e 's/^\[remote.wall\]/[remote.link]\nround_trip_ms = 5.0\nstiffest_contact_n_per_m = 2000.0\n/' config/kraft_like.toml
}

# counted KIND CONFIG: plays the contact scenario, and counts from five seconds on.
counted() {
  export XDG_RUNTIME_DIR=$work/$1 STATE_DIRECTORY=$work/$1/state
  mkdir -p "$STATE_DIRECTORY"
  "$frhc" -q sim --config "$2" --scenario contact_10s &
  [[ $1 != link ]] ||
    "$frhc" -q robot --config config/kraft_like.toml --robot config/robots/puma560.toml \
      --socket "$XDG_RUNTIME_DIR/frhc/link.sock" >/dev/null &
  "$frhc" -q run --config "$2" >/dev/null &
  local node=$! thread
  if [[ $1 == watched ]]; then
    scripts/icount/readers.py 15 "$XDG_RUNTIME_DIR/frhc-view/telemetry.sock" &
    scripts/icount/readers.py 5 "$XDG_RUNTIME_DIR/frhc-view/telemetry.sock" &
    stopped=$!
  fi
  until "$frhc" ctl --wait arm >/dev/null; do sleep 0.05; done
  [[ $1 != watched ]] || kill -STOP "$stopped"
  sleep 5
  thread=$(grep -lx frhc-cycle "/proc/$node/task/"*/comm | cut -d/ -f5)
  timeout -s INT 1 strace -qq -o "$work/trace" -p "$thread" || true
  "$frhc" ctl status | grep -E '^(mode|overruns) '
  echo "$1: $(wc -l <"$work/trace") calls in 1 s"
  cut -d'(' -f1 "$work/trace" | sort | uniq -c | sort -rn
  kill -9 $(jobs -p) && wait 2>/dev/null || true
}

counted virtual config/kraft_like.toml
counted watched config/kraft_like.toml
linked >"$work/linked.toml"
counted link "$work/linked.toml"
