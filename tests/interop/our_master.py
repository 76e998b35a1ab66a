"""`frhc run` as master of drives of python-canopen."""

import json
import math
import time

from canopen import SdoAbortedError
from canopen.profiles.p402 import OperationMode

import slaves
from bench import CONFIG, JOINTS, SETTINGS, check, same, until

SAFETY = SETTINGS["safety"]
NODES = [joint["node_id"] for joint in JOINTS]


def running(bench):
    """Starts python's drives, and a node that boots and enables them; returns both."""
    drives = slaves.arm(bench.connect())
    node = bench.start("run", "--config", CONFIG)
    bench.mode("ready")
    return drives, node


def master_boots_and_enables_the_drives(bench):
    drives, node = running(bench)
    for drive in drives.values():
        same(drive.node.nmt.state, "OPERATIONAL", f"NMT state of node {drive.node.id}")
        same(drive.state, "OPERATION ENABLED", f"node {drive.node.id}")
    started = {data for _, data in bench.sent(0x000) if data[0] == 0x01}
    same(started, {bytes([1, node]) for node in [*NODES, 16]}, "NMT start")
    bench.stop(node)
    for drive in drives.values():
        same(drive.state, "SWITCH ON DISABLED", f"node {drive.node.id} after the stop")
        same(drive.node.nmt.state, "PRE-OPERATIONAL", f"NMT state of node {drive.node.id}")


def master_writes_what_python_reads_in_its_dictionary(bench):
    drives, node = running(bench)
    for drive in drives.values():
        target, sample = drive.node.rpdo[1], drive.node.tpdo[1]
        same([v.name for v in target], ["Controlword", "Target torque"], "RPDO 1")
        same(
            [v.name for v in sample],
            ["Statusword", "Position actual value", "Torque actual value"],
            "TPDO 1",
        )
        same((target.cob_id, sample.cob_id), (0x200 + drive.node.id, 0x180 + drive.node.id), "ids")
        same((target.trans_type, sample.trans_type), (1, 1), "transmission types")
        check(not any(drive.node.rpdo[n].enabled for n in (2, 3, 4)), "RPDO 2 to 4 are off")
        check(not any(drive.node.tpdo[n].enabled for n in (2, 3, 4)), "TPDO 2 to 4 are off")
        read = drive.node.sdo
        same(read[0x1400][5].raw, SAFETY["rpdo_timer_ms"], "RPDO 1 event timer")
        watch = SETTINGS["node"]["node_id"] << 16 | SAFETY["node_lost_ms"]
        same(read["Consumer heartbeat time"][1].raw, watch, "1016h:1")
        same(read["Producer heartbeat time"].raw, SAFETY["drive_heartbeat_ms"], "1017h")
        same(read["Modes of operation"].raw, OperationMode.CYCLIC_SYNCHRONOUS_TORQUE, "6060h")
        same(read["Abort connection option code"].raw, 1, "6007h")
        same(read["Fault reaction option code"].raw, 0, "605Eh")
        check(0 < read["Max torque"].raw <= 5000, "6072h")
    box = bench.network.nodes[16]
    same([v.index for v in box.tpdo[1]], [0x6000], "TPDO 1 of the switch box")
    same((box.tpdo[1].trans_type, box.tpdo[1].event_timer), (255, 5), "when it is sent")
    bench.stop(node)


def master_exchanges_with_every_drive_at_every_sync(bench):
    drives, node = running(bench)
    # The proof test interrupts the exchange before.
    ready = bench.sent(0x080)[-1][0]
    first = bench.status()
    until(lambda: bench.status()["cycle"] > first["cycle"] + 500, "500 cycles")
    same(bench.status()["missing_samples"], first["missing_samples"], "samples missed")
    for joint, q in zip(JOINTS, bench.status()["q"]):
        expected = slaves.angle(joint, drives[joint["node_id"]].counts)
        check(math.isclose(q, expected, abs_tol=1e-9), f"{joint['name']}: {q}, not {expected}")
    bench.has_a_sync_every(0.002, 2e-5, since=ready)
    beats = [at for at, data in bench.sent(0x77F) if data == b"\x05" and at >= ready]
    latest = max(b - a for a, b in zip(beats, beats[1:]))
    # It is sent by the cycle, which runs every 2 ms, and stops with it.
    check(latest < 0.0081, f"a heartbeat every 6 ms: {latest:.4f} s apart")
    bench.stop(node)


