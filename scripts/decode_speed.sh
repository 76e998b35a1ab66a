#!/usr/bin/env bash
# decode_speed.sh: lines a second of `frhc decode`, as text and as JSON, and of python-can with cantools on the same log.
#
# usage: scripts/decode_speed.sh [SECONDS]      (length of the recorded demo; default: 60)
#
# The DBC is that of `frhc export dbc`. Installs Python's packages by scripts/setup.sh.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
scripts/setup.sh tools
cargo build --locked --profile dist --features png --quiet
FRHC=target/dist/frhc target/interop/venv/bin/python -B tests/interop/decode_speed.py "${1:-60}"
