"""The logs of the tests on the bus, but for those on which somebody sent what is no CANopen, or remote frames."""

import functools
import json
import os
import re
import subprocess
import tempfile
from pathlib import Path

import any_master
import hostile
from bench import CONFIG, FRHC, ROOT, check, same

LOGS = Path(os.environ.get("INTEROP_LOGS", "target/interop/logs"))
DATA_FRAME = re.compile(r"\((\d+\.\d+)\) \S+ ([0-9A-F]{3})#([0-9A-F]*)(?: .)?$")


class Logs:
    """What a test gets."""

    def __init__(self, _name):
        pass

    def __enter__(self):
        self.temporary = tempfile.TemporaryDirectory(prefix="frhc-interop-")
        self.folder = Path(self.temporary.name)
        strange = {test.__name__ for test in [*hostile.TESTS, *any_master.STRANGE]}
        self.files = sorted(file for file in LOGS.glob("*.log") if file.stem not in strange)
        # The dissector has no memory: it takes the segments of a block for requests of their own.
        self.without_blocks = [file for file in self.files if "block" not in file.stem]
        check(self.files, f"no log in {LOGS}: the tests on the bus leave them")
        return self

    def __exit__(self, *_):
        self.temporary.cleanup()


def frames(file):
    """When each frame of a log came, its identifier and its data."""
    found = [DATA_FRAME.match(line) for line in file.read_text().splitlines()]
    check(all(found), f"{file.name}: every line is a data frame")
    return [(float(hit[1]), int(hit[2], 16), bytes.fromhex(hit[3])) for hit in found]


@functools.cache
def decoded(file):
    """A log as `frhc decode --json` reads it: one object for each line."""
    command = [FRHC, "decode", "--config", CONFIG, "--json", file]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    same(done.returncode, 0, f"frhc decode: {done.stderr}")
    return [json.loads(line) for line in done.stdout.splitlines()]
