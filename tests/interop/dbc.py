"""cantools reads the logs by the DBC that `frhc export dbc` writes, and gets what `frhc decode` gets."""

import functools
import math
import subprocess

import cantools

from bench import CONFIG, FRHC, JOINTS, ROOT, check, same
from logs import decoded, frames


@functools.cache
def database():
    """The exported DBC, as cantools reads it without a complaint."""
    command = [FRHC, "export", "dbc", "--config", CONFIG]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
    same(done.returncode, 0, f"frhc export dbc: {done.stderr}")
    return cantools.database.load_string(done.stdout, "dbc", strict=True)


def cantools_knows_every_pdo(logs):
    known = {message.frame_id for message in database().messages}
    for joint in JOINTS:
        for cob_id in (0x180 + joint["node_id"], 0x200 + joint["node_id"]):
            check(cob_id in known, f"{cob_id:03X} is not in the DBC")


def cantools_reads_every_signal_as_frhc_decode_does(logs):
    compared = 0
    for file in logs.files:
        for (_, cob_id, data), ours in zip(frames(file), decoded(file), strict=True):
            signals = ours.get("signals")
            if signals is None:
                continue
            where = f"{file.name}:{ours['line']}"
            message = database().get_message_by_frame_id(cob_id)
            if len(data) != message.length:
                continue
            for name, value in message.decode(data, decode_choices=False).items():
                check(name in signals, f"{where}: {name} is not among {list(signals)}")
                close = math.isclose(signals[name], value, rel_tol=1e-9, abs_tol=1e-12)
                check(close, f"{where}: {name} = {signals[name]}, by cantools {value}")
                compared += 1
    check(compared > 10_000, f"only {compared} values compared")


TESTS = [
    cantools_knows_every_pdo,
    cantools_reads_every_signal_as_frhc_decode_does,
]
