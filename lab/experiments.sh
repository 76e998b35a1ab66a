#!/usr/bin/env bash
# experiments.sh: the experiments of docs/experiments.md in full, each into a folder of its own: CSV, SVG and report.md.
#
# usage: lab/experiments.sh [FOLDER [OPTION...]]      (options of frhc-lab experiment, for instance --short or --seed 7)
#
# The folder is ./experiments by default; existing results are refused unless --force is among the options. The exit
# code is 1 when a run of an experiment was stopped; the others run all the same.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
folder=${1:-experiments}
cargo build --locked --release --quiet --manifest-path lab/Cargo.toml --target-dir target
failed=0
for experiment in fidelity return-to-centre torque-curve ntrfc delay dual-peg; do
  echo "== $experiment"
  target/release/frhc-lab experiment "$experiment" --out "$folder/$experiment" "${@:2}" || failed=1
done
exit "$failed"
