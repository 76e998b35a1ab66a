"""Frames that are not CANopen, on the COB-IDs of CANopen frames, while `frhc run` cycles.

Python's raw socket sends them. Remote, extended and FD frames must not act as the classic data frame with the same
identifier: the cycle continues without missing samples. Of the error frames, those that report bus off or error
passive stop the node.
"""

import socket
import struct
import time

from bench import CONFIG, INTERFACE, check, same, until

EXTENDED, REMOTE, ERROR = 0x80000000, 0x40000000, 0x20000000
CYCLES = 50

# Of our network: NMT, SYNC, emergency, TPDO, RPDO, SDO both ways, heartbeats of a drive and of the node.
OURS = [0x000, 0x080, 0x083, 0x100, 0x181, 0x190, 0x201, 0x581, 0x601, 0x701, 0x710, 0x77F]

# linux/can/error.h: the class of the error is the identifier, its detail in the data.
CAN_ERR_TX_TIMEOUT, CAN_ERR_LOSTARB, CAN_ERR_CRTL, CAN_ERR_PROT = 0x01, 0x02, 0x04, 0x08
CAN_ERR_TRX, CAN_ERR_ACK, CAN_ERR_BUSOFF, CAN_ERR_BUSERROR = 0x10, 0x20, 0x40, 0x80
CAN_ERR_RESTARTED, CAN_ERR_CNT = 0x100, 0x200
RX_OVERFLOW, TX_WARNING, RX_PASSIVE = 0x01, 0x08, 0x10
HARMLESS = [
    CAN_ERR_LOSTARB,
    CAN_ERR_PROT,
    CAN_ERR_TRX,
    CAN_ERR_ACK,
    CAN_ERR_BUSERROR,  # as a COB-ID: SYNC
    CAN_ERR_BUSERROR | CAN_ERR_PROT,
    CAN_ERR_CNT,
    CAN_ERR_CNT | CAN_ERR_LOSTARB,  # as a COB-ID: RPDO 1 of node 2
]


class RawSocket:
    """Raw socket that sends any frame."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        self.socket.bind((INTERFACE,))

    def send(self, identifier, data=b""):
        self.socket.send(struct.pack("=IB3x8s", identifier, len(data), data))

    def send_fd(self, identifier, data):
        self.socket.send(struct.pack("=IBB2x64s", identifier, len(data), 0, data))


def cycling(bench):
    """Starts simulated drives, and a node that cycles with them."""
    bench.start("sim", "--config", CONFIG)
    node = bench.start("run", "--config", CONFIG)
    bench.mode("ready")
    return node


def check_ignored(bench, send, pattern):
    """Checks that the cycle is undisturbed by the frames of `send`, which candump prints with `pattern`."""
    node = cycling(bench)
    ready = bench.sent(0x080)[-1][0]
    raw = RawSocket()
    before = bench.status()
    for identifier in OURS:
        send(raw, identifier)
        time.sleep(0.003)
    until(lambda: bench.status()["cycle"] >= before["cycle"] + CYCLES, "further cycles")
    after = bench.status()
    same((after["mode"], after["stopped_by"]), ("ready", None), "mode")
    same(after["missing_samples"], before["missing_samples"], "samples missed")
    bench.stop(node)
    count = sum(pattern in line for line in bench.frames())
    check(count >= len(OURS), f"candump received {count} of them")
    bench.has_a_sync_every(0.002, 1e-4, since=ready)


def remote_frames_are_ignored(bench):
    check_ignored(bench, lambda raw, cob_id: raw.send(cob_id | REMOTE), "#R")


def extended_frames_are_ignored(bench):
    def send(raw, cob_id):
        raw.send(cob_id | EXTENDED, bytes(8))
        raw.send(cob_id << 18 | EXTENDED, b"\x81\x00")

    check_ignored(bench, send, f"{INTERFACE} 00000")


def fd_frames_are_ignored(bench):
    def send(raw, cob_id):
        raw.send_fd(cob_id, bytes(64))
        raw.send_fd(cob_id, b"\x81\x00\x00\x00\x00\x00\x00\x00")

    check_ignored(bench, send, "##")


def error_frames_are_not_taken_as_commands(bench):
    node = cycling(bench)
    raw = RawSocket()
    before = bench.status()
    for kind in HARMLESS:
        raw.send(kind | ERROR, bytes(8))
        time.sleep(0.003)
    for detail in (RX_OVERFLOW, TX_WARNING):
        raw.send(CAN_ERR_CRTL | ERROR, bytes([0, detail, 0, 0, 0, 0, 0, 0]))
    until(lambda: bench.status()["cycle"] >= before["cycle"] + CYCLES, "further cycles")
    after = bench.status()
    same((after["mode"], after["stopped_by"]), ("ready", None), "mode")
    same(after["missing_samples"], before["missing_samples"], "samples missed")
    bench.stop(node)


def stops(bench, cause, identifier, data):
    """Checks that an error frame stops the node."""
    node = cycling(bench)
    RawSocket().send(identifier | ERROR, data)
    same(bench.mode("drives-off")["stopped_by"], cause, "cause")
    bench.stop(node, 6, f"stopped by {cause}")


def bus_off_stops_the_node(bench):
    stops(bench, "bus 0: bus off", CAN_ERR_BUSOFF, bytes(8))


def automatic_restart_after_bus_off_stops_the_node(bench):
    stops(bench, "bus 0: bus off", CAN_ERR_RESTARTED, bytes(8))


def error_passive_stops_the_node(bench):
    stops(bench, "bus 0: error passive", CAN_ERR_CRTL, bytes([0, RX_PASSIVE, 0, 0, 0, 0, 0, 0]))


def foreign_master_stops_the_node(bench):
    node = cycling(bench)
    RawSocket().send(0x000, b"\x80\x00")
    same(bench.mode("drives-off")["stopped_by"], "another master is on the bus", "cause")
    until(lambda: node.poll() is None, "the end of the node")


TESTS = [
    remote_frames_are_ignored,
    extended_frames_are_ignored,
    fd_frames_are_ignored,
    error_frames_are_not_taken_as_commands,
    bus_off_stops_the_node,
    automatic_restart_after_bus_off_stops_the_node,
    error_passive_stops_the_node,
    foreign_master_stops_the_node,
]
