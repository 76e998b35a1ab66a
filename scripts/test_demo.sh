#!/usr/bin/env bash
# test_demo.sh: the demo of the README: 60 s of teleoperation in under 20 s of one processor, a log that can-utils reads, the
# same bytes from the same seed, and a picture as PNG.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
cargo build --locked --profile dist --features png
demo() { target/dist/frhc demo "$@"; }

# Processor time: another program on this machine must not decide it.
TIMEFORMAT=%U
{ time demo --record "$out/first" >"$out/summary" 2>"$out/errors"; } 2>"$out/took"
cat "$out/summary"
took=$(<"$out/took")
echo "demo: 60 s of teleoperation in $took s of one processor" >&2
((${took%.*} < 20)) || { echo "demo: took $took s, must take less than 20" >&2; exit 1; }

if stale=$(grep -vxFf README.md "$out/summary"); then
  echo "demo: not in the summary of README.md: $stale" >&2
  exit 1
fi

demo --quiet --record "$out/second" >/dev/null
cmp "$out/first/bus.log" "$out/second/bus.log" || { echo "demo: the same seed gave other bytes" >&2; exit 1; }
demo --quiet --seconds 5 --seed 2 --record "$out/other" >/dev/null
if cmp --silent --bytes=2000000 "$out/first/bus.log" "$out/other/bus.log"; then
  echo "demo: another seed gave the same bytes" >&2
  exit 1
fi

target/dist/frhc plot "$out/other" q -o "$out/q.png"
[[ $(head -c 4 "$out/q.png" | tail -c 3) == PNG ]] || { echo "demo: the plot is no PNG" >&2; exit 1; }

command -v log2asc >/dev/null || { echo "demo: log2asc is missing, log not compared (scripts/setup.sh tools installs it)" >&2; exit; }
lines=$(wc -l <"$out/first/bus.log")
asc=$(log2asc -I "$out/first/bus.log" vcan0 vcan1 wrench0 node0 | grep -c -E ' (Rx|Tx) ')
echo "demo: $lines lines, $asc of them converted by log2asc" >&2
((asc == lines)) || { echo "demo: log2asc lost some" >&2; exit 1; }
