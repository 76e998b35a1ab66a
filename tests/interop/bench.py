"""Common parts of the tests: frhc as a process, candump as the recorder, and waiting.

Time is virtual (scripts/with_vcan.sh -v): sleeping costs nothing, and a loop that does not sleep never ends.
"""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import tomllib
from pathlib import Path

import canopen

ROOT = Path(__file__).resolve().parents[2]
FRHC = os.environ.get("FRHC", str(ROOT / "target/dist/frhc"))
LOGS = os.environ.get("INTEROP_LOGS")
INTERFACE = "vcan0"
CONFIG = ROOT / "config/kraft_like_500hz.toml"
SETTINGS = tomllib.loads(CONFIG.read_text())
JOINTS = SETTINGS["joint"]
SWITCHES = SETTINGS["switches"]
DRIVE_EDS = str(ROOT / "eds/frhc_drive.eds")
SWITCHES_EDS = str(ROOT / "eds/frhc_switches.eds")


class Failed(AssertionError):
    """Failed expectation of a test."""


def check(is_so, what):
    """Fails with `what` unless `is_so`."""
    if not is_so:
        raise Failed(what)


def same(found, expected, what):
    """Fails where two values differ."""
    check(found == expected, f"{what}: {found!r}, expected {expected!r}")


def until(is_so, what, seconds=5.0):
    """Waits until `is_so()` is true, and returns its value."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        answer = is_so()
        if answer:
            return answer
        time.sleep(0.002)
    raise Failed(f"not within {seconds} s: {what}")


class Bench:
    """Folder, recorded bus and processes of one test, removed at its end."""

    def __init__(self, name):
        self.name = name

    def __enter__(self):
        self.folder = Path(tempfile.mkdtemp(prefix="frhc-interop-", dir="/dev/shm"))
        self.environment = {**os.environ, "XDG_RUNTIME_DIR": str(self.folder)}
        self.environment["STATE_DIRECTORY"] = str(self.folder / "state")
        self.environment.pop("RUNTIME_DIRECTORY", None)
        self.processes = []
        self.network = None
        self.log = self.folder / "candump.log"
        with self.log.open("w") as log:
            # -d reports dropped frames; the buffer (-r) is large enough for a boot.
            recorder = ["candump", "-L", "-d", "-r", "8000000", INTERFACE]
            self.candump = subprocess.Popen(recorder, stdout=log)
        time.sleep(0.05)
        return self

    def __exit__(self, kind, error, trace):
        if self.network is not None:
            self.network.disconnect()
        for process in self.processes:
            process.kill()
        time.sleep(0.02)
        self.candump.terminate()
        self.candump.wait()
        if error is not None:
            error.frames = self.frames()[-40:]
        missed = [line for line in self.frames() if line.startswith("DROPCOUNT")]
        if LOGS:
            shutil.copy(self.log, f"{LOGS}/{self.name}.log")
        shutil.rmtree(self.folder)
        if error is None:
            same(missed, [], "frames dropped by candump")

    def frames(self):
        """Lines of candump so far."""
        return self.log.read_text().splitlines()

    def sent(self, cob_id):
        """Times and data of the data frames of an identifier so far."""
        line = re.compile(rf"\((\d+\.\d+)\) \S+ {cob_id:03X}#([0-9A-F]*)(?: .)?$")
        found = map(line.match, self.frames())
        return [(float(hit[1]), bytes.fromhex(hit[2])) for hit in found if hit]

    def has_a_sync_every(self, period, slack, since):
        """Checks the SYNC period, except for the last few SYNCs around the stop."""
        syncs = [at for at, _ in self.sent(0x080) if at >= since][:-10]
        check(len(syncs) > 20, f"{len(syncs)} SYNCs")
        worst = max(abs(b - a - period) for a, b in zip(syncs, syncs[1:]))
        check(worst < slack, f"one SYNC every {period} s: {worst:.6f} s off")

    def connect(self):
        """Connects python-canopen to the bus."""
        self.network = canopen.Network()
        self.network.NOTIFIER_CYCLE = 0.05
        self.network.NOTIFIER_SHUTDOWN_TIMEOUT = 1.0
        self.network.connect(interface="socketcan", channel=INTERFACE)
        return self.network

    def start(self, *arguments):
        """Starts frhc with these arguments."""
        errors = self.folder / f"stderr{len(self.processes)}.log"
        with errors.open("w") as to:
            process = subprocess.Popen(
                [FRHC, *map(str, arguments)],
                cwd=ROOT,
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=to,
                text=True,
            )
        process.errors = errors
        self.processes.append(process)
        return process

    def ends(self, process, code, reason=""):
        """Waits for the end of a process; checks its exit code and its reason on stderr."""
        process.wait(timeout=60)
        stderr = process.errors.read_text()
        same(process.returncode, code, f"exit code; stderr:\n{stderr}")
        check(reason in stderr, f"{reason!r} is not in:\n{stderr}")
        return stderr

    def stop(self, process, code=0, reason=""):
        """Ends a process by SIGTERM."""
        process.send_signal(signal.SIGTERM)
        return self.ends(process, code, reason)

    def frhc(self, *arguments):
        """Runs frhc to its end; returns its output."""
        process = self.start(*arguments)
        printed, _ = process.communicate(timeout=60)
        same(process.returncode, 0, f"frhc {arguments}: {process.errors.read_text()}")
        return printed

    def status(self):
        """Status of the node; `None` before its first cycle."""
        try:
            with socket.socket(socket.AF_UNIX) as console:
                console.settimeout(1.0)
                console.connect(str(self.folder / "frhc/node.sock"))
                console.sendall(b'{"ask":"status"}\n')
                return json.loads(console.makefile().readline()).get("status")
        except (FileNotFoundError, ConnectionError):
            return None

    def mode(self, mode):
        """Waits until the node is in a mode; returns its status."""

        def status():
            now = self.status()
            return now if now and now["mode"] == mode else None

        return until(status, f"mode {mode}")
