#!/usr/bin/env bash
# mujoco_arm.sh [OPTION...]: a MuJoCo arm that is felt, on vcan0: simulated drives and hand, `frhc run`, and the arm of
# python/examples. Prints contacts, peak wrenches and the stiffness that the hand is shown. Options are those of
# python/examples/felt.py: --seconds S (default 45), --session FOLDER.
#
# Runs from a fresh clone: builds frhc unless $FRHC names it, and makes target/mujoco/venv with the package frhc and its extra
# `mujoco` from PyPI (240 MB) unless $PYTHON names an interpreter that has them. Time is virtual where scripts/setup.sh
# has built its kernel; else it is real, vcan0 needs root or sudo, and the machine must keep a cycle of 2 ms.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if [[ -z ${FRHC:-} ]]; then
  cargo build --locked --profile dist --features png
  FRHC=$PWD/target/dist/frhc
fi
if [[ -z ${PYTHON:-} ]]; then
  venv=$PWD/target/mujoco/venv
  PYTHON=$venv/bin/python
  if [[ ! -e $venv/installed || -n $(find python/frhc python/pyproject.toml -newer "$venv/installed" -print -quit) ]]; then
    python3 -m venv "$venv"
    "$PYTHON" -m pip install --quiet --disable-pip-version-check --force-reinstall --no-deps ./python
    "$PYTHON" -m pip install --quiet --disable-pip-version-check "./python[mujoco]"
    touch "$venv/installed"
  fi
fi
export FRHC PYTHONDONTWRITEBYTECODE=1
kernel=${VCAN_KERNEL:-${VCAN_UML_HOME:-${XDG_CACHE_HOME:-$HOME/.cache}/vcan-uml}/linux-timetravel}
virtual=
[[ ! -x $kernel ]] || virtual=-v
# shellcheck disable=SC2086 # no word where time is real
scripts/with_vcan.sh $virtual -i vcan0 -- "$PYTHON" python/examples/felt.py "$@"
