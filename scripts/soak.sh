#!/usr/bin/env bash
# soak.sh: ten million cycles in virtual time in which nothing may trip, with 1 % of the link's words and
# 0.1 % of the drives' samples lost, and the invariants of the bus watched all the while.
#
# usage: scripts/soak.sh [CYCLES [SEED [OPTION...]]]      (options of frhc campaign)
#
# 10,000,000 cycles are some minutes on two cores. CI takes 1,000,000. The exit code is 1 if anything
# tripped or an invariant was broken; each such lap is named.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
cycles=${1:-10000000}
seed=${2:-1}
cargo build --locked --release --quiet
exec target/release/frhc campaign --seed "$seed" --soak "$cycles" "${@:3}"
