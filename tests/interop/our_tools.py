"""`frhc scan`, `sdo` and `nmt` against nodes made of python-canopen, and python's LSS master against the drives."""

import json
import random

from canopen.lss import CS_INQUIRE_PRODUCT_CODE, CS_INQUIRE_VENDOR_ID, LssMaster

import slaves
from bench import DRIVE_EDS, INTERFACE, check, same, until
from our_drives import NODES, drive

ON = ("-i", INTERFACE)


def scan_finds_pythons_nodes(bench):
    slaves.arm(bench.connect(), without=[5])
    found = json.loads(bench.frhc("scan", "--nodes", "1-32", "--json", *ON))["nodes"]
    same([entry["node"] for entry in found], [node for node in NODES if node != 5], "nodes")
    drives = [entry for entry in found if entry["node"] != 16]
    same({entry["vendor"] for entry in drives}, {0x0F8C}, "vendors")
    same({entry["product"] for entry in drives}, {0x04020010}, "products")


def sdo_reads_and_writes_pythons_objects(bench):
    node = slaves.arm(bench.connect())[3].node
    said = bench.frhc("sdo", "read", 3, "1008", "vs", *ON)
    check("frhc simulated drive" in said, said)
    said = bench.frhc("sdo", "read", 3, "1018:2", "u32", *ON)
    check(str(0x04020010) in said and "4020010" in said, said)
    bench.frhc("sdo", "write", *ON, "--verify", 3, "6072", "u16", 1234)
    same(node.sdo["Max torque"].raw, 1234, "6072h, as python has it")
    bench.frhc("sdo", "write", *ON, "--eds", DRIVE_EDS, 3, "6071", -100)
    same(node.sdo["Target torque"].raw, -100, "6071h, as python has it")
    process = bench.start("sdo", "read", 3, "2FFF", "u8", *ON)
    bench.ends(process, 5, "06020000")


def sdo_writes_a_large_value_that_python_takes_in_segments(bench):
    """python's server refuses blocks."""
    node = slaves.arm(bench.connect())[3].node
    value = random.Random(2).randbytes(3_000)
    (bench.folder / "value").write_bytes(value)
    bench.frhc("sdo", "write", *ON, 3, "2000", "d", f"@{bench.folder}/value")
    same(bytes(node.get_data(0x2000, 0)), value, "2000h, as python has it")
    bench.frhc("sdo", "read", 3, "2000", "d", "-o", bench.folder / "back", *ON)
    same((bench.folder / "back").read_bytes(), value, "2000h, read back")


def nmt_moves_pythons_nodes(bench):
    node = slaves.arm(bench.connect())[2].node
    node.sdo["Producer heartbeat time"].raw = 50
    node.nmt.start_heartbeat(50)
    for order, state in [("start", "OPERATIONAL"), ("stop", "STOPPED"), ("preop", "PRE-OPERATIONAL")]:
        bench.frhc("nmt", order, 2, "--wait", *ON)
        same(node.nmt.state, state, f"state after {order}")
    bench.frhc("nmt", "reset-comm", 2, "--wait", *ON)
    same(node.sdo["Producer heartbeat time"].raw, 0, "1017h after a reset")


def drive_is_given_its_node_id_by_pythons_lss_master(bench):
    node = drive(bench, 3)
    identity = [node.sdo["Identity object"][part].raw for part in (1, 2, 3, 4)]
    lss = bench.network.lss
    check(lss.send_switch_state_selective(*identity), "it is selected")
    same(lss.inquire_node_id(), 3, "its node-id")
    same(lss.inquire_lss_address(CS_INQUIRE_VENDOR_ID), 0x0F8C, "its vendor")
    same(lss.inquire_lss_address(CS_INQUIRE_PRODUCT_CODE), 0x04020010, "its product")
    lss.configure_node_id(9)
    lss.send_switch_state_global(LssMaster.WAITING_STATE)
    node.nmt.state = "RESET COMMUNICATION"
    until(lambda: bench.sent(0x709), "boot-up as node 9")
    same(bench.network.add_node(9, DRIVE_EDS).sdo["Device type"].raw, 0x20192, "1000h of node 9")


# Asks nodes without a heartbeat by remote frames, which other decoders reject.
STRANGE = [scan_finds_pythons_nodes]

TESTS = [
    scan_finds_pythons_nodes,
    sdo_reads_and_writes_pythons_objects,
    sdo_writes_a_large_value_that_python_takes_in_segments,
    nmt_moves_pythons_nodes,
    drive_is_given_its_node_id_by_pythons_lss_master,
]
