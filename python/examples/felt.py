#!/usr/bin/env python3
"""Plays a session in which the MuJoCo arm is felt: drives and hand (frhc sim), node (frhc run) and arm, on vcan0.

    felt.py [--seconds S] [--session FOLDER] [--interface NAME]

The hand presses the peg into the wall, and further, withdraws it, puts it into the hole, and moves it against the bore: rounds of 20 s.
Prints what was felt, by the session that the node recorded. Exit code 0 if nothing stopped the node, 1 if something did.
lab/mujoco_arm.sh has what this needs. The program frhc is $FRHC, or `frhc`.
"""
import argparse
import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import felt_session

HERE = Path(__file__).resolve().parent
FRHC = os.environ.get("FRHC", "frhc")
CONFIG = HERE / "mujoco_arm.toml"
BEFORE, ROUND, AFTER = 4.0, 20.0, 1.0
"""Seconds from the begin of the scenario to the first round, of a round, and after the last one."""
# Places of the hand in m from its start, along the axes of {0}, which are those of {b}; when in a round, and how long the way.
MOVES = [
    (0.0, 1.0, (0.045, 0.0, 0.0)),  # into the wall, which is 30 mm away
    (3.0, 0.5, (0.055, 0.0, 0.0)),  # further
    (5.0, 1.0, (0.0, 0.0, 0.0)),
    (7.0, 1.0, (0.0, -0.06, 0.0)),  # in front of the hole
    (9.0, 2.0, (0.052, -0.06, 0.0)),  # in
    (12.0, 0.5, (0.052, -0.068, 0.0)),  # against the bore
    (14.0, 1.0, (0.052, -0.052, 0.0)),  # and its other side
    (16.0, 0.5, (0.052, -0.06, 0.0)),
    (16.8, 1.0, (0.0, -0.06, 0.0)),
    (18.4, 1.0, (0.0, 0.0, 0.0)),
]


def rounds_in(seconds):
    """Whole rounds that fit into a scenario of this length, at least one."""
    return max(1, int((seconds - BEFORE - AFTER) // ROUND))


def scenario(rounds):
    """Scenario of the operator, as TOML, and its length in s."""
    end = BEFORE + rounds * ROUND + AFTER
    text = [f"seconds = {end}"]
    switches = [(2.2, "deadman", "true"), (2.5, "reflection", "true"), (2.6, "reflection", "false"),
                (2.8, "reference", "true"), (2.9, "reference", "false"), (end - 0.2, "deadman", "false")]
    text += [f"[[switch]]\nat_s = {at}\n{name} = {level}" for at, name, level in switches]
    for start in (BEFORE + number * ROUND for number in range(rounds)):
        text += [f"[[move]]\nat_s = {start + at}\nduration_s = {way}\nto_m = {list(to)}" for at, way, to in MOVES]
    return "\n\n".join(text) + "\n", end


class Processes:
    """Started programs, all ended at the end."""

    def __init__(self, folder):
        self.folder, self.all = folder, []
        self.environment = {**os.environ, "XDG_RUNTIME_DIR": str(folder), "STATE_DIRECTORY": str(folder / "state")}
        self.environment.pop("RUNTIME_DIRECTORY", None)

    def start(self, *command):
        """Starts a program, with its output in a file of its own."""
        log = self.folder / f"{len(self.all)}.log"
        with log.open("w") as output:
            process = subprocess.Popen([str(word) for word in command], env=self.environment, stdout=output, stderr=output)
        process.log = log
        self.all.append(process)
        return process

    def stop(self, process):
        """Ends a program by SIGTERM. Returns its exit code."""
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        return process.wait(timeout=30)

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        for process in reversed(self.all):
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.stop(process)
            process.kill()
            if kind is not None:
                print(f"--- {process.args[:2]}\n{process.log.read_text()[-2000:]}", file=sys.stderr)


def play(folder, recordings, seconds, interface):
    """Plays the scenario. Returns the folder of the session."""
    text, end = scenario(rounds_in(seconds))
    (folder / "felt.toml").write_text(text)
    common = ["--config", CONFIG, "-i", interface]
    with Processes(folder) as processes:
        processes.start(FRHC, "sim", *common, "--scenario", folder / "felt.toml")
        processes.start(sys.executable, HERE / "mujoco_arm.py", "--socket", folder / "frhc/link.sock")
        node = processes.start(FRHC, "run", *common, "--record", recordings)
        armed = subprocess.run([FRHC, "ctl", "--wait", "arm"], env=processes.environment, capture_output=True, text=True,
                               timeout=60)
        if armed.returncode != 0:
            raise RuntimeError(f"the node does not arm: {armed.stderr}")
        finish = time.monotonic() + end + 1.0
        while time.monotonic() < finish and node.poll() is None:
            time.sleep(0.5)
        processes.stop(node)
    return max(Path(recordings).iterdir())


def main():
    parser = argparse.ArgumentParser(description="Plays and prints a session with the MuJoCo arm.", allow_abbrev=False)
    parser.add_argument("--seconds", type=float, default=45.0, help="length, at least one round of 20 s (default 45)")
    parser.add_argument("--session", help="folder in which the session is kept (default: none)")
    parser.add_argument("--interface", default="vcan0", help="SocketCAN interface (default vcan0)")
    args = parser.parse_args()
    if shutil.which(FRHC) is None:
        parser.error(f"no program {FRHC}; set FRHC to that of the build")
    with tempfile.TemporaryDirectory(prefix="frhc-mujoco-") as folder:
        session = play(Path(folder), args.session or f"{folder}/sessions", args.seconds, args.interface)
        felt = felt_session.read(FRHC, session)
        print(felt.text())
    sys.exit(1 if felt.trips else 0)


if __name__ == "__main__":
    main()
