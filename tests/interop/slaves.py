"""CiA 402 drives and a switch box of python-canopen, as far as `frhc run` needs them.

python-canopen serves SDO and heartbeat, and reads the PDO mapping from its dictionary. This file adds boot-up after
a reset, the exchange at SYNC, the power state machine, and the monitoring of the master.
"""

import math
import struct
import threading
import time

import canopen
from canopen.profiles.p402 import State402

from bench import DRIVE_EDS, JOINTS, SETTINGS, SWITCHES, SWITCHES_EDS

RPDO_TIMEOUT, HEARTBEAT_LOST = 0x8250, 0x8130
CONTROLWORD, STATUSWORD, MODE, MODE_DISPLAY = 0x6040, 0x6041, 0x6060, 0x6061
POSITION, TORQUE = 0x6064, 0x6077
MASTER = SETTINGS["node"]["node_id"]
DEADMAN_RELEASED = 0b10


class Slave:
    """LocalNode with boot-up and NMT resets (CiA 301, 7.3.2.2)."""

    def __init__(self, network, node_id, eds):
        self.node = network.create_node(node_id, eds)
        network.subscribe(0, self.on_nmt)
        self.boot_up()

    def on_nmt(self, _cob_id, data, _time):
        command, node_id = data
        if node_id not in (0, self.node.id):
            return
        if command in (0x81, 0x82):
            self.stop()
            kept = {} if command == 0x81 else self.node.data_store
            self.node.data_store = {index: v for index, v in kept.items() if index >= 0x2000}
            self.boot_up()
        elif command == 0x01:
            self.start()

    def boot_up(self):
        self.node.nmt.stop_heartbeat()
        self.node.nmt.state = "INITIALISING"
        self.node.nmt.state = "PRE-OPERATIONAL"

    def start(self):
        """Enters operational with the PDOs of the dictionary."""
        self.node.pdo.read()

    def stop(self):
        """Leaves operational."""
        for pdo in self.node.tpdo.values():
            pdo.stop()

    def fill(self, pdo):
        """Copies the mapped objects into a TPDO."""
        for variable in pdo:
            variable.set_data(self.node.get_data(variable.index, variable.subindex))


