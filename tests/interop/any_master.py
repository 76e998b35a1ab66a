"""Drives of `frhc sim` with python-canopen as a master that has only their EDS: it commissions all six, remaps their
PDOs, and checks SDO aborts, block transfers and LSS.

The expected values are those of CiA 301 and 305, independent of our own master.
"""

import random
import subprocess
import sys
import time
from pathlib import Path

from canopen.profiles.p402 import BaseNode402

from bench import CONFIG, DRIVE_EDS, INTERFACE, JOINTS, ROOT, check, same, until
from refusals import REFUSALS

NODES = [joint["node_id"] for joint in JOINTS]


def drives(bench, *arguments):
    """Starts the simulated drives; returns all six as nodes of python-canopen."""
    network = bench.connect()
    nodes = [network.add_node(BaseNode402(node_id, DRIVE_EDS)) for node_id in NODES]
    bench.sim = bench.start("sim", "--config", CONFIG, *arguments)
    until(lambda: all(bench.sent(0x700 + node_id) for node_id in NODES), "six boot-ups")
    return nodes


def configure(pdo, objects, kind, **timers):
    """Maps objects into a PDO with a transmission type, by the sequence of python-canopen."""
    pdo.clear()
    for entry in objects:
        pdo.add_variable(entry)
    pdo.trans_type = kind
    pdo.event_timer = timers.get("event_timer", 0)
    pdo.inhibit_time = timers.get("inhibit_time", 0)
    pdo.enabled = True
    pdo.save()


def switch_off(node):
    """Disables all PDOs of a node."""
    node.tpdo.read()
    node.rpdo.read()
    for pdo in [*node.tpdo.values(), *node.rpdo.values()]:
        pdo.enabled = False
        pdo.save()


def six_drives_are_commissioned_from_their_eds(bench):
    """Four TPDOs and four RPDOs each, of the transmission types 0, 1, 3, 254 and 255."""
    nodes = drives(bench)
    for node in nodes:
        switch_off(node)
        configure(node.tpdo[1], ["Statusword", "Position actual value"], 1)
        configure(node.tpdo[2], ["Modes of operation display"], 0)
        configure(node.tpdo[3], ["Velocity actual value", "Torque actual value"], 3)
        configure(node.tpdo[4], ["Modes of operation display"], 254, event_timer=20)
        configure(node.rpdo[1], ["Controlword", "Target torque"], 1)
        configure(node.rpdo[2], ["Target position"], 0)
        configure(node.rpdo[3], ["Target velocity"], 254)
        configure(node.rpdo[4], [0x0003, "Torque offset"], 255)
        for pdos in (node.tpdo, node.rpdo):
            pdos.read()
        same([p.trans_type for p in node.tpdo.values()], [1, 0, 3, 254], "types read back")
        same([len(p.data) for p in node.tpdo.values()], [6, 1, 6, 1], "lengths read back")
        same([p.trans_type for p in node.rpdo.values()], [1, 0, 254, 255], "types read back")
    bench.network.nmt.state = "OPERATIONAL"
    time.sleep(0.01)
    transmission_types_hold(bench, nodes)
    reception_types_hold(bench, nodes)
    inhibit_time_holds(bench, nodes)


def transmission_types_hold(bench, nodes):
    """Twelve SYNCs: type 1 at each, type 3 at every third, type 0 on change, type 254 by event timer."""
    counts = lambda number: [len(bench.sent(node.tpdo[number].cob_id)) for node in nodes]
    bench.network.sync.transmit()  # type 0 has never been sent: this SYNC takes what entering operation changed
    time.sleep(0.005)
    for node in nodes:
        node.sdo["Modes of operation"].raw = 0
    bench.network.nmt.state = "PRE-OPERATIONAL"
    bench.network.nmt.state = "OPERATIONAL"
    time.sleep(0.005)
    start = {number: counts(number) for number in (1, 2, 3)}
    for step in range(12):
        if step == 6:
            for node in nodes:
                node.sdo["Modes of operation"].raw = 10
        bench.network.sync.transmit()
        time.sleep(0.002)
    time.sleep(0.005)
    gained = {number: [b - a for a, b in zip(start[number], counts(number))] for number in start}
    same(gained[1], [12] * 6, "TPDO of type 1 at 12 SYNCs")
    same(gained[3], [4] * 6, "TPDO of type 3 at 12 SYNCs")
    check(all(1 <= gain <= 2 for gain in gained[2]), f"TPDO of type 0 when it has changed: {gained[2]}")
    timed = counts(4)
    time.sleep(0.2)
    gains = [b - a for a, b in zip(timed, counts(4))]
    check(all(9 <= gain <= 11 for gain in gains), f"TPDO of type 254 every 20 ms for 0.2 s: {gains}")


