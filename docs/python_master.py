#!/usr/bin/env python3
"""A whole master for one of frhc's simulated drives in python-canopen: python_master.py [INTERFACE [NODE]].

Commissions the drive from its EDS, enables it, lets its motor pull to and fro for a second, and switches it
off. Nothing here knows frhc: the same lines drive any CiA 402 drive with such an EDS.
"""

import math
import sys
from pathlib import Path

import canopen
from canopen.profiles.p402 import BaseNode402

INTERFACE = sys.argv[1] if len(sys.argv) > 1 else "vcan0"
NODE = int(sys.argv[2]) if len(sys.argv) > 2 else 6
EDS = str(Path(__file__).parent.parent / "eds/frhc_drive.eds")
MASTER = 127
PERIOD = 0.01

network = canopen.Network()
network.connect(interface="socketcan", channel=INTERFACE)
drive = network.add_node(BaseNode402(NODE, EDS))

# Whom we talk to.
identity = drive.sdo["Identity object"]
print(f"{drive.sdo['Manufacturer device name'].raw}, serial number {identity[4].raw}")

# The drive watches us: without our heartbeat for 100 ms it faults, which 6007h = 1 makes a loss of torque.
network.send_periodic(0x700 + MASTER, [5], 0.02)
drive.sdo["Consumer heartbeat time"][1].raw = MASTER << 16 | 100
drive.sdo["Abort connection option code"].raw = 1

# One PDO each way, both on the SYNC; all others off.
drive.tpdo.read()
drive.rpdo.read()
for pdo in [*drive.tpdo.values(), *drive.rpdo.values()]:
    pdo.enabled = False
    pdo.save()
sample, target = drive.tpdo[1], drive.rpdo[1]
for pdo, names in (
    (sample, ("Statusword", "Position actual value", "Torque actual value")),
    (target, ("Controlword", "Target torque")),
):
    pdo.clear()
    for name in names:
        pdo.add_variable(name)
    pdo.trans_type, pdo.enabled = 1, True
    pdo.save()

# Up through the power state machine in cyclic synchronous torque mode.
drive.nmt.state = "OPERATIONAL"
drive.setup_402_state_machine(read_pdos=False)
network.sync.start(PERIOD)
target.start(PERIOD)
drive.op_mode = "CYCLIC SYNCHRONOUS TORQUE"
drive.state = "OPERATION ENABLED"

# A sine of torque; it acts at the SYNC after the one we send it behind (CiA 301: synchronous RPDOs).
for step in range(100):
    target["Target torque"].raw = round(60 * math.sin(math.tau * step / 100))
    sample.wait_for_reception(1.0)
    if step % 20 == 0:
        position, torque = sample["Position actual value"].raw, sample["Torque actual value"].raw
        print(f"{step * PERIOD:.1f} s: {position} increments, {torque} per mille")

target["Target torque"].raw = 0
drive.state = "SWITCH ON DISABLED"
print(f"the drive is {drive.state.lower()}")
drive.nmt.state = "PRE-OPERATIONAL"
network.sync.stop()
network.disconnect()
