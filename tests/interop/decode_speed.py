"""Lines a second of `frhc decode`, and of python-can with cantools on the same log by the DBC that `frhc export dbc` writes.

All in processor time, which another program does not lengthen, and without the start: that of Python and of reading the DBC, or
that of `frhc` and of reading its configuration. Python decodes into dictionaries, once without writing anything,
and once with a line of JSON for each frame; `frhc decode` writes every line in either form.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import can
import cantools

import machine

FRHC = os.environ.get("FRHC", "target/dist/frhc")
CONFIG = "config/kraft_like.toml"
WANTED = 10
"""How many times as fast ours is to be."""


def recorded(folder, seconds):
    """Records a demo; returns its log and the number of its lines."""
    session = Path(folder) / "session"
    command = [FRHC, "-q", "demo", "--config", CONFIG, "--seconds", str(seconds), "--out", str(session)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    log = session / "bus.log"
    return log, log.read_bytes().count(b"\n")


def decoding(log, *options):
    """Returns the time of `frhc decode`, from the start of the process to its end, in s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([FRHC, "decode", "--config", CONFIG, *options, str(log)], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def ours(log, start, *options):
    """Returns the shortest time of `frhc decode` for a log, without that for its first line alone, in s."""
    # The first may find the log on the disk, and other programs share caches and cores.
    return min(decoding(log, *options) for _ in range(4)) - min(decoding(start, *options) for _ in range(4))


def pythons(log, to=None):
    """Returns the time of python-can with cantools, without that of Python's start and of reading the DBC, in s."""
    exported = subprocess.run([FRHC, "export", "dbc", "--config", CONFIG], check=True, capture_output=True, text=True)
    database = cantools.database.load_string(exported.stdout, "dbc")
    messages = {message.frame_id: message for message in database.messages}
    begin, decoded, number = time.process_time(), 0, 0
    for number, frame in enumerate(can.LogReader(log), 1):
        message = messages.get(frame.arbitration_id)
        # SYNC and SDO have no signals; a frame of another length is no mistake of the reader.
        if message is not None and message.length == len(frame.data):
            signals = message.decode(frame.data)
            decoded += 1
            if to is not None:
                line = {
                    "line": number, "t": frame.timestamp, "interface": frame.channel, "id": f"{frame.arbitration_id:03X}",
                    "data": frame.data.hex(), "name": message.name, "signals": signals,
                }
                to.write(json.dumps(line, default=str) + "\n")
    taken = time.process_time() - begin
    assert decoded > 0.8 * number, f"{decoded} of {number} lines of the log have signals"
    return taken


def measured(seconds):
    """Returns the lines of a log, and the time of each reader, in s."""
    with tempfile.TemporaryDirectory() as folder:
        log, lines = recorded(folder, seconds)
        start = Path(folder) / "start.log"
        start.write_bytes(log.read_bytes().partition(b"\n")[0] + b"\n")
        text, as_json = (ours(log, start, *options) for options in ([], ["--json"]))
        with open(os.devnull, "w") as nowhere:
            decoded, written = (min(pythons(log, to) for _ in range(2)) for to in (None, nowhere))
        return lines, {"text": text, "json": as_json, "decoded": decoded, "written": written}


def decode_is_ten_times_as_fast_as_python_can_with_cantools(_):
    with machine.Others() as others:
        lines, times = measured(40)
    assert lines > 350_000, lines
    # Text, although Python writes nothing; JSON, where it writes JSON. Other programs share caches and cores.
    machine.judge(WANTED * times["text"] <= times["decoded"], times, others)
    machine.judge(WANTED * times["json"] <= times["written"], times, others)


TIMED = [machine.tried(decode_is_ten_times_as_fast_as_python_can_with_cantools)]

if __name__ == "__main__":
    count, found = measured(float(sys.argv[1]))
    print(f"{count} lines, in processor time")
    python = f"python-can {can.__version__}, cantools {cantools.__version__}"
    rows = [
        ("frhc decode", "text"), ("frhc decode --json", "json"), (python, "decoded"), (f"{python}, JSON written", "written"),
    ]
    for what, name in rows:
        print(f"{what:50} {found[name]:7.2f} s {count / found[name]:12,.0f} lines/s")
    for name, other in [("text", "decoded"), ("json", "decoded"), ("json", "written")]:
        print(f"{name} {found[other] / found[name]:.1f} times as fast as python-can with cantools, {other}")
