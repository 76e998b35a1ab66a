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


@functools.cache
def known():
    """Its messages by their COB-IDs."""
    return {message.frame_id: message for message in database().messages}


def cantools_knows_every_pdo(_logs):
    for joint in JOINTS:
        for cob_id in (0x180 + joint["node_id"], 0x200 + joint["node_id"]):
            check(cob_id in known(), f"{cob_id:03X} is not in the DBC")


def cantools_reads_every_signal_as_frhc_decode_does(logs):
    compared = {}
    for file in logs.files:
        for (_, cob_id, data), ours in zip(frames(file), decoded(file), strict=True):
            message = known().get(cob_id)
            if message is None:
                check("signals" not in ours, f"{file.name}:{ours['line']}: not in the DBC")
                continue
            if len(data) != message.length:
                continue
            for name, theirs, value in pairs(message, data, ours):
                where = f"{file.name}:{ours['line']}: {name} = {value!r}, by cantools {theirs!r}"
                check(theirs == value or is_near(theirs, value), where)
                compared[name] = compared.get(name, 0) + 1
    for joint in (joint["name"] for joint in JOINTS):
        for signal in ("position", "torque", "target_torque", "state"):
            count = compared.get(f"{joint}_{signal}", 0)
            check(count > 1_000, f"{joint}_{signal} was compared {count} times")
    for name in ("switch_box_deadman", "switch_box_reference", "error_code", "state"):
        check(name in compared, f"{name} was never compared")


def is_near(theirs, ours):
    """Equal, but for how a number is printed and summed."""
    if isinstance(theirs, str) or isinstance(ours, str):
        return False
    return math.isclose(theirs, ours, rel_tol=1e-9, abs_tol=1e-9)


def pairs(message, data, ours):
    """A signal, what cantools reads in it, and what `frhc decode` does."""
    numbers = message.decode(data, decode_choices=False)
    words = message.decode(data)
    signals = ours.get("signals", {})
    for name, number in numbers.items():
        member = name.removesuffix("_state")
        inputs = name.replace("switch_box_", "switch_box_digital_inputs_")
        if name in signals:
            yield name, number, signals[name]
        elif f"{member}_statusword_state" in signals:
            yield name, str(words[name]), signals[f"{member}_statusword_state"]
        elif inputs in signals:
            yield name, number, int(signals[inputs])
    if ours["kind"] == "emcy":
        yield "error_code", numbers["error_code"], ours["code"]
    if ours["kind"] == "heartbeat":
        state = str(words["state"])
        yield "state", "initialising" if state == "boot-up" else state, ours["state"]
    if "switch_box_deadman_a" in numbers:
        channels = numbers["switch_box_deadman_a"], numbers["switch_box_deadman_b"]
        deadman = {(1, 0): "pressed", (0, 1): "released"}[channels]
        yield "switch_box_deadman", deadman, signals["switch_box_digital_inputs_deadman"]


def cantools_reads_the_lines_of_the_recorder(logs):
    """A session has further lines, of CAN FD with 29 bits: the wrench and the end of every cycle."""
    folder = logs.folder / "demo"
    command = [FRHC, "demo", "--config", CONFIG, "--scenario", "contact_10s", "--out", folder]
    subprocess.run(command, cwd=ROOT, capture_output=True, check=True, timeout=120)
    messages = {"wrench": known()[0x18FF0000], "cycle": known()[0x18FF0001]}
    felt, cycles = 0, 0
    for ours in decoded(folder / "bus.log"):
        if ours["kind"] not in messages:
            continue
        theirs = messages[ours["kind"]].decode(bytes.fromhex(ours["data"]))
        if ours["kind"] == "wrench":
            axes = [f"{part}_{axis}" for part in ("force", "moment") for axis in "xyz"]
            same(ours["f_s"], [theirs[axis] for axis in axes], f"wrench, line {ours['line']}")
            felt += any(ours["f_s"])
        else:
            same(ours["mode"], str(theirs["mode"]), f"mode, line {ours['line']}")
            same(ours["cycle"], theirs["cycle"], f"line {ours['line']}")
            cycles += 1
    check(felt > 500 and cycles > 4_000, f"{felt} wrenches felt in {cycles} cycles")


TESTS = [
    cantools_knows_every_pdo,
    cantools_reads_every_signal_as_frhc_decode_does,
    cantools_reads_the_lines_of_the_recorder,
]
