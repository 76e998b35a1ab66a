#!/usr/bin/env bash
# replay_on_cpus.sh SESSION [CPU...]: replays a session on this machine's processor and on emulated ones of several models
# (with_icount.sh -c). Each must send every frame as recorded, and all of them the same bytes (cmp).
#
# Default: Nehalem has neither AVX nor FMA, Haswell has both, max is all that QEMU can emulate. The program is $FRHC_PROGRAM, or
# that of the release build. Needs scripts/setup.sh icount.
set -euo pipefail
[[ $# -gt 0 ]] || { sed -n '2,/^set/{/^set/d;s/^# \?//p}' "$0" >&2; exit 2; }
session=$(realpath "$1")
shift
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[[ $# -gt 0 ]] || set -- Nehalem Haswell max
mkdir -p target
# The emulated machine has this checkout and not all of /tmp, and knows folders by their names without symbolic links.
work=$(mktemp -d "$(realpath target)/replay-XXXXXX")
trap 'rm -rf "$work"' EXIT
cp "${FRHC_PROGRAM:-target/dist/frhc}" "$work/frhc"
cp -r "$session" "$work/session"

"$work/frhc" replay "$work/session" --verify --emit "$work/sent.log"
for cpu; do
  begun=$SECONDS
  # The file system of the emulated machine is this one's, read only: the frames sent on this processor are compared there.
  scripts/with_icount.sh -t 900 -c "$cpu" -- bash -c '
    grep -m 1 -o "model name.*" /proc/cpuinfo
    echo "flags of interest: $(grep -m 1 ^flags /proc/cpuinfo | grep -ow "sse4_2\|avx\|avx2\|fma\|avx512f" | paste -sd " ")"
    "$0/frhc" replay "$0/session" --verify --emit /tmp/sent.log && cmp /tmp/sent.log "$0/sent.log"' "$work"
  echo "$cpu: $(wc -l <"$work/sent.log") frames byte for byte as on this processor, in $((SECONDS - begun)) s"
done
