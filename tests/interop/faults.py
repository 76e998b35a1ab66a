"""Reports of injected faults by the drives of `frhc sim`: emergency, error register, history (1003h) and error code
(603Fh), read by python-canopen. A scenario injects the faults."""

import json
import signal
import time

from any_master import drives
from bench import check, same, until
from cia402 import command, enable, is_in

# Kind of fault, its keys, error code, error register (CiA 301, 7.5.2.2), and whether the power state is fault; one row
# per drive.
FAULTS = [
    ("fault", "code = 0x2310", 0x2310, 0x03, True),
    ("sto", "for_s = 1.0", 0x8A88, 0x21, True),
    ("emergency", "code = 0x4210\nregister = 0x09", 0x4210, 0x09, False),
    ("bus_off", "for_s = 0.2", 0x8140, 0x11, False),
    ("fault", "code = 0x3210", 0x3210, 0x05, True),
    ("fault", "code = 0x7305", 0x7305, 0x21, True),
]


def script(bench):
    """Scenario with one fault every 0.2 s, each on another drive."""
    path = bench.folder / "faults.toml"
    lines = ["seconds = 60"]
    for joint, (kind, keys, *_) in enumerate(FAULTS, 1):
        lines += ["[[fault]]", f"at_s = {0.2 * joint:.1f}", f'kind = "{kind}"', f"joint = {joint}", keys]
    path.write_text("\n".join(lines) + "\n")
    return path


def each_injected_fault_is_reported(bench):
    nodes = drives(bench, "--scenario", script(bench))
    bench.network.nmt.state = "OPERATIONAL"
    for node in nodes:
        enable(node, 10)
    bench.network.sync.transmit()
    time.sleep(1.6)
    for node, (kind, _, code, register, is_fault) in zip(nodes, FAULTS):
        emergencies = [data for _, data in bench.sent(0x80 + node.id)]
        what = f"node {node.id}, {kind} {code:04X}h"
        check(emergencies, f"{what}: no emergency")
        codes = [int.from_bytes(data[:2], "little") for data in emergencies]
        check(code in codes, f"{what}: {[f'{code:04X}' for code in codes]}")
        first = emergencies[codes.index(code)]
        same(f"{first[2]:02X}", f"{register:02X}", f"{what}: error register")
        history = [node.sdo[0x1003][sub].raw for sub in range(1, node.sdo[0x1003][0].raw + 1)]
        check(code in [entry & 0xFFFF for entry in history], f"{what}: 1003h {history}")
        same(is_in(node, "fault"), is_fault, f"{what}: statusword")
        if is_fault:
            same(node.sdo["Error code"].raw, code, f"{what}: 603Fh")
            check(node.sdo["Error register"].raw & 1, f"{what}: 1001h")
            check_reset(bench, node, what)


def check_reset(bench, node, what):
    """Resets the fault by the edge of bit 7, and checks the error reset emergency."""
    node.sdo["Controlword"].raw = 0
    command(node, 0x80, "switch on disabled", what)
    until(lambda: bench.sent(0x80 + node.id)[-1][1][:3] == b"\0\0\0", f"{what}: error reset")
    same(node.sdo["Error register"].raw, 0, f"{what}: 1001h")


def pressed_emergency_stop_prevents_a_fault_reset(bench):
    """Safe torque off: no fault reset while it lasts, and no automatic one after it."""
    path = bench.folder / "sto.toml"
    path.write_text('seconds = 60\n[[fault]]\nat_s = 0.2\nkind = "sto"\njoint = "all"\nfor_s = 1.0\n')
    nodes = drives(bench, "--scenario", path)
    for node in nodes:
        enable(node, 10)
    bench.network.sync.transmit()
    time.sleep(0.4)
    for node in nodes:
        check(is_in(node, "fault"), f"fault of node {node.id}")
        for word in (0x00, 0x80):
            node.sdo["Controlword"].raw = word
        check(is_in(node, "fault"), f"node {node.id}: no reset while the button is pressed")
    time.sleep(1.0)
    for node in nodes:
        check(is_in(node, "fault"), f"node {node.id}: fault persists after the button is released")
        node.sdo["Controlword"].raw = 0x00
        command(node, 0x80, "switch on disabled")


def rebooted_drive_sends_its_boot_up(bench):
    path = bench.folder / "reset.toml"
    path.write_text('seconds = 60\n[[fault]]\nat_s = 0.2\nkind = "reset"\njoint = 3\n')
    nodes = drives(bench, "--scenario", path)
    bench.network.nmt.state = "OPERATIONAL"
    before = len(bench.sent(0x703))
    bench.network.sync.transmit()
    until(lambda: b"\0" in [data for _, data in bench.sent(0x703)[before:]], "boot-up of node 3")
    nodes[2].sdo["Producer heartbeat time"].raw = 20
    same(nodes[2].nmt.wait_for_heartbeat(1.0), "PRE-OPERATIONAL", "its state")


def drive_states_are_printed_on_request(bench):
    """A report on SIGUSR1, and one at the end."""
    nodes = drives(bench, "--json")
    enable(nodes[1], 10)
    bench.sim.send_signal(signal.SIGUSR1)
    requested = json.loads(bench.sim.stdout.readline())
    text = json.dumps(requested)
    check("operation enabled" in text, f"the state of node 2 is not in {text[:600]}")
    bench.stop(bench.sim)
    last = [json.loads(line) for line in bench.sim.stdout]
    same(len(last), 1, "reports at the end")


TESTS = [
    each_injected_fault_is_reported,
    pressed_emergency_stop_prevents_a_fault_reset,
    rebooted_drive_sends_its_boot_up,
    drive_states_are_printed_on_request,
]
