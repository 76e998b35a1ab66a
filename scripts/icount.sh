#!/usr/bin/env bash
# icount.sh: instructions per cycle of `frhc run`, by thread, and per simulated millisecond of `frhc demo`, compared with
# benches/baseline.json.
#
# usage: scripts/icount.sh [--write] [--optional]
#
# Counts three times, each time the difference of two moments or lengths, so that start-up does not count:
#   kernel and user   of all threads of `run`, on the emulated machine of with_icount.sh: grouped RPDOs at 1 kHz, the same with
#                     --record, with 20 readers of the telemetry of which 5 are stopped, one RPDO per drive at 500 Hz; samples come
#                     frame by frame, as on a wire, and in two cases in batches; and how often the cycle's thread wakes up
#   user              of the threads of the first of these, by callgrind on vcan in virtual time
#   simulation        of `demo`, by callgrind
#
# Fails if a figure is more than 3 % above the baseline, or the cycle's thread has 1 % more with readers than without. Where rustc, kernel, QEMU, valgrind or C library differ from
# the baseline's, it prints the figures and does not fail. --write replaces the baseline: its commit says why it changes.
# Without the tools it says what is missing and exits with 69, or 0 with --optional.
#
# Needs a release build, scripts/setup.sh icount, and a kernel with vcan and virtual time ($VCAN_KERNEL, as with_vcan.sh).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
write="" optional=""
for word in "$@"; do
  case $word in
    --write) write=--write ;;
    --optional) optional=1 ;;
    *) sed -n '2,/^set/{/^set/d;s/^# \?//p}' "$0" >&2; exit 2 ;;
  esac
done

. scripts/needs.sh
missing=()
[[ -x target/dist/frhc ]] || missing+=("target/dist/frhc (cargo build --profile dist)")
needs icount "$optional" "icount kernel" "${missing[@]}"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

echo "icount: kernel and user" >&2
in_machine() { scripts/with_icount.sh -t 900 -- scripts/icount/in_machine.sh "$@" >>"$work/machine"; }
in_machine grouped 70 config/kraft_like.toml
in_machine grouped_in_batches 80 config/kraft_like.toml
in_machine recorded 70 config/kraft_like.toml --record /dev/shm/sessions
in_machine watched 70 config/kraft_like.toml
in_machine per_drive 70 config/kraft_like_500hz.toml
in_machine per_drive_in_batches 80 config/kraft_like_500hz.toml
echo "icount: user" >&2
scripts/with_vcan.sh -v -t 300 -i vcan0 -- scripts/icount/in_callgrind.sh "$work"
echo "icount: simulation" >&2
for seconds in 6 8; do
  valgrind --tool=callgrind --callgrind-out-file="$work/demo.$seconds" \
    target/dist/frhc -q demo --seed 7 --seconds "$seconds" >/dev/null 2>&1
done
scripts/icount/figures.py $write "$work"
