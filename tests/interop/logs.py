"""Logs of the tests on the bus, except those with remote frames or frames that are not CANopen."""

import functools
import json
import os
import re
import subprocess
import tempfile
from pathlib import Path

import any_master
import hostile
import our_tools
from bench import CONFIG, FRHC, ROOT, check, same

LOGS = Path(os.environ.get("INTEROP_LOGS", "target/interop/logs"))
DATA_FRAME = re.compile(r"\((\d+\.\d+)\) \S+ ([0-9A-F]{3})#([0-9A-F]*)(?: .)?$")


class Logs:
    """Context of a test."""

    def __init__(self, _name):
        pass

    def __enter__(self):
        self.temporary = tempfile.TemporaryDirectory(prefix="frhc-interop-")
        self.folder = Path(self.temporary.name)
        strange = [*hostile.TESTS, *any_master.STRANGE, *our_tools.STRANGE]
        strange = {test.__name__ for test in strange}
        self.files = sorted(file for file in LOGS.glob("*.log") if file.stem not in strange)
        # The dissector is stateless and decodes the segments of a block as requests.
        self.without_blocks = [file for file in self.files if "block" not in file.stem]
        check(self.files, f"no log in {LOGS}: the tests on the bus leave them")
        return self

    def __exit__(self, *_):
        self.temporary.cleanup()


def frames(file):
    """Time, identifier and data of each frame of a log."""
    found = [DATA_FRAME.match(line) for line in file.read_text().splitlines()]
    check(all(found), f"{file.name}: every line is a data frame")
    return [(float(hit[1]), int(hit[2], 16), bytes.fromhex(hit[3])) for hit in found]


@functools.cache
def decoded(file):
    """Output of `frhc decode --json` for a log: one object per line."""
    command = [FRHC, "decode", "--config", CONFIG, "--json", file]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    same(done.returncode, 0, f"frhc decode: {done.stderr}")
    return [json.loads(line) for line in done.stdout.splitlines()]
