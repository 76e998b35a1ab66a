"""Drives of `frhc sim` controlled by python-canopen over SDO (CiA 402-2): every transition of the power state machine,
every mode of operation, and the report of a fault."""

import math
import time

from any_master import drives
from bench import check, same, until

# Statusword & mask, by state (CiA 402-2, 8.4).
STATES = {
    "switch on disabled": (0x4F, 0x40),
    "ready to switch on": (0x6F, 0x21),
    "switched on": (0x6F, 0x23),
    "operation enabled": (0x6F, 0x27),
    "quick stop active": (0x6F, 0x07),
    "fault": (0x4F, 0x08),
}

STAY_IN_QUICK_STOP = 6
LEAVE_QUICK_STOP = 2

# Controlwords in order, the state after each, and its transition (CiA 402-2, figure of the state machine).
WALK = [
    (0x07, "switch on disabled", "no transition"),
    (0x0F, "switch on disabled", "no transition"),
    (0x06, "ready to switch on", 2),
    (0x00, "switch on disabled", 7),
    (0x06, "ready to switch on", 2),
    (0x02, "switch on disabled", 7),
    (0x06, "ready to switch on", 2),
    (0x07, "switched on", 3),
    (0x06, "ready to switch on", 6),
    (0x07, "switched on", 3),
    (0x00, "switch on disabled", 10),
    (0x06, "ready to switch on", 2),
    (0x07, "switched on", 3),
    (0x02, "switch on disabled", 10),
    (0x06, "ready to switch on", 2),
    (0x07, "switched on", 3),
    (0x0F, "operation enabled", 4),
    (0x07, "switched on", 5),
    (0x0F, "operation enabled", 4),
    (0x06, "ready to switch on", 8),
    (0x0F, "operation enabled", "3 and 4"),
    (0x00, "switch on disabled", 9),
    (0x06, "ready to switch on", 2),
    (0x0F, "operation enabled", "3 and 4"),
    (0x02, "quick stop active", 11),
    (0x06, "quick stop active", "no transition"),
    (0x0F, "operation enabled", 16),
    (0x02, "quick stop active", 11),
    (0x00, "switch on disabled", 12),
    (0x80, "switch on disabled", "no fault, no transition"),
]


def is_in(node, state):
    mask, pattern = STATES[state]
    return node.sdo["Statusword"].raw & mask == pattern


def command(node, word, state, why=""):
    """Sends a controlword and waits for the state, up to the time of a ramp."""
    node.sdo["Controlword"].raw = word
    until(lambda: is_in(node, state), f"node {node.id} {state} after {word:02X}h ({why})", 3.0)


def enable(node, mode):
    """Enables operation in a mode and checks its display (6061h)."""
    node.sdo["Modes of operation"].raw = mode
    until(lambda: node.sdo["Modes of operation display"].raw == mode, f"mode {mode}", 1.0)
    for word, state in ((0x06, "ready to switch on"), (0x07, "switched on"), (0x0F, "operation enabled")):
        command(node, word, state)


def bit(node, number, seconds=5.0):
    """Waits until a bit of the statusword is set."""
    until(lambda: node.sdo["Statusword"].raw >> number & 1, f"bit {number} of the statusword", seconds)


def six_drives_take_every_transition_of_the_state_machine(bench):
    for node in drives(bench):
        node.sdo["Modes of operation"].raw = 10
        node.sdo["Quick stop option code"].raw = STAY_IN_QUICK_STOP
        for word, state, transition in WALK:
            command(node, word, state, f"transition {transition}")
        node.sdo["Quick stop option code"].raw = LEAVE_QUICK_STOP
        enable(node, 10)
        command(node, 0x02, "switch on disabled", "transitions 11 and 12")
        # 13 and 14: loss of the master's heartbeat, a fault by 6007h.
        enable(node, 10)
        node.sdo["Abort connection option code"].raw = 1
        node.sdo["Consumer heartbeat time"][1].raw = 99 << 16 | 20
        bench.network.send_message(0x700 + 99, [5])
        until(lambda: is_in(node, "fault"), f"fault of node {node.id}")
        # 15: only by a rising edge of bit 7.
        for word in (0x00, 0x06, 0x0F):
            node.sdo["Controlword"].raw = word
            check(is_in(node, "fault"), f"no transition from fault by {word:02X}h")
        node.sdo["Consumer heartbeat time"][1].raw = 0
        command(node, 0x80, "switch on disabled", "transition 15")


