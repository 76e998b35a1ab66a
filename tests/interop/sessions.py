"""Sessions of `frhc demo`, read by docs/sessions.md alone: this reader has no code of the program.

It reads all parts of the inputs to their last byte, plain or packed, and compares frames, wrenches, cycles and checksums with the other files of the session.
"""

import gzip
import hashlib
import json
import os
import re
import struct
import subprocess
import tempfile
from pathlib import Path

FRHC = os.environ["FRHC"]
FAULTS = 5
FNV_OFFSET, FNV_PRIME = 0x811C9DC5, 0x01000193


class Inputs:
    """Entries of a part, by the table in docs/sessions.md."""

    def __init__(self, content):
        magic, version, self.part, self.before = struct.unpack("<6sHIQ", content[:20])
        assert (magic, version) == (b"frhcin", 2), content[:8]
        self.content, self.place, self.reading = content, 20, 0
        self.numbers = [0.0] * 13

    def take(self, count):
        self.place += count
        assert self.place <= len(self.content), "the file ends inside an entry"
        return self.content[self.place - count:self.place]

    def u8(self):
        return self.take(1)[0]

    def u16(self):
        return struct.unpack("<H", self.take(2))[0]

    def u32(self):
        return struct.unpack("<I", self.take(4))[0]

    def varint(self):
        value, shift = 0, 0
        while True:
            byte = self.u8()
            value |= (byte & 0x7F) << shift
            shift += 7
            if not byte & 0x80:
                return value

    def time(self):
        value = self.varint()
        return self.reading + (-(value + 1) // 2 if value & 1 else value // 2)

    def read(self):
        self.reading = self.time()
        return self.reading

    def duration(self):
        return self.varint(), self.varint()

    def text(self):
        return self.take(self.varint()).decode()

    def frame(self):
        head = self.u16()
        is_remote, length = bool(head & 0x800), head >> 12
        return head & 0x7FF, is_remote, length, b"" if is_remote else self.take(length)

    def sample(self):
        at, mask = self.time(), self.u16()
        for place in range(13):
            if mask >> place & 1:
                self.numbers[place] = struct.unpack("<d", self.take(8))[0]
        return at, tuple(self.numbers)

    def misfits(self):
        return [self.text() for _ in range(self.varint())]

    def entries(self):
        """Yields each entry: its name in the table, and its values."""
        of = {
            0x01: ("NEW",), 0x02: ("BRING_UP",), 0x03: ("BRING_UP_UNPOWERED", self.u8), 0x04: ("ARM",), 0x05: ("DISARM",),
            0x06: ("RESET",), 0x07: ("COMMAND_RATE",), 0x08: ("COMMAND_POSE",), 0x09: ("CYCLE",), 0x0A: ("STOP",),
            0x10: ("RETURNED", self.u32), 0x11: ("INTERMEDIATES", self.varint, lambda: self.take(20)),
            0x20: ("NOW_AGAIN",), 0x21: ("NOW", self.read), 0x22: ("WALL", self.duration),
            0x23: ("SUSPENDED_AGAIN",), 0x24: ("SUSPENDED", self.duration),
            0x25: ("UNCONFIRMED", self.u8), 0x26: ("CONFIRMED", self.u8, self.time),
            0x31: ("QUEUE_FULL", self.varint), 0x32: ("BUS_DOWN", self.varint),
            0x40: ("WOKEN", self.read), 0x41: ("FRAME", self.u8, self.read, self.time, self.frame),
            0x42: ("BUS_FAULT", self.u8, self.read, self.time, self.fault),
            0x50: ("REOPENED",), 0x51: ("NOT_REOPENED_GONE", self.u8), 0x52: ("NOT_REOPENED_UNFIT", self.text),
            0x60: ("NOT_SENSED",), 0x61: ("SENSED_AGAIN",), 0x62: ("SENSED", self.sample),
            0x70: ("NO_SIDE_FAULT",), 0x71: ("SIDE_HOLDS", self.u8), 0x72: ("SIDE_SLOW", self.u32, self.u32),
            0x73: ("MISFITS", self.misfits), 0x80: ("GO_ON",), 0x81: ("END",), 0xF0: ("LOST", self.varint),
        }
        while self.place < len(self.content):
            name, *values = of[self.u8()]
            yield name, *[value() for value in values]

    def fault(self):
        fault = self.u8()
        assert fault < FAULTS, fault
        return fault


def recorded(folder, *args):
    """Records a session; returns its folder."""
    session = Path(folder) / "session"
    command = [FRHC, "-q", "demo", "--out", str(session), *args]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return session


def parts_of(session, name, extension):
    """Returns the content of each part, in order."""
    parts, number = [], 1
    while True:
        plain = session / (f"{name}-{number:03}.{extension}" if number > 1 else f"{name}.{extension}")
        packed = plain.with_name(plain.name + ".gz")
        if packed.exists():
            parts.append(gzip.decompress(packed.read_bytes()))
        elif plain.exists():
            parts.append(plain.read_bytes())
        else:
            return parts
        number += 1


def entries_of(session):
    entries = []
    for number, content in enumerate(parts_of(session, "inputs", "bin"), 1):
        inputs = Inputs(content)
        assert (inputs.part, inputs.before) == (number, len(entries))
        entries += inputs.entries()
    return entries


def log_of(session, interface, separator="#"):
    """Returns identifiers and data of an interface in bus.log; CAN FD has the flags 0 in its separator."""
    line = rf"^\(\S+\) {interface} ([0-9A-F]+){separator}([0-9A-F]*)$"
    lines = re.findall(line, b"".join(parts_of(session, "bus", "log")).decode(), re.M)
    return [(int(identifier, 16), data) for identifier, data in lines]


def inputs_are_read_to_the_last_byte_and_agree_with_the_log(_):
    with tempfile.TemporaryDirectory() as folder:
        session = recorded(folder, "--scenario", "contact_10s", "--seconds", "6")
        entries = entries_of(session)
        names = [name for name, *_ in entries]
        summary = json.loads((session / "summary.json").read_text())
        assert names.count("CYCLE") == summary["cycles"] == names.count("INTERMEDIATES"), names.count("CYCLE")
        assert names[:1] == ["NEW"] and "ARM" in names and names.count("STOP") == 1 and "LOST" not in names
        calls = {"NEW", "BRING_UP", "ARM", "CYCLE", "STOP", "COMMAND_RATE", "COMMAND_POSE"}
        assert sum(name in calls for name in names) == names.count("RETURNED")
        # The node has received what the drives have put on the wire, byte for byte and in this order.
        received = [entry[4] for entry in entries if entry[0] == "FRAME"]
        of_drive = lambda of: 0x181 <= of <= 0x186  # noqa: E731
        received = [(cob_id, data.hex().upper()) for cob_id, _, _, data in received if of_drive(cob_id)]
        on_the_wire = [(cob_id, data) for cob_id, data in log_of(session, "vcan0") if of_drive(cob_id)]
        assert len(received) > 30_000 and received == on_the_wire[:len(received)]


def wrenches_of_the_inputs_are_those_of_the_log(_):
    with tempfile.TemporaryDirectory() as folder:
        session = recorded(folder, "--scenario", "contact_10s", "--seconds", "6")
        expected, newest = [], None
        for name, *values in entries_of(session):
            if name == "SENSED":
                newest = struct.pack("<6d", *values[0][1][:6]).hex().upper()
            elif name == "CYCLE":
                # Each cycle acts on the sample of the one before.
                expected.append(newest)
        logged = [data for _, data in log_of(session, "wrench0", "##0")]
        assert len(set(logged)) > 1_000, "the object has met the wall"
        assert logged == expected


def checksums_are_those_of_the_frames_on_the_wire(_):
    with tempfile.TemporaryDirectory() as folder:
        session = recorded(folder, "--scenario", "free", "--seconds", "2")
        emitted = Path(folder) / "sent.log"
        subprocess.run([FRHC, "replay", str(session), "--emit", str(emitted)], check=True, stdout=subprocess.DEVNULL)
        lines = re.findall(r"^\(\S+\) vcan0 ([0-9A-F]{3})#([0-9A-F]*)$", emitted.read_text(), re.M)
        frames = iter([(int(cob_id, 16), bytes.fromhex(data)) for cob_id, data in lines])
        for wanted in [values[0] for name, *values in entries_of(session) if name == "RETURNED"]:
            value = FNV_OFFSET
            while value != wanted:
                cob_id, data = next(frames)
                for byte in struct.pack("<BHBB", 0, cob_id, 0, len(data)) + data:
                    value = (value ^ byte) * FNV_PRIME & 0xFFFFFFFF
        assert next(frames, None) is None, "frames of no call"


def parts_have_the_inputs_and_frames_of_one_file_plain_and_packed(_):
    with tempfile.TemporaryDirectory() as first, tempfile.TemporaryDirectory() as second:
        scenario = ["--scenario", "contact_10s", "--seconds", "4"]
        one, many = recorded(first, *scenario), recorded(second, *scenario, "--part-size", "0.4")
        parts = json.loads((many / "summary.json").read_text())["recording"]["parts"]
        for is_packed in (False, True):
            if is_packed:
                subprocess.run([FRHC, "sessions", "pack", str(many)], check=True, stdout=subprocess.DEVNULL)
            assert len(list(many.glob("*.gz"))) == (2 * parts if is_packed else 0)
            logs = parts_of(many, "bus", "log")
            assert len(logs) == parts > 3
            # Behind the last cycle comes the stop.
            assert all(log.endswith(b"\n") and b" node0 " in log.splitlines()[-1] for log in logs[:-1])
            assert b"".join(logs) == (one / "bus.log").read_bytes()
            # Samples that repeat are written in full at the start of a part.
            names = lambda session: [name.removesuffix("_AGAIN") for name, *_ in entries_of(session)]  # noqa: E731
            assert names(many) == names(one)
            calls = {"CYCLE", "ARM", "STOP", "COMMAND_RATE", "COMMAND_POSE", "DISARM"}
            for content in parts_of(many, "inputs", "bin")[1:]:
                assert next(Inputs(content).entries())[0] in calls


def copies_are_the_files_that_were_read(_):
    with tempfile.TemporaryDirectory() as folder:
        session = recorded(folder, "--scenario", "free", "--seconds", "1")
        description = json.loads((session / "session.json").read_text())
        files = {file["path"]: file for file in description["files"]}
        assert set(files) >= {"config/kraft_like.toml", "eds/frhc_drive.eds", "eds/frhc_switches.eds"}, files
        for path, file in files.items():
            content = Path(path).read_bytes()
            assert (session / file["copy"]).read_bytes() == content, path
            assert hashlib.sha256(content).hexdigest() == file["sha256"], path
        modes = {path.stat().st_mode & 0o777 for path in session.rglob("*")}
        assert modes == {0o600, 0o700}, modes


TESTS = [
    inputs_are_read_to_the_last_byte_and_agree_with_the_log,
    wrenches_of_the_inputs_are_those_of_the_log,
    checksums_are_those_of_the_frames_on_the_wire,
    parts_have_the_inputs_and_frames_of_one_file_plain_and_packed,
    copies_are_the_files_that_were_read,
]