def reception_types_hold(bench, nodes):
    """Types 0 and 1 act at the next SYNC, 254 and 255 at once; a dummy entry only takes space."""
    for node in nodes:
        for number, data in ((1, b"\0\0\x2a\0"), (2, b"\x10\x27\0\0"), (3, b"\x39\x30\0\0")):
            bench.network.send_message(node.rpdo[number].cob_id, data)
        bench.network.send_message(node.rpdo[4].cob_id, b"\xff\xff\x07\0")
    names = ("Target torque", "Target position", "Target velocity", "Torque offset")
    held = [0, 0, 12345, 7]
    for node in nodes:
        same([node.sdo[name].raw for name in names], held, f"node {node.id} before the SYNC")
    bench.network.sync.transmit()
    time.sleep(0.002)
    for node in nodes:
        same([node.sdo[name].raw for name in names], [42, 10000, 12345, 7], "after the SYNC")
        node.sdo["Target torque"].raw = node.sdo["Torque offset"].raw = 0


def inhibit_time_holds(bench, nodes):
    """Type 255 is sent on change with its inhibit time, and the last value is sent."""
    bench.network.nmt.state = "PRE-OPERATIONAL"
    for node in nodes:
        configure(node.tpdo[4], ["Modes of operation display"], 255, inhibit_time=500)
    bench.network.nmt.state = "OPERATIONAL"
    time.sleep(0.2)
    node = nodes[2]
    before = len(bench.sent(node.tpdo[4].cob_id))
    for mode in (0, 10, 0, 10, 0):
        node.sdo["Modes of operation"].raw = mode
    time.sleep(0.2)
    sent = bench.sent(node.tpdo[4].cob_id)[before:]
    check(2 <= len(sent) <= 5, f"five changes at once are {len(sent)} TPDOs")
    gaps = [b - a for (a, _), (b, _) in zip(sent, sent[1:])]
    check(all(gap > 0.0499 for gap in gaps), f"50 ms between two: {gaps}")
    same(sent[-1][1], b"\0", "the last mode")


def remote_frame_is_answered_with_its_tpdo(bench):
    """A remote frame with the identifier of a TPDO (bit 30 of its COB-ID is 0) is answered with it."""
    node = drives(bench)[3]
    switch_off(node)
    configure(node.tpdo[1], ["Statusword", "Position actual value"], 1)
    node.nmt.state = "OPERATIONAL"
    time.sleep(0.01)
    before = len(bench.sent(0x184))
    bench.network.send_message(0x184, [], remote=True)
    until(lambda: len(bench.sent(0x184)) == before + 1, "the TPDO without a SYNC")
    same(len(bench.sent(0x184)[-1][1]), 6, "its length")


def drive_aborts_with_the_codes_of_the_standard(bench):
    """Every abort that a client can cause, from the table of the standard."""
    drives(bench)
    wrong = []
    for what, requests, code in REFUSALS:
        found = answer(bench, 1, requests)
        if found != f"{code:08X}h":
            wrong.append(f"{what}: {found}, expected {code:08X}h")
        # Abort a transfer that the row left open.
        bench.network.send_message(0x601, bytes.fromhex("80 00 00 00 00 00 00 08"))
    check(len(REFUSALS) >= 60, f"{len(REFUSALS)} rows")
    check(not wrong, "\n".join(["", *wrong]))


def answer(bench, node_id, requests):
    """Abort code of the last request, or its reply; each request waits for a reply."""
    for request in requests:
        count = len(bench.sent(0x580 + node_id))
        bench.network.send_message(0x600 + node_id, request)
        until(lambda: len(bench.sent(0x580 + node_id)) > count, f"an answer to {request.hex(' ')}")
    last = bench.sent(0x580 + node_id)[-1][1]
    return f"{int.from_bytes(last[4:], 'little'):08X}h" if last[0] == 0x80 else last.hex(" ")