def six_drives_run_torque_mode(bench):
    """Modes 4 and 10: the torque follows its target within the limits, while operation is enabled."""
    for node in drives(bench):
        for mode in (4, 10):
            enable(node, mode)
            for target in (60, -60):
                node.sdo["Target torque"].raw = target
                until(lambda: node.sdo["Torque actual value"].raw == target, f"{target} per mille")
            node.sdo["Max torque"].raw = 30
            until(lambda: node.sdo["Torque actual value"].raw == -30, "the limit of 6072h")
            check(node.sdo["Statusword"].raw >> 11 & 1, "bit 11: a limit is active")
            node.sdo["Max torque"].raw = 3000
            command(node, 0x00, "switch on disabled")
            until(lambda: node.sdo["Torque actual value"].raw == 0, "no torque without voltage")
            node.sdo["Target torque"].raw = 0


def torque_slope_is_kept_in_profile_torque_mode(bench):
    node = drives(bench)[5]
    node.sdo["Torque slope"].raw = 100
    enable(node, 4)
    node.sdo["Target torque"].raw = 50
    start = time.monotonic()
    until(lambda: node.sdo["Torque demand"].raw == 50, "50 per mille")
    took = time.monotonic() - start
    check(0.45 < took < 0.55, f"50 per mille at 100 per mille/s: {took:.3f} s")
    bit(node, 10)


def released(bench):
    """Drives with the simulated grip released, so that only they move the joints."""
    script = bench.folder / "released.toml"
    script.write_text("seconds = 60\n[[hold]]\nat_s = 0\nholding = false\n")
    nodes = drives(bench, "--scenario", script)
    bench.network.sync.transmit()
    return nodes


def hold(nodes):
    """Enables profile position mode, which holds the joints."""
    for node in nodes:
        enable(node, 1)


def drives_hold_the_arm_and_reach_target_positions(bench):
    """Mode 1: holds against gravity; a new set-point is acknowledged, reached and reported."""
    nodes = released(bench)
    hold(nodes)
    time.sleep(0.5)
    before = [node.sdo["Position actual value"].raw for node in nodes]
    time.sleep(1.0)
    after = [node.sdo["Position actual value"].raw for node in nodes]
    check(all(abs(a - b) < 300 for a, b in zip(before, after)), f"held: {before} and {after}")
    node = nodes[0]
    goal = after[0] + 30_000
    node.sdo["Target position"].raw = goal
    node.sdo["Controlword"].raw = 0x1F
    bit(node, 12)
    node.sdo["Controlword"].raw = 0x0F
    until(lambda: not node.sdo["Statusword"].raw >> 12 & 1, "set-point acknowledge reset")
    bit(node, 10)
    found = node.sdo["Position actual value"].raw
    check(abs(found - goal) < 300, f"at {found}, target {goal}")
    node.sdo["Target position"].raw = -10_000
    node.sdo["Controlword"].raw = 0x5F
    bit(node, 12)
    node.sdo["Controlword"].raw = 0x4F
    bit(node, 10)
    found = node.sdo["Position actual value"].raw
    check(abs(found - goal + 10_000) < 300, f"at {found}, target {goal} less 10000")


def drive_reaches_its_target_velocity(bench):
    """Mode 3: the target velocity is reached by a ramp and held until a halt."""
    nodes = released(bench)
    hold(nodes[1:])
    node = nodes[0]
    enable(node, 3)
    node.sdo["Target velocity"].raw = 40_000
    bit(node, 10)
    speeds = []
    for _ in range(20):
        time.sleep(0.01)
        speeds.append(node.sdo["Velocity actual value"].raw)
    mean = sum(speeds) / len(speeds)
    check(abs(mean - 40_000) < 2_000, f"mean speed {mean}")
    node.sdo["Controlword"].raw = 0x10F
    bit(node, 12)
    check(abs(node.sdo["Velocity actual value"].raw) < 2_000, "halted")


