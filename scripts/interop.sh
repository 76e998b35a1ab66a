#!/usr/bin/env bash
# interop.sh [NAME...]: frhc on real vcan with programs that nobody here wrote, in virtual time.
#
# python-canopen is six drives for `frhc run`, and master of the drives of `frhc sim`; strangers send
# what is no CANopen. Then Wireshark's dissector and cantools read what candump saw of it. All the tests,
# or those whose names contain one of the NAMEs.
#
# Installs what is missing of python3-venv, tshark and can-utils and says so; Python's packages, pinned
# in tests/interop/requirements.txt, go into target/interop. Needs $VCAN_KERNEL, as scripts/test.sh has it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
as_root() { if [[ $EUID -eq 0 ]]; then "$@"; else sudo -n "$@"; fi; }

missing=()
python3 -c 'import ensurepip, venv' 2>/dev/null || missing+=(python3 python3-venv)
command -v tshark >/dev/null || missing+=(tshark)
command -v candump >/dev/null || missing+=(can-utils)
if ((${#missing[@]})); then
  echo "interop: installing ${missing[*]}" >&2
  as_root apt-get update -q >/dev/null
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}" >/dev/null
fi

here=$PWD/target/interop
python=$here/venv/bin/python
if ! cmp -s tests/interop/requirements.txt "$here/installed.txt"; then
  echo "interop: installing $(grep -v '^#' tests/interop/requirements.txt | paste -sd ' ') into target/interop/venv" >&2
  rm -rf "$here/venv" && mkdir -p "$here"
  python3 -m venv "$here/venv"
  "$here/venv/bin/pip" install --quiet --disable-pip-version-check -r tests/interop/requirements.txt
  cp tests/interop/requirements.txt "$here/installed.txt"
fi

cargo build --locked --release
export FRHC=$PWD/target/release/frhc INTEROP_LOGS=$here/logs PYTHONDONTWRITEBYTECODE=1
rm -rf "$INTEROP_LOGS" && mkdir -p "$INTEROP_LOGS"
scripts/with_vcan.sh -v -t 600 -i vcan0 -- "$python" tests/interop/on_the_bus.py "$@"
"$python" tests/interop/in_the_logs.py "$@"