def master_carries_the_arm_with_the_torques_python_reads(bench):
    drives, node = running(bench)
    bench.frhc("ctl", "arm")
    bench.mode("armed")
    first = bench.status()["cycle"]
    # The shafts stand still, so once its ramp is over gravity compensation does, too.
    ramp = SAFETY["gravity_ramp_s"] / 0.002
    status = until(
        lambda: (now := bench.status())["cycle"] > first + ramp + 50 and now, "the ramp's end"
    )
    same([drives[n].torque() for n in NODES], status["targets"], "target torques")
    check(abs(status["targets"][1]) > 100, f"the elevation joint carries: {status['targets']}")
    reported = lambda: {n: bench.sent(drives[n].emergencies().cob_id) for n in NODES}
    before = reported()
    check(all(before.values()), f"the proof test makes each drive report: {before}")
    bench.stop(node)
    same([drives[n].torque() for n in NODES], [0] * 6, "target torques after the stop")
    # Twice the time after which a drive would miss its master.
    time.sleep(2 * SAFETY["node_lost_ms"] / 1000)
    for n in NODES:
        same(drives[n].state, "SWITCH ON DISABLED", f"node {n} after the stop")
        same(drives[n].node.sdo["Consumer heartbeat time"][1].raw, 0, f"1016h:1 of node {n}")
    same(reported(), before, "emergencies after the stop")


def emergency_of_a_drive_stops_the_node(bench):
    drives, node = running(bench)
    drives[3].emergencies().send(0x4210, 0x09, b"\x01\x02\x03\x04\x05")
    status = bench.mode("drives-off")
    cause = "joint 3 (elbow): emergency 4210h device temperature too high"
    same(status["stopped_by"], cause, "cause")
    said = bench.stop(node, 6, f"stopped by {cause}")
    check(said.count("joint 3 (elbow): emergency 4210h") >= 2, f"logged when it came:\n{said}")


def error_reset_emergency_stops_nothing(bench):
    drives, node = running(bench)
    drives[3].emergencies().reset()
    first = bench.status()["cycle"]
    until(lambda: bench.status()["cycle"] > first + 100, "cycles")
    same(bench.status()["mode"], "ready", "mode")
    bench.stop(node)


def silent_heartbeat_stops_the_node(bench):
    drives, node = running(bench)
    drives[4].node.nmt.stop_heartbeat()
    silent = bench.sent(0x704)[-1][0]
    same(bench.mode("drives-off")["stopped_by"], "joint 4 (pitch): heartbeat lost", "cause")
    until(lambda: drives[1].state == "SWITCH ON DISABLED", "the drives are off")
    bench.stop(node, 6, "stopped by joint 4 (pitch): heartbeat lost")
    off = next(at for at, data in bench.sent(0x201) if at > silent and data[0] == 0)
    check(off - silent < 0.064, f"{off - silent:.3f} s until power was taken off")


def disabled_by_sdo(bench, drives, node_id):
    """The drive's TPDOs do not confirm that its power is off: 6040h = 0 by SDO, and 6041h read back, do."""
    disable_voltage = bytes.fromhex("2B40600000000000")
    until(lambda: disable_voltage in [data for _, data in bench.sent(0x600 + node_id)], "6040h = 0 by SDO")
    until(lambda: drives[node_id].state == "SWITCH ON DISABLED", "the drive is off")
    until(lambda: bench.status()["not_off"] == [], "the drive is confirmed to be off")


def silent_tpdo_stops_the_node(bench):
    drives, node = running(bench)
    drives[2].sends = False
    cause = f"joint 2 (elevation): no sample for {SAFETY['missing_samples']} cycles"
    same(bench.mode("drives-off")["stopped_by"], cause, "cause")
    disabled_by_sdo(bench, drives, 2)
    bench.stop(node, 6, f"stopped by {cause}\n")


