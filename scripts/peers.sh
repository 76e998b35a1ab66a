#!/usr/bin/env bash
# peers.sh: what a cycle costs and how late its torques are, for `frhc run` and for other masters of the same exchange.
#
# usage: scripts/peers.sh [--optional]
#
# All of them drive the same simulated drives, one after the other in one boot of the emulated machine (with_icount.sh), with
# SCHED_FIFO 80 above the drives' 70. A recorded run beside candump proves that they exchange the same frames, and shows the times;
# a run alone is timed. `frhc run` is as shipped, all threads and watches on. docs/performance.md says what the others do not do.
#
#   C loop           scripts/peers/loop.c
#   python-canopen   scripts/peers/python_canopen.py, where scripts/setup.sh tools has installed it
#   lely             not measured: no program for it is here
#
# Without a tool it says what is missing and exits with 69, or 0 with --optional.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
case $* in
  "") optional="" ;;
  --optional) optional=1 ;;
  *) sed -n '2,/^set/{/^set/d;s/^# \?//p}' "$0" >&2; exit 2 ;;
esac
. scripts/needs.sh
missing=()
[[ -x target/release/frhc ]] || missing+=("target/release/frhc (cargo build --release)")
command -v gcc >/dev/null || missing+=(gcc)
command -v candump >/dev/null || missing+=(can-utils)
needs peers "$optional" icount "${missing[@]}"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p target/peers
gcc -O2 -Wall -Wextra -o target/peers/loop scripts/peers/loop.c
measured() { # LAYOUT PERIOD_US CONFIG
  echo "peers: $1, $2 µs" >&2
  scripts/with_icount.sh -t 400 -- scripts/peers/in_machine.sh "$@" >"$work/$1"
  printf '\n%s, %s µs (%s)\n\n' "$1" "$2" "$3"
  scripts/peers/figures.py "$2" "$work/$1"
}
measured grouped 1000 config/kraft_like.toml
measured per-drive 2000 config/kraft_like_500hz.toml