def hundred_kilobytes_pass_in_block_transfers(bench):
    node = drives(bench)[4]
    value = random.Random(5).randbytes(100_000)
    with node.sdo[0x2000].open("wb", size=len(value), block_transfer=True) as buffer:
        buffer.write(value)
    with node.sdo[0x2000].open("rb", block_transfer=True) as buffer:
        same(buffer.read() == value, True, "what was written is read")


def stored_eds_is_uploaded_in_blocks(bench):
    """1021h, block and segmented upload: equal to the file."""
    node = drives(bench)[0]
    same(node.sdo["Store format"].raw, 0, "1022h: uncompressed")
    with node.sdo[0x1021].open("rb", block_transfer=True) as stored:
        same(stored.read() == Path(DRIVE_EDS).read_bytes(), True, "the file, in blocks")
    same(node.sdo.upload(0x1021, 0) == Path(DRIVE_EDS).read_bytes(), True, "the file, in segments")


def fastscan_finds_drives_without_a_node_id(bench):
    """LSS: all six lose their node-ids, fastscan finds one after the other, and each gets a new one."""
    nodes = drives(bench)
    lss = bench.network.lss
    lss.RESPONSE_TIMEOUT = 0.005
    serials = {node.sdo["Identity object"][4].raw: node.id for node in nodes}
    same(len(serials), 6, "serial numbers")
    for serial in serials:
        lss.send_switch_state_selective(0x0F8C, 0x04020010, 0x00010000, serial)
        lss.configure_node_id(255)
        lss.store_configuration()
        lss.send_switch_state_global(lss.WAITING_STATE)
    bench.network.nmt.state = "RESET COMMUNICATION"
    time.sleep(0.05)
    bench.network.scanner.reset()
    bench.network.scanner.search(16)
    time.sleep(0.2)
    same(sorted(bench.network.scanner.nodes), [16], "nodes with a node-ID")
    for _ in NODES:
        is_found, (vendor, product, revision, serial) = lss.fast_scan()
        same((is_found, vendor, product, revision), (True, 0x0F8C, 0x04020010, 0x00010000), "found")
        check(serial in serials, f"serial number {serial}")
        new = serials.pop(serial) + 32
        lss.configure_node_id(new)
        lss.store_configuration()
        lss.send_switch_state_global(lss.WAITING_STATE)
        until(lambda: bench.sent(0x700 + new), f"boot-up of node {new}")
    same(serials, {}, "drives that were not found")
    moved = bench.network.add_node(BaseNode402(33, DRIVE_EDS))
    same(moved.sdo[0x1200][1].raw, 0x621, "1200h:1 follows the node-id")
    same(lss.fast_scan()[0], False, "no further unconfigured device")


def documented_master_controls_a_drive(bench):
    """docs/python_master.py, as docs/third-party-masters.md shows it."""
    bench.sim = bench.start("sim", "--config", CONFIG)
    until(lambda: bench.sent(0x706), "boot-up")
    run = [sys.executable, str(ROOT / "docs/python_master.py"), INTERFACE, "6"]
    done = subprocess.run(run, capture_output=True, text=True, timeout=60, check=False)
    same(done.returncode, 0, f"exit code; stderr:\n{done.stderr}")
    said = done.stdout.splitlines()
    same(said[0], "frhc simulated drive, serial number 6", "device name")
    same(len(said), 7, f"lines of {said}")
    same(said[-1], "the drive is switch on disabled", "the end")
    torques = {data[6:] for _, data in bench.sent(0x186)}
    check((60).to_bytes(2, "little") in torques, "60 per mille were applied")


TESTS = [
    six_drives_are_commissioned_from_their_eds,
    remote_frame_is_answered_with_its_tpdo,
    drive_aborts_with_the_codes_of_the_standard,
    hundred_kilobytes_pass_in_block_transfers,
    stored_eds_is_uploaded_in_blocks,
    fastscan_finds_drives_without_a_node_id,
    documented_master_controls_a_drive,
]

# Tests whose logs contain remote frames or invalid requests, which other decoders reject.
STRANGE = [remote_frame_is_answered_with_its_tpdo, drive_aborts_with_the_codes_of_the_standard]
