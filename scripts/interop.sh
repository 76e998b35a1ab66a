#!/usr/bin/env bash
# interop.sh [--bus|--no-bus|--timed] [NAME...]: frhc with third-party programs, on real vcan in virtual time.
#
# python-canopen simulates six drives for `frhc run`, and is the master of the drives of `frhc sim`; other nodes send
# frames that are not CANopen. Then Wireshark's dissector and cantools read the candump logs, pinocchio computes the
# robot arms, and rosbags reads and writes the messages of the link; a node in Python judges two
# far sides, that of examples/ and `frhc robot`; PyPI's NetFT judges the force/torque sensor that `frhc robot` reads; another one, with
# keys by openssl, judges the far side over a network. The package of python/ leads a robot for `frhc run`, is compared with the
# contract in Rust, and is installed. The MuJoCo arm of python/examples is felt through `frhc run`, and its gymnasium environment checked.
# mcap and rosbags read exported sessions. tmux shows what `frhc top` draws. python-can with cantools is timed beside
# `frhc decode`, and a headless browser is tried on a page of known faults, and shows the pages of `frhc report` and
# `frhc view`. Runs all tests, or those whose names contain one of the NAMEs; with --bus
# only those on the bus and in its logs, with --no-bus only the others but those whose result is a time, with --timed these,
# which need the machine for themselves.
#
# Installs missing tools by scripts/setup.sh. Needs $VCAN_KERNEL, as scripts/test.sh sets it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
part=
case ${1:-} in --bus | --no-bus | --timed) part=$1; shift ;; esac
scripts/setup.sh tools browser
python=$PWD/target/interop/venv/bin/python

cargo build --locked --profile dist --features png
# The contract in Rust, with which the package of python/ is compared: profile and features are those of the tests.
cargo build --workspace --features png --locked --example contract_ends
export FRHC=$PWD/target/dist/frhc CONTRACT_ENDS=$PWD/target/debug/examples/contract_ends
export INTEROP_LOGS=$PWD/target/interop/logs PYTHONDONTWRITEBYTECODE=1
if [[ -z $part || $part == --bus ]]; then
  rm -rf "$INTEROP_LOGS" && mkdir -p "$INTEROP_LOGS"
  scripts/with_vcan.sh -v -t 600 -i vcan0 -- "$python" tests/interop/on_the_bus.py "$@"
  # In virtual time a busy machine is not late.
  for judged in "" "--frhc=$FRHC"; do
    scripts/with_vcan.sh -v -t 600 -i vcan0 -- "$python" tests/interop/far_side.py ${judged:+"$judged"} "$@"
  done
  scripts/with_vcan.sh -v -t 600 -i vcan0 -- "$python" tests/interop/force_sensor.py "$@"
  scripts/with_vcan.sh -v -t 600 -i vcan0 -- "$python" tests/interop/zenoh_peers.py "$@"
  scripts/with_vcan.sh -v -t 600 -i vcan0 -- "$python" tests/interop/mujoco_felt.py "$@"
  "$python" tests/interop/in_the_logs.py "$@"
fi
if [[ -z $part || $part == --no-bus ]]; then "$python" tests/interop/without_a_bus.py "$@"; fi
if [[ -z $part || $part == --timed ]]; then "$python" tests/interop/without_a_bus.py --timed "$@"; fi
