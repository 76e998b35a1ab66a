#!/usr/bin/env bash
# soak.sh: ten million cycles in virtual time without a trip, with 1 % of the link's packets and 0.1 % of the
# drives' samples lost, and each drive's torque behind a low pass of 10 ms and 5 % off, on all ten shipped
# configurations in turn. A monitor checks the invariants of the bus.
#
# usage: scripts/soak.sh [CYCLES [SEED [OPTION...]]]      (options of frhc campaign)
#
# 10,000,000 cycles take some minutes on two cores; CI runs 1,000,000. The exit code is 1 after a trip or a violated
# invariant; each such lap is listed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
cycles=${1:-10000000}
seed=${2:-1}
cargo build --locked --profile dist --features png --quiet
exec target/dist/frhc campaign --seed "$seed" --soak "$cycles" "${@:3}"