def homing_sets_the_current_position(bench):
    """Mode 6, methods 35 and 37: the position actual value becomes the home offset."""
    nodes = released(bench)
    hold(nodes[:5])
    node = nodes[5]
    methods = node.sdo["Supported homing methods"]
    offered = [methods[sub].raw for sub in range(1, methods[0].raw + 1)]
    check({35, 37} <= set(offered), f"methods offered: {offered}")
    for method, offset in ((37, 1234), (35, -5678)):
        enable(node, 6)
        node.sdo["Homing method"].raw = method
        node.sdo["Home offset"].raw = offset
        node.sdo["Controlword"].raw = 0x1F
        bit(node, 12)
        found = node.sdo["Position actual value"].raw
        check(abs(found - offset) < 200, f"method {method}: at {found}, home is {offset}")
        command(node, 0x00, "switch on disabled")


def cyclic_modes_follow_a_set_point_at_every_sync(bench):
    """Modes 8 and 9: one set-point per SYNC, a sine of positions and of velocities."""
    nodes = released(bench)
    hold(nodes[1:])
    node = nodes[0]
    start = node.sdo["Position actual value"].raw
    for mode, kind in ((8, "Target position"), (9, "Target velocity")):
        start = node.sdo["Position actual value"].raw
        node.rpdo.read()
        target = node.rpdo[1]
        target.clear()
        target.add_variable("Controlword")
        target.add_variable(kind)
        target.trans_type, target.enabled = 1, True
        target.save()
        node.sdo["Target position"].raw = start
        node.sdo["Target velocity"].raw = 0
        node.nmt.state = "OPERATIONAL"
        enable(node, mode)
        node.sdo["Interpolation time period"][1].raw = 2
        worst, target["Controlword"].raw = 0, 0x0F
        for step in range(500):
            angle = math.tau * step / 500
            is_position = mode == 8
            expected = 15_000 * (1 - math.cos(angle)) if is_position else 40_000 * math.sin(angle)
            target[kind].raw = round(start + expected) if is_position else round(expected)
            target.transmit()
            bench.network.sync.transmit()
            time.sleep(0.002)
            if step % 25 == 24:
                name = "Position actual value" if is_position else "Velocity actual value"
                error = node.sdo[name].raw - target[kind].raw
                worst = max(worst, abs(error))
                check(node.sdo["Statusword"].raw >> 12 & 1, "bit 12: the set-points are followed")
        bound = 4_000 if mode == 8 else 8_000
        check(worst < bound, f"mode {mode}: error {worst}")
        command(node, 0x00, "switch on disabled")
        node.nmt.state = "PRE-OPERATIONAL"


def held_joint_causes_a_following_error(bench):
    """Mode 1 with the window of 6065h: the hand on the grip is stronger than the torque limit."""
    node = drives(bench)[5]
    node.sdo["Max torque"].raw = 20
    node.sdo["Following error window"].raw = 5_000
    enable(node, 1)
    node.sdo["Target position"].raw = node.sdo["Position actual value"].raw + 60_000
    node.sdo["Controlword"].raw = 0x1F
    until(lambda: is_in(node, "fault"), "a fault", 5.0)
    same(node.sdo["Error code"].raw, 0x8611, "603Fh: following error")
    until(lambda: node.emcy.active, "an emergency")
    same(node.emcy.active[0].code, 0x8611, "emergency")


TESTS = [
    six_drives_take_every_transition_of_the_state_machine,
    six_drives_run_torque_mode,
    torque_slope_is_kept_in_profile_torque_mode,
    drives_hold_the_arm_and_reach_target_positions,
    drive_reaches_its_target_velocity,
    homing_sets_the_current_position,
    cyclic_modes_follow_a_set_point_at_every_sync,
    held_joint_causes_a_following_error,
]
