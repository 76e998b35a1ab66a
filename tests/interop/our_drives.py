"""Drives of `frhc sim` with python-canopen as master."""

import random
import time

from canopen import SdoAbortedError
from canopen.profiles.p402 import BaseNode402

from bench import CONFIG, DRIVE_EDS, JOINTS, check, same, until

NODES = [*(joint["node_id"] for joint in JOINTS), 16]
MASTER = 127


def drive(bench, node_id=1):
    """The simulated drives, and one of them as python sees it."""
    network = bench.connect()
    node = network.add_node(BaseNode402(node_id, DRIVE_EDS))
    bench.sim = bench.start("sim", "--config", CONFIG)
    until(lambda: bench.sent(0x700 + node_id), "boot-up")
    return node


def refuses(code, transfer):
    """Checks that the transfer is aborted with this code."""
    try:
        transfer()
    except SdoAbortedError as abort:
        same(f"{abort.code:08X}", f"{code:08X}", "abort code")
    else:
        check(False, f"no abort, expected {code:08X}")


def exchange(node, period=0.002):
    """Statusword, position and torque from the drive at every SYNC, controlword and target torque to it."""
    node.tpdo.read()
    node.rpdo.read()
    sample, target = node.tpdo[1], node.rpdo[1]
    for pdo in [*node.tpdo.values(), *node.rpdo.values()]:
        pdo.enabled = False
    sample.clear()
    for name in ("Statusword", "Position actual value", "Torque actual value"):
        sample.add_variable(name)
    target.clear()
    for name in ("Controlword", "Target torque"):
        target.add_variable(name)
    for pdo in (sample, target):
        pdo.trans_type = 1
        pdo.enabled = True
    node.tpdo.save()
    node.rpdo.save()
    node.nmt.state = "OPERATIONAL"
    node.setup_402_state_machine(read_pdos=False)
    node.network.sync.start(period)
    target.start(period)
    check(sample.wait_for_reception(1.0) is not None, "a TPDO at the SYNC")
    return sample, target


def enable(node):
    """Enables the drive by the power state machine of python-canopen."""
    node.op_mode = "CYCLIC SYNCHRONOUS TORQUE"
    same(node.op_mode, "CYCLIC SYNCHRONOUS TORQUE", "mode of operation")
    node.state = "OPERATION ENABLED"
    same(node.state, "OPERATION ENABLED", "state")


def drives_boot_up_and_are_found(bench):
    drive(bench)
    for node_id in NODES:
        same(bench.sent(0x700 + node_id)[0][1], b"\x00", f"boot-up of node {node_id}")
    bench.network.scanner.search(32)
    until(lambda: sorted(bench.network.scanner.nodes) == NODES, f"nodes {NODES} answer")


def drive_reads_and_writes_expedited(bench):
    node = drive(bench)
    same(node.sdo["Device type"].raw, 0x00020192, "device type")
    identity = node.sdo["Identity object"]
    same([identity[n].raw for n in range(4)], [4, 0x0F8C, 0x04020010, 0x00010000], "identity")
    same(node.sdo["Motor rated torque"].raw, 177, "rated torque, 0.1765 N·m in mN·m")
    for value in (0, 1, 500, 1000):
        node.sdo["Max torque"].raw = value
        same(node.sdo["Max torque"].raw, value, "max torque")
    for value in (10, 0):
        node.sdo["Modes of operation"].raw = value
        same(node.sdo["Modes of operation display"].raw, value, "mode display")


def drive_reads_and_writes_segmented(bench):
    node = drive(bench)
    same(node.sdo["Manufacturer device name"].raw, "frhc simulated drive", "device name")
    same(node.sdo["Manufacturer software version"].raw, "0.1.0", "software version")
    node.sdo.download(0x6072, 0, b"\xd2\x04", force_segment=True)
    same(node.sdo["Max torque"].raw, 1234, "max torque")


def drive_reads_and_writes_in_blocks(bench):
    node = drive(bench)
    with node.sdo[0x1008].open("rb", block_transfer=True) as name:
        same(name.read(), b"frhc simulated drive", "device name")
    with node.sdo[0x6072].open("wb", size=2, block_transfer=True) as limit:
        limit.write(b"\xd2\x04")
    same(node.sdo["Max torque"].raw, 1234, "max torque")


def drive_keeps_a_large_value_in_blocks(bench):
    """Buffer 2000h: block download with segmented upload, and the reverse."""
    node = drive(bench)
    value = random.Random(1).randbytes(10_000)
    with node.sdo[0x2000].open("wb", size=len(value), block_transfer=True) as buffer:
        buffer.write(value)
    same(node.sdo.upload(0x2000, 0), value, "written in blocks, read in segments")
    value = value[::-1]
    node.sdo.download(0x2000, 0, value)
    with node.sdo[0x2000].open("rb", block_transfer=True) as buffer:
        same(buffer.read(), value, "written in segments, read in blocks")


