"""Frames that are no CANopen, with the identifiers of our own, while `frhc run` cycles.

Sent by python's own raw socket. None of them may be taken for the SYNC, sample, target or command whose
identifier it bears: the cycle goes on, misses nothing and stops for nothing. Error frames tell of the bus,
and those that tell of a bus that is off stop the node.
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


class Stranger:
    """A raw socket that may send anything."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        self.socket.bind((INTERFACE,))

    def send(self, identifier, data=b""):
        self.socket.send(struct.pack("=IB3x8s", identifier, len(data), data))

    def send_fd(self, identifier, data):
        self.socket.send(struct.pack("=IBB2x64s", identifier, len(data), 0, data))


def cycling(bench):
    """Simulated drives and a node that exchanges with them."""
    bench.start("sim", "--config", CONFIG)
    node = bench.start("run", "--config", CONFIG)
    bench.mode("ready")
    return node


def nothing_comes_of(bench, strike, seen):
    """The cycle goes on as before while and after `strike` sends what candump writes like `seen`."""
    node = cycling(bench)
    ready = bench.sent(0x080)[-1][0]
    stranger = Stranger()
    before = bench.status()
    for identifier in OURS:
        strike(stranger, identifier)
        time.sleep(0.003)
    until(lambda: bench.status()["cycle"] >= before["cycle"] + CYCLES, "further cycles")
    after = bench.status()
    same((after["mode"], after["stopped_by"]), ("ready", None), "mode")
    same(after["missing_samples"], before["missing_samples"], "samples missed")
    bench.stop(node)
    struck = sum(seen in line for line in bench.frames())
    check(struck >= len(OURS), f"candump saw {struck} of them")
    bench.has_a_sync_every(0.002, 1e-4, since=ready)


def remote_frames_are_not_heard(bench):
    nothing_comes_of(bench, lambda stranger, cob_id: stranger.send(cob_id | REMOTE), "#R")


def extended_twins_are_not_heard(bench):
    def strike(stranger, cob_id):
        stranger.send(cob_id | EXTENDED, bytes(8))
        stranger.send(cob_id << 18 | EXTENDED, b"\x81\x00")

    nothing_comes_of(bench, strike, f"{INTERFACE} 00000")


def fd_twins_are_not_heard(bench):
    def strike(stranger, cob_id):
        stranger.send_fd(cob_id, bytes(64))
        stranger.send_fd(cob_id, b"\x81\x00\x00\x00\x00\x00\x00\x00")

    nothing_comes_of(bench, strike, "##")


def error_frames_are_no_commands(bench):
    node = cycling(bench)
    stranger = Stranger()
    before = bench.status()
    for kind in HARMLESS:
        stranger.send(kind | ERROR, bytes(8))
        time.sleep(0.003)
    for detail in (RX_OVERFLOW, TX_WARNING):
        stranger.send(CAN_ERR_CRTL | ERROR, bytes([0, detail, 0, 0, 0, 0, 0, 0]))
    until(lambda: bench.status()["cycle"] >= before["cycle"] + CYCLES, "further cycles")
    after = bench.status()
    same((after["mode"], after["stopped_by"]), ("ready", None), "mode")
    same(after["missing_samples"], before["missing_samples"], "samples missed")
    bench.stop(node)


def stops(bench, cause, identifier, data):
    """An error frame stops the node."""
    node = cycling(bench)
    Stranger().send(identifier | ERROR, data)
    same(bench.mode("drives-off")["stopped_by"], cause, "cause")
    bench.stop(node, 6, f"stopped by {cause}")


def bus_that_is_off_stops_the_node(bench):
    stops(bench, "bus 0: bus off", CAN_ERR_BUSOFF, bytes(8))


def bus_that_was_off_and_is_back_by_itself_stops_the_node(bench):
    stops(bench, "bus 0: bus off", CAN_ERR_RESTARTED, bytes(8))


def bus_that_is_passive_stops_the_node(bench):
    stops(bench, "bus 0: error passive", CAN_ERR_CRTL, bytes([0, RX_PASSIVE, 0, 0, 0, 0, 0, 0]))


def foreign_master_stops_the_node(bench):
    node = cycling(bench)
    Stranger().send(0x000, b"\x80\x00")
    same(bench.mode("drives-off")["stopped_by"], "another master is on the bus", "cause")
    until(lambda: node.poll() is None, "it still runs")


TESTS = [
    remote_frames_are_not_heard,
    extended_twins_are_not_heard,
    fd_twins_are_not_heard,
    error_frames_are_no_commands,
    bus_that_is_off_stops_the_node,
    bus_that_was_off_and_is_back_by_itself_stops_the_node,
    bus_that_is_passive_stops_the_node,
    foreign_master_stops_the_node,
]
