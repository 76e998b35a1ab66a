#!/usr/bin/env bash
# report_picture.sh: draws docs/img/report.png, the first screen of a report, with headless Chromium and its driver (scripts/setup.sh browser).
#
# usage: scripts/report_picture.sh      (FRHC: the program, else target/dist/frhc)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
frhc=${FRHC:-target/dist/frhc}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# Exit code 6: stopped, as the scenario wants it.
"$frhc" -q demo --scenario faults/unplug --seconds 4 --record "$folder/elbow-unplugged" >"$folder/log" 2>&1 || [[ $? == 6 ]]
"$frhc" report "$folder/elbow-unplugged" >>"$folder/log"
PYTHONPATH=tests/interop PYTHONDONTWRITEBYTECODE=1 python3 - "$folder/elbow-unplugged/report.html" <<'END'
import sys
from pathlib import Path

from browser import Browser

with Browser() as browser:
    browser.open(sys.argv[1], width=1000, height=1560)
    Path("docs/img/report.png").write_bytes(browser.screenshot())
END
