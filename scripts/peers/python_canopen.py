"""python_canopen.py: the exchange of loop.c with python-canopen, as its documentation shows it.

usage: python_canopen.py INTERFACE PERIOD_US grouped|per-drive EDS SECONDS

SYNC, the positions of six drives by their TPDOs, torques clamp(-q/8) by RPDOs. No boot, no power stage, no heartbeat, no watch.
"""

import sys
import threading
import time

import canopen

DRIVES = range(1, 7)


def main():
    interface, layout, eds = sys.argv[1], sys.argv[3], sys.argv[4]
    period, seconds = int(sys.argv[2]) * 1e-6, float(sys.argv[5])
    is_grouped = layout == "grouped"
    network = canopen.Network()
    network.connect(interface="socketcan", channel=interface)
    nodes = [network.add_node(drive, eds) for drive in DRIVES]
    positions, complete = {}, threading.Event()

    def received(drive):
        def callback(pdo):
            positions[drive] = pdo["Position actual value"].raw
            if len(positions) == len(DRIVES):
                complete.set()
        return callback

    for drive, node in zip(DRIVES, nodes):
        tpdo = node.tpdo[1]
        tpdo.clear()
        if not is_grouped:
            tpdo.add_variable(0x6041)
        tpdo.add_variable(0x6064)
        tpdo.cob_id, tpdo.enabled = 0x180 + drive, True
        tpdo.add_callback(received(drive))
        tpdo.subscribe()
    outputs = []
    # Grouped: one RPDO has the torques of three drives. A node's own object is mapped three times, as a drive maps two dummies.
    for first in (1, 4) if is_grouped else DRIVES:
        rpdo = nodes[first - 1].rpdo[1]
        rpdo.clear()
        if not is_grouped:
            rpdo.add_variable(0x6040)
        for _ in range(3 if is_grouped else 1):
            rpdo.add_variable(0x6071)
        rpdo.cob_id, rpdo.enabled = 0x200 + first, True
        outputs.append((first, rpdo))
    network.send_message(0, [1, 0])
    due, end = time.monotonic() + period, time.monotonic() + seconds
    while due < end:
        time.sleep(max(0.0, due - time.monotonic()))
        positions.clear()
        complete.clear()
        network.sync.transmit()
        complete.wait(0.1)
        for first, rpdo in outputs:
            torques = rpdo.map if is_grouped else rpdo.map[1:]
            for place, torque in enumerate(torques):
                torque.raw = max(-1000, min(1000, -positions.get(first + place, 0) // 8))
            rpdo.transmit()
        # Slots that have passed are left out.
        now = time.monotonic()
        due += period * max(1, int((now - due) / period) + 1)


main()