def drive_refuses_with_the_standards_codes(bench):
    node = drive(bench)
    sdo = node.sdo
    limit = sdo["Max torque"].raw
    refuses(0x06020000, lambda: sdo.upload(0x2FFF, 0))
    refuses(0x06020000, lambda: sdo.download(0x2FFF, 0, b"\0"))
    refuses(0x06090011, lambda: sdo.upload(0x1018, 9))
    refuses(0x06090011, lambda: sdo.download(0x1018, 9, b"\0"))
    refuses(0x06010002, lambda: sdo.download(0x6041, 0, b"\0\0"))
    refuses(0x06010002, lambda: sdo.download(0x1000, 0, b"\0\0\0\0"))
    refuses(0x06070012, lambda: sdo.download(0x6072, 0, b"\0\0\0"))
    refuses(0x06070013, lambda: sdo.download(0x6072, 0, b"\0"))
    refuses(0x06090031, lambda: sdo.download(0x1029, 1, b"\x03"))
    refuses(0x06090032, lambda: sdo.download(0x605E, 0, b"\xff\xff"))
    refuses(0x06090030, lambda: sdo.download(0x6060, 0, b"\x05"))
    refuses(0x06040041, lambda: map_into(node.tpdo[1], 0x6072))
    same(sdo["Max torque"].raw, limit, "max torque, as it was")


def map_into(pdo, index):
    """Maps one object into a PDO, by the sequence of python-canopen."""
    pdo.read()
    pdo.clear()
    pdo.add_variable(index)
    pdo.save()


def drive_follows_nmt_and_reports_by_heartbeat(bench):
    node = drive(bench)
    default = node.sdo["Producer heartbeat time"].raw
    node.sdo["Producer heartbeat time"].raw = 40
    for state in ("OPERATIONAL", "STOPPED", "PRE-OPERATIONAL", "OPERATIONAL"):
        node.nmt.state = state
        same(node.nmt.wait_for_heartbeat(1.0), state, "NMT state")
    until(lambda: len(bench.sent(0x701)) > 12, "heartbeats")
    beats = [at for at, _ in bench.sent(0x701)][-6:]
    check(all(abs(b - a - 0.04) < 1e-3 for a, b in zip(beats, beats[1:])), f"every 40 ms: {beats}")
    node.sdo["Max torque"].raw = 777
    count = len(bench.sent(0x701))
    node.nmt.state = "RESET COMMUNICATION"
    until(lambda: b"\x00" in [data for _, data in bench.sent(0x701)[count:]], "boot-up")
    same(node.sdo["Producer heartbeat time"].raw, default, "1017h after a reset of communication")
    same(node.sdo["Max torque"].raw, 777, "6072h after a reset of communication")
    count = len(bench.sent(0x701))
    node.nmt.state = "RESET"
    until(lambda: b"\x00" in [data for _, data in bench.sent(0x701)[count:]], "boot-up")
    check(node.sdo["Max torque"].raw != 777, "6072h after a reset of the node")


def drive_sends_what_python_maps(bench):
    node = drive(bench, 3)
    sample, _ = exchange(node)
    same(
        [(v.index, v.offset, v.length) for v in sample],
        [(0x6041, 0, 16), (0x6064, 16, 32), (0x6077, 48, 16)],
        "TPDO 1",
    )
    sample.wait_for_reception(1.0)
    same(sample["Statusword"].raw & 0x6F, 0x40, "switch on disabled")
    node.network.sync.stop()
    node.network.sync.transmit()
    check(sample.wait_for_reception(1.0) is not None, "a TPDO")
    # The SYNC's sample; the arm may have moved a count since.
    position = sample["Position actual value"].raw
    check(abs(node.sdo["Position actual value"].raw - position) <= 2000, f"position {position}")
    check(position != 0, "the elbow is not at its encoder's zero")
    sample.read()
    sample.trans_type = 3
    node.nmt.state = "PRE-OPERATIONAL"
    sample.save()
    node.nmt.state = "OPERATIONAL"
    before = len(bench.sent(0x183))
    for _ in range(9):
        node.network.sync.transmit()
        time.sleep(0.002)
    until(lambda: len(bench.sent(0x183)) == before + 3, "a TPDO at every third SYNC")


def drive_is_enabled_by_python_and_applies_its_torque(bench):
    node = drive(bench, 6)
    sample, target = exchange(node)
    enable(node)
    for torque in (50, -50, 0):
        target["Target torque"].raw = torque
        until(lambda: sample["Torque actual value"].raw == torque, f"{torque} per mille")
    node.state = "SWITCHED ON"
    target["Target torque"].raw = 50
    sample.wait_for_reception(1.0)
    sample.wait_for_reception(1.0)
    same(sample["Torque actual value"].raw, 0, "torque while it is not enabled")
    node.state = "SWITCH ON DISABLED"