def boot_up_of_a_drive_stops_the_node(bench):
    drives, node = running(bench)
    drives[5].boot_up()
    same(bench.mode("drives-off")["stopped_by"], "joint 5 (yaw): rebooted", "cause")
    # python's drive only said that it rebooted: its statusword reports operation enabled until 6040h is written.
    disabled_by_sdo(bench, drives, 5)
    bench.stop(node, 6, "stopped by joint 5 (yaw): rebooted\n")


def drive_in_fault_stops_the_node_and_a_reset_revives_it(bench):
    drives, node = running(bench)
    drives[6].state = "FAULT"
    cause = bench.mode("drives-off")["stopped_by"]
    same(cause, "joint 6 (roll): drive left operation enabled (6041h = 0208h)", "cause")
    bench.frhc("ctl", "reset")
    bench.mode("ready")
    same(drives[6].state, "OPERATION ENABLED", "joint 6 after the reset")
    bench.stop(node)


def missing_drive_is_reported(bench):
    slaves.arm(bench.connect(), without=[5])
    node = bench.start("run", "--config", CONFIG)
    bench.ends(node, 5, "joint 5 (yaw), node 5: does not answer")
    same(bench.sent(0x080), [], "SYNCs")


def drive_of_another_product_is_reported(bench):
    drives = slaves.arm(bench.connect())
    drives[2].node.sdo["Identity object"]["Product code"].raw = 0x04020011
    node = bench.start("run", "--config", CONFIG)
    said = "joint 2 (elevation), node 2: 1018h:2 is 04020011h, expected 04020010h"
    bench.ends(node, 5, said)
    check(all(data[0] != 0x01 for _, data in bench.sent(0x000)), "no node is started")


def rejected_mapping_is_reported(bench):
    drives = slaves.arm(bench.connect())

    def refuse(index, subindex, **_):
        if (index, subindex) == (0x1A00, 3):
            raise SdoAbortedError(0x06040041)

    drives[1].node.add_write_callback(refuse)
    node = bench.start("run", "--config", CONFIG)
    bench.ends(node, 5, "joint 1 (azimuth), node 1: 1A00h:3 refused: 06040041h")


def drive_without_master_monitoring_is_refused(bench):
    drives = slaves.arm(bench.connect())
    drives[3].watches = False
    node = bench.start("run", "--config", CONFIG)
    timer = SAFETY["rpdo_timer_ms"]
    said = (
        f"joint 3 (elbow), node 3: kept its power stage on for {timer + 35} ms without RPDOs "
        f"(1400h:5 is {timer} ms)"
    )
    bench.ends(node, 5, said)
    for drive in drives.values():
        check(drive.state != "OPERATION ENABLED", f"node {drive.node.id} is off")


def every_drive_passes_the_proof_test_with_measured_times(bench):
    drives = slaves.arm(bench.connect())
    report = json.loads(bench.frhc("commission", "--config", CONFIG, "--prove", "--json"))
    same(len(report["drives"]), 6, "drives")
    for drive in report["drives"]:
        for timer, slack in (("rpdo", 2.0), ("heartbeat", 3.0)):
            said, measured = drive[timer]["said_ms"], drive[timer]["measured_ms"]
            check(said <= measured <= said + slack, f"{drive['name']}: {timer} {measured} ms")
    check(report["may_arm"], "40 N are allowed")
    for drive in drives.values():
        same(drive.state, "SWITCH ON DISABLED", f"node {drive.node.id} after the proof test")


TESTS = [
    master_boots_and_enables_the_drives,
    master_writes_what_python_reads_in_its_dictionary,
    master_exchanges_with_every_drive_at_every_sync,
    master_carries_the_arm_with_the_torques_python_reads,
    emergency_of_a_drive_stops_the_node,
    error_reset_emergency_stops_nothing,
    silent_heartbeat_stops_the_node,
    silent_tpdo_stops_the_node,
    boot_up_of_a_drive_stops_the_node,
    drive_in_fault_stops_the_node_and_a_reset_revives_it,
    missing_drive_is_reported,
    drive_of_another_product_is_reported,
    rejected_mapping_is_reported,
    drive_without_master_monitoring_is_refused,
    every_drive_passes_the_proof_test_with_measured_times,
]
