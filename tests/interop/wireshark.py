"""Wireshark's CANopen dissector reads the logs."""

import functools
import itertools
import subprocess
import tempfile

from bench import check, same
from logs import decoded, frames

FIELDS = [
    "can.id",
    "_ws.col.Info",
    "_ws.malformed",
    "_ws.expert.message",
    "canopen.sdo.main_idx",
    "canopen.sdo.sub_idx",
    "canopen.sdo.abort_code",
    "canopen.em.err_code",
    "canopen.em.err_reg",
]

# CiA 301, 7.3.3: the predefined connection set, by function code, in the dissector's words.
SERVICES = {
    0x080: "EMCY",
    0x100: "Timestamp",
    0x180: "PDO1 (tx)",
    0x200: "PDO1 (rx)",
    0x280: "PDO2 (tx)",
    0x300: "PDO2 (rx)",
    0x380: "PDO3 (tx)",
    0x400: "PDO3 (rx)",
    0x480: "PDO4 (tx)",
    0x500: "PDO4 (rx)",
    0x580: "Default-SDO (tx)",
    0x600: "Default-SDO (rx)",
    0x700: "NMT Error Control",
}
BROADCASTS = {0x000: "NMT: ", 0x080: "SYNC", 0x7E4: "LSS", 0x7E5: "LSS"}


# Emergencies that the master has put behind the PDOs (1014h): the dissector cannot know it from the frame.
MOVED_EMERGENCIES = 0x680


def is_moved(cob_id):
    """Returns whether a frame's service is known from the configuration alone."""
    return cob_id & 0x780 == MOVED_EMERGENCIES


def service(cob_id):
    """Service name that the dissector must print for a frame."""
    return BROADCASTS.get(cob_id) or SERVICES[cob_id & 0x780]


@functools.cache
def dissection(files):
    """The logs as the dissector reads them: one row of FIELDS for each frame. All in one, which is quicker."""
    with tempfile.NamedTemporaryFile(suffix=".log") as all_in_one:
        all_in_one.write(b"".join(file.read_bytes() for file in files))
        all_in_one.flush()
        columns = [word for field in FIELDS for word in ("-e", field)]
        as_canopen = ["-d", "can.subdissector,canopen", "-T", "fields"]
        command = ["tshark", "-r", all_in_one.name, *as_canopen, *columns]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    same(done.returncode, 0, f"tshark: {done.stderr}")
    rows = iter([line.split("\t") for line in done.stdout.splitlines()])
    dissected = {file: list(itertools.islice(rows, len(frames(file)))) for file in files}
    same(next(rows, None), None, "rows beyond the last frame")
    return dissected


def dissected(logs):
    """Each log and its rows."""
    return dissection(tuple(logs.without_blocks)).items()


def wireshark_knows_every_frame(logs):
    for file, rows in dissected(logs):
        for number, (cob_id, info, malformed, expert, *_) in enumerate(rows, 1):
            if is_moved(int(cob_id)):
                continue
            where = f"{file.name}:{number}: {info}"
            check(info.startswith(service(int(cob_id))), f"{where}, not {service(int(cob_id))}")
            check("nknown" not in info, where)
            same((malformed, expert), ("", ""), where)


def wireshark_sees_every_sdo_request_answered(logs):
    """The reply to an initiating request names its object, and comes before the next request."""
    for file, rows in dissected(logs):
        waiting = {}
        for number, (cob_id, info, _, _, index, sub, *_) in enumerate(rows, 1):
            node = int(cob_id) & 0x7F
            if info.startswith("Default-SDO (rx): Initiate"):
                so_far = file.read_text().splitlines()[max(0, number - 30) : number]
                where = "\n".join([f"{file.name}:{number}: unanswered before it", *so_far])
                check(node not in waiting or not expects_answers(file), where)
                waiting[node] = (index, sub)
            elif info.startswith(("Default-SDO (tx): Initiate", "Default-SDO (tx): Abort")):
                same((index, sub), waiting.pop(node, None), f"{file.name}:{number}: object")


def expects_answers(file):
    """Returns whether every requested node is present."""
    return file.stem not in ("missing_drive_is_reported", "drives_boot_up_and_are_found")


# Kind of a frame in `frhc decode --json`, by the beginning of the dissector's text.
KINDS = {
    "NMT: ": "nmt",
    "NMT Error Control": "heartbeat",
    "SYNC": "sync",
    "Timestamp": "time",
    "EMCY": "emcy",
    "PDO": "pdo",
    "Default-SDO": "sdo",
    "LSS": "lss",
}


def wireshark_agrees_with_frhc_decode(logs):
    for file, rows in dissected(logs):
        for row, ours in zip(rows, decoded(file), strict=True):
            cob_id, info, _, _, index, sub, abort, code, register = row
            where = f"{file.name}:{ours['line']}: {info}"
            same(int(ours["id"], 16), int(cob_id), where)
            if is_moved(int(cob_id)):
                same(ours["kind"], "emcy", where)
                continue
            kind = next(ours for theirs, ours in KINDS.items() if info.startswith(theirs))
            same(ours["kind"], kind, where)
            if index:
                same(object_of(ours), (int(index, 16), int(sub, 16)), where)
            if abort:
                same(ours["abort"], int(abort, 16), where)
            if code:
                same((ours["code"], ours["register"]), (int(code, 16), int(register, 16)), where)
            if kind == "heartbeat":
                state = info.removeprefix("NMT Error Control: ").split(" [")[0].lower()
                same(ours["state"], STATES.get(state, state), where)


# As the dissector says it, and as we do.
STATES = {"boot-up": "initialising"}


def object_of(ours):
    """`1018h:2` as index and sub-index."""
    index, _, sub = ours["object"].partition(":")
    return int(index.removesuffix("h"), 16), int(sub or 0)


TESTS = [
    wireshark_knows_every_frame,
    wireshark_sees_every_sdo_request_answered,
    wireshark_agrees_with_frhc_decode,
]