def torque_acts_at_the_sync_after_its_rpdo(bench):
    node = drive(bench, 6)
    sample, target = exchange(node)
    enable(node)
    target.stop()
    node.network.sync.stop()
    target["Target torque"].raw = 40
    target.transmit()
    same(node.sdo["Target torque"].raw, 0, "6071h before the SYNC")
    node.network.sync.transmit()
    until(lambda: node.sdo["Target torque"].raw == 40, "6071h after the SYNC")
    same(node.sdo["Torque demand"].raw, 40, "6074h after the SYNC")
    until(lambda: node.sdo["Torque actual value"].raw == 40, "6077h when the current has followed")


def short_rpdo_is_an_emergency_that_ends(bench):
    node = drive(bench, 2)
    sample, target = exchange(node)
    target.stop()
    bench.network.send_message(target.cob_id, b"\x06")
    until(lambda: node.emcy.active, "an emergency")
    same(node.emcy.active[0].code, 0x8210, "emergency")
    same(node.sdo[0x1003][0].raw, 1, "errors in the history")
    same(node.sdo[0x1003][1].raw & 0xFFFF, 0x8210, "the newest of them")
    check(node.sdo["Error register"].raw & 0x11 == 0x11, "generic and communication error")
    target.transmit()
    until(lambda: not node.emcy.active, "the end of the emergency")
    same(node.sdo["Error register"].raw, 0, "error register")
    node.sdo[0x1003][0].raw = 0
    same(node.sdo[0x1003][0].raw, 0, "errors in the history, cleared")
    check(sample.enabled, "the exchange goes on")


def silent_master_is_a_fault_python_resets(bench):
    node = drive(bench, 4)
    exchange(node)
    node.sdo["Abort connection option code"].raw = 1
    node.sdo["Consumer heartbeat time"][1].raw = MASTER << 16 | 50
    node.sdo["Producer heartbeat time"].raw = 20
    heartbeat = bench.network.send_periodic(0x700 + MASTER, [5], 0.02)
    enable(node)
    heartbeat.stop()
    until(lambda: node.emcy.active, "an emergency")
    same(node.emcy.active[0].code, 0x8130, "emergency")
    same(node.sdo["Statusword"].raw & 0x4F, 0x08, "statusword: fault")
    same(node.sdo["Error code"].raw, 0x8130, "603Fh")
    # 1029h:1 is 0: a communication error leaves Operational.
    same(node.nmt.wait_for_heartbeat(1.0), "PRE-OPERATIONAL", "NMT state")
    heartbeat = bench.network.send_periodic(0x700 + MASTER, [5], 0.02)
    node.nmt.state = "OPERATIONAL"
    until(lambda: node.state == "FAULT", "fault, by TPDO")
    node.reset_from_fault()
    same(node.state, "OPERATION ENABLED", "state after python's fault reset")
    heartbeat.stop()


def missing_rpdo_is_a_fault(bench):
    node = drive(bench, 5)
    _, target = exchange(node)
    node.sdo["Abort connection option code"].raw = 1
    enable(node)
    node.sdo[0x1400][5].raw = 20
    # The drive watches from the next RPDO on.
    time.sleep(0.01)
    target.stop()
    until(lambda: node.emcy.active, "an emergency")
    same(node.emcy.active[0].code, 0x8250, "emergency")
    until(lambda: node.state == "FAULT", "fault")


def switch_box_sends_its_inputs(bench):
    drive(bench)
    node = bench.network.add_node(16, str(CONFIG.parent.parent / "eds/frhc_switches.eds"))
    same(node.sdo["Device type"].raw & 0xFFFF, 401, "device profile")
    node.tpdo.read()
    inputs = node.tpdo[1]
    inputs.clear()
    inputs.add_variable(0x6000, 1)
    inputs.trans_type, inputs.event_timer, inputs.enabled = 255, 10, True
    inputs.save()
    node.nmt.state = "OPERATIONAL"
    check(inputs.wait_for_reception(1.0) is not None, "a TPDO")
    same(inputs[0].raw & 0b11, 0b10, "the deadman is released")
    count = len(bench.sent(0x190))
    until(lambda: len(bench.sent(0x190)) >= count + 10, "a TPDO every 10 ms", 0.2)


TESTS = [
    drives_boot_up_and_are_found,
    drive_reads_and_writes_expedited,
    drive_reads_and_writes_segmented,
    drive_reads_and_writes_in_blocks,
    drive_keeps_a_large_value_in_blocks,
    drive_refuses_with_the_standards_codes,
    drive_follows_nmt_and_reports_by_heartbeat,
    drive_sends_what_python_maps,
    drive_is_enabled_by_python_and_applies_its_torque,
    torque_acts_at_the_sync_after_its_rpdo,
    short_rpdo_is_an_emergency_that_ends,
    silent_master_is_a_fault_python_resets,
    missing_rpdo_is_a_fault,
    switch_box_sends_its_inputs,
]
