#!/usr/bin/env bash
# test.sh: every test, those on real vcan included, on a fresh machine (Debian, a Rust toolchain).
#
# Installs what is missing of can-utils and iproute2 and says so, as scripts/interop.sh does with what it
# needs: python3-venv, tshark, and Python's packages. The tests on vcan run in virtual time, in a User-Mode
# Linux kernel: $VCAN_KERNEL, or the one in ~/.cache/vcan-uml, which is built there when it is missing
# (about 8 minutes, once).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
as_root() { if [[ $EUID -eq 0 ]]; then "$@"; else sudo -n "$@"; fi; }

missing=()
command -v candump >/dev/null || missing+=(can-utils)
[[ -x /usr/sbin/ip || -x /sbin/ip ]] || command -v ip >/dev/null || missing+=(iproute2)
if ((${#missing[@]})); then
  echo "test: installing ${missing[*]}" >&2
  as_root apt-get update -q >/dev/null
  as_root apt-get install -y -q "${missing[@]}" >/dev/null
fi

home=${VCAN_UML_HOME:-${XDG_CACHE_HOME:-$HOME/.cache}/vcan-uml}
export VCAN_KERNEL=${VCAN_KERNEL:-$home/linux-timetravel}
if [[ ! -x $VCAN_KERNEL ]]; then
  echo "test: no kernel with virtual time at $VCAN_KERNEL; building one (about 8 minutes, once)" >&2
  as_root apt-get update -q >/dev/null
  scripts/build_timetravel_kernel.sh "$VCAN_KERNEL"
fi

echo "test: the library and everything on the in-memory bus" >&2
cargo test --locked --release

echo "test: the demo" >&2
scripts/test_demo.sh

cargo build --locked --release

echo "test: two thousand faults on the in-memory bus, and a million cycles without a false stop" >&2
target/release/frhc -q campaign --seed 1 --faults 2000
scripts/soak.sh 1000000

# on_vcan CPU NAME: the tests of that target, in virtual time, on one CPU of this machine.
on_vcan() {
  local tests
  tests=$(cargo test --locked --release --test "$2" --no-run --message-format=json 2>/dev/null |
    sed -n 's/.*"executable":"\([^"]*\/'"$2"'-[0-9a-f]*\)".*/\1/p' | tail -n 1)
  [[ -x $tests ]] || { echo "test: the tests $2 did not build" >&2; return 1; }
  VCAN_UML_CPU=$1 scripts/with_vcan.sh -v -t 600 -i "vcan0 vcan1" -- "$tests" --test-threads=1 --show-output
}
cargo test --locked --release --no-run --test vcan --test vcan_faults
echo "test: two processes on real vcan, and the same faults there, side by side in virtual time" >&2
faults=$(mktemp)
trap 'rm -f "$faults"' EXIT
on_vcan $(($(nproc) - 1)) vcan_faults >"$faults" 2>&1 &
job=$!
status=0
on_vcan 0 vcan || status=$?
wait "$job" || status=$?
cat "$faults"
((status == 0)) || exit "$status"

echo "test: other people's programs on real vcan" >&2
scripts/interop.sh
