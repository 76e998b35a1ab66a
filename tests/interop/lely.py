"""lely's commissioning of the drives of `frhc sim`: dcfgen makes its concise DCFs from our EDS, and each entry of
them is written as lely's master writes it when it boots a slave."""

import subprocess
import sys
import time
from pathlib import Path

from bench import CONFIG, DRIVE_EDS, JOINTS, check, same, until

TOOLS = Path(sys.executable).parent
NODES = [joint["node_id"] for joint in JOINTS]

SLIPS = {"invalid DefaultValue in [2182]: 0.0"}

HEADER = """\
master:
  node_id: 127
  sync_period: 2000
  heartbeat_producer: 20
"""

# A drive as in ros2_canopen's bus.yml, which lely's dcfgen reads, too.
DRIVE = """\
joint_{node}:
  dcf: "{eds}"
  node_id: {node}
  revision_number: 0x00010000
  heartbeat_producer: 100
  heartbeat_consumer: true
  boot: true
  tpdo:
    1:
      cob_id: auto
      transmission: 1
      mapping: [{{index: 0x6041}}, {{index: 0x6064}}, {{index: 0x6077}}]
    2: {{enabled: false}}
    3: {{enabled: false}}
    4: {{enabled: false}}
  rpdo:
    1:
      cob_id: auto
      transmission: 1
      mapping: [{{index: 0x6040}}, {{index: 0x6071}}]
    2: {{enabled: false}}
    3: {{enabled: false}}
    4: {{enabled: false}}
  sdo:
    - {{index: 0x6060, sub_index: 0, value: 10}}
    - {{index: 0x6007, sub_index: 0, value: 1}}
"""


def tool(bench, name, *arguments):
    """One of lely's tools in the folder of the test; it must be content."""
    run = [str(TOOLS / name), *arguments]
    done = subprocess.run(run, cwd=bench.folder, capture_output=True, text=True, check=False)
    same((done.returncode, done.stderr), (0, ""), f"{name} {' '.join(arguments)}")
    return done.stdout


def concise(data):
    """Index, sub-index and value of each entry of a concise DCF (CiA 302-3, 1F22h)."""
    number = lambda size: int.from_bytes(take(size), "little")
    place = 0

    def take(size):
        nonlocal place
        place += size
        return data[place - size : place]

    entries = []
    for _ in range(number(4)):
        index, sub = number(2), number(1)
        entries.append((index, sub, take(number(4))))
    same(place, len(data), "bytes of the concise DCF")
    return entries


def lely_accepts_our_eds(bench):
    for eds in (DRIVE_EDS, DRIVE_EDS.replace("drive", "switches")):
        same(tool(bench, "dcfchk", "-n", "3", eds), "", f"dcfchk of {eds}")


def lely_accepts_the_dcf_of_every_real_drive(bench):
    for config in sorted(Path("config/drives").glob("*.toml")):
        out = bench.folder / config.stem
        bench.frhc("export", "dcf", "--config", str(config), "--out", str(out))
        files = sorted(out.glob("*.dcf"))
        same(len(files), 7, f"DCF of {config}")
        for dcf in files:
            # A slip of a maker remains: a default of an integer like 0.0.
            done = subprocess.run([str(TOOLS / "dcfchk"), str(dcf)], capture_output=True, text=True, check=False)
            found = {line.split("Warning: ")[1] for line in done.stderr.splitlines() if "Warning: " in line}
            same(found - SLIPS, set(), f"dcfchk of {dcf.name} of {config}")
            check(found or done.returncode == 0, f"dcfchk of {dcf.name} of {config}: {done.stderr}")


def drives_are_booted_from_lelys_concise_dcf(bench):
    bus = HEADER + "".join(DRIVE.format(node=node, eds=DRIVE_EDS) for node in NODES)
    (bench.folder / "bus.yml").write_text(bus)
    tool(bench, "dcfgen", "-r", "bus.yml")
    network = bench.connect()
    drives = [network.add_node(node, DRIVE_EDS) for node in NODES]
    bench.sim = bench.start("sim", "--config", CONFIG)
    until(lambda: all(bench.sent(0x700 + node) for node in NODES), "six boot-ups")
    for drive in drives:
        entries = concise((bench.folder / f"joint_{drive.id}.bin").read_bytes())
        check(len(entries) > 20, f"{len(entries)} entries")
        for index, sub, value in entries:
            drive.sdo.download(index, sub, value)
        for index, sub, value in {(i, s): (i, s, v) for i, s, v in entries}.values():
            same(drive.sdo.upload(index, sub), value, f"{index:04X}h:{sub} read back")
    network.nmt.state = "OPERATIONAL"
    network.send_periodic(0x700 + 127, [5], 0.02)
    network.sync.start(0.002)
    before = {node: len(bench.sent(0x180 + node)) for node in NODES}
    time.sleep(0.1)
    network.sync.stop()
    for node in NODES:
        gained = bench.sent(0x180 + node)[before[node] :]
        check(45 <= len(gained) <= 51, f"TPDO 1 of node {node}: {len(gained)} in 0.1 s at 500 Hz")
        same({len(data) for _, data in gained}, {8}, "their length")


TESTS = [
    lely_accepts_our_eds,
    lely_accepts_the_dcf_of_every_real_drive,
    drives_are_booted_from_lelys_concise_dcf,
]