class Drive(Slave):
    """Drive with a blocked shaft."""

    def __init__(self, network, joint):
        self.state = "SWITCH ON DISABLED"
        self.before = 0
        self.sends = True
        self.waiting = None
        # Monitoring of the master; drives with default settings often have none.
        self.watches = True
        self.received_at = {}
        self.timers = {}
        turns = joint["rest_deg"] / 360.0 * joint["gear_ratio"]
        self.counts = joint["zero_counts"] + round(turns * joint["encoder_counts_per_rev"])
        super().__init__(network, joint["node_id"], DRIVE_EDS)
        self.node.add_read_callback(self.on_read)
        self.node.add_write_callback(self.on_write)
        network.subscribe(0x80, self.on_sync)
        self.node.sdo["Motor rated torque"].raw = round(joint["rated_torque_nm"] * 1000)
        network.subscribe(0x700 + MASTER, self.on_master)
        threading.Thread(target=self.watch, args=[network], daemon=True).start()

    def start(self):
        super().start()
        self.waiting = None
        self.received_at.pop(RPDO_TIMEOUT, None)
        read = self.node.sdo
        self.timers = {
            RPDO_TIMEOUT: read[0x1400][5].raw / 1000,
            HEARTBEAT_LOST: (read["Consumer heartbeat time"][1].raw & 0xFFFF) / 1000,
        }
        self.node.rpdo[1].add_callback(self.on_rpdo)

    def watch(self, network):
        """Disables the power stage on a timeout of the RPDO (1400h:5) or of the master's heartbeat (1016h:1).

        Both timers start with the first frame in operational."""
        while network.bus is not None:
            time.sleep(0.0005)
            if not self.watches or self.node.nmt.state != "OPERATIONAL":
                continue
            now = time.monotonic()
            for code, timer in self.timers.items():
                if timer and now - self.received_at.get(code, now) > timer:
                    self.trip(code)

    def trip(self, code):
        """Reacts to a lost master by 6007h = 1, 605Eh = 0 and 1029h:1 = 0."""
        self.received_at.pop(code, None)
        self.state = "FAULT"
        self.emergencies().send(code, 0x11)
        if code == HEARTBEAT_LOST:
            self.node.nmt.state = "PRE-OPERATIONAL"
            self.stop()

    def on_master(self, _cob_id, _data, _time):
        self.received_at[HEARTBEAT_LOST] = time.monotonic()

    def emergencies(self):
        """EMCY producer on the COB-ID of 1014h."""
        self.node.emcy.cob_id = self.node.sdo[0x1014].raw & 0x7FF
        return self.node.emcy

    def on_rpdo(self, pdo):
        self.waiting = bytes(pdo.data)
        self.received_at[RPDO_TIMEOUT] = time.monotonic()

    def on_sync(self, _cob_id, _data, _time):
        """Samples the TPDO and applies the RPDO, both by the mapping in the dictionary."""
        if self.node.nmt.state != "OPERATIONAL":
            return
        sample, target = self.node.tpdo[1], self.node.rpdo[1]
        self.fill(sample)
        if self.waiting is not None:
            for variable in target:
                self.node.set_data(variable.index, variable.subindex, variable.get_data())
        if self.sends:
            sample.transmit()

    def on_read(self, index, **_):
        """Values that the drive computes."""
        if index == STATUSWORD:
            return State402.SW_MASK[self.state][1] | 0x0200
        if index == MODE_DISPLAY:
            return self.node.sdo[MODE].raw
        if index == TORQUE:
            return self.torque() if self.state == "OPERATION ENABLED" else 0
        return self.counts if index == POSITION else None

    def on_write(self, index, data, **_):
        if index == CONTROLWORD:
            (word,) = struct.unpack("<H", data)
            self.state = after(self.state, word, self.before)
            self.before = word

    def torque(self):
        """Target torque in the dictionary, in per mille."""
        return self.node.sdo["Target torque"].raw


def after(state, word, before):
    """State after a controlword (CiA 402-2, table of device control commands)."""
    if state == "FAULT":
        reset = word & 0x80 and not before & 0x80
        return "SWITCH ON DISABLED" if reset else state
    powered = ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED")
    if word & 0x82 == 0x00:  # disable voltage
        return "SWITCH ON DISABLED"
    if word & 0x87 == 0x06:  # shutdown
        return "READY TO SWITCH ON"
    if word & 0x86 == 0x02:  # quick stop
        return "QUICK STOP ACTIVE" if state == "OPERATION ENABLED" else "SWITCH ON DISABLED"
    if word & 0x8F == 0x07 and state in powered:  # switch on, disable operation
        return "SWITCHED ON"
    if word & 0x8F == 0x0F and state in powered[1:]:  # enable operation
        return "OPERATION ENABLED"
    return state


class SwitchBox(Slave):
    """Eight inputs, sent on the event timer (1800h:5)."""

    def __init__(self, network):
        super().__init__(network, SWITCHES["node_id"], SWITCHES_EDS)
        self.node.set_data(0x6000, 1, bytes([DEADMAN_RELEASED]))

    def start(self):
        super().start()
        pdo = self.node.tpdo[1]
        self.fill(pdo)
        pdo.start(pdo.event_timer / 1000)


def arm(network, without=()):
    """Starts the switch box and the drives except `without`; returns the drives by node-ID."""
    SwitchBox(network)
    joints = [joint for joint in JOINTS if joint["node_id"] not in without]
    return {joint["node_id"]: Drive(network, joint) for joint in joints}


def angle(joint, counts):
    """Joint position in rad from encoder counts."""
    turns = (counts - joint["zero_counts"]) / joint["encoder_counts_per_rev"]
    return turns / joint["gear_ratio"] * math.tau
