#!/usr/bin/env python3
"""drives_table.py: the table of docs/drives/README.md, by trying every drive of eds/drives.

usage: scripts/with_vcan.sh -v -t 600 -i vcan0 -- scripts/drives_table.py [--check]

For each data sheet: frhc check; where it is accepted, frhc sim and frhc run on vcan0, frhc ctl arm, and SIGTERM.
A drive has a configuration in config/drives, or else one of these with its own data sheet. FRHC_PROGRAM names the program;
by default target/dist/frhc. With --check, exits with 1 if the page has another table.
"""

import csv
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("FRHC_PROGRAM", str(ROOT / "target/dist/frhc"))
PAGE = ROOT / "docs/drives/README.md"

# Configuration of each drive; of all others, the usual one.
FILES = {
    "ingenia-eve-net-c": "ingenia_eve",
    "ingenia-eve-xcr-c": "ingenia_eve",
    "maxon-epos4": "maxon_epos4",
    "maxon-epos4-50-15": "maxon_epos4",
    "nanotec-cl4-e": "nanotec_cl4e",
    "technosoft-ipos": "technosoft_ipos",
}
USUAL = "elmo_gold"


def number(text, key):
    """The number of a key in [DeviceInfo]; 0 where it is blank."""
    found = re.search(rf"^{key}=(\S+)", text, re.MULTILINE)
    return int(found.group(1), 0) if found else 0


def configuration(slug, folder):
    """The file of a drive, with its own data sheet."""
    file = ROOT / f"config/drives/{FILES.get(slug, USUAL)}.toml"
    text = file.read_text()
    if f"/{slug}.eds" in text:
        return file
    sheet = (ROOT / f"eds/drives/{slug}.eds").read_text(errors="replace")
    text = re.sub(r"\.\./\.\./eds/drives/[\w-]+\.eds", str(ROOT / f"eds/drives/{slug}.eds"), text)
    text = text.replace("../../eds/", str(ROOT / "eds") + "/")
    head, switches = text.split("[switches]")
    for key, name in [("vendor_id", "VendorNumber"), ("product_code", "ProductNumber"), ("revision", "RevisionNumber")]:
        head = re.sub(rf"^{key} = .*", f"{key} = {number(sheet, name)}", head, flags=re.MULTILINE)
    path = pathlib.Path(folder) / f"{slug}.toml"
    path.write_text(head + "[switches]" + switches)
    return path


def reason(stderr):
    """The reasons of a refusal for the first joint, without file, line and joint."""
    reasons = []
    # Not the log, but the reasons of the exit code.
    for line in (line for line in stderr.splitlines() if re.match("frhc: (?!warning: )", line)):
        line = re.sub(r"^frhc: (\S+: )?", "", line)
        line = re.sub(r"^joint\[\d\]\.\w+: ", "", line)
        line = re.sub(r"^joint \d \(\w+\)(, node \d+)?: ", "", line)
        line = re.sub(r"^(joint|node)s \d(, \d)* and \d: ", "", line)
        if line not in reasons:
            reasons.append(line)
    return "; ".join(reasons[:2]).replace("|", "/")


def run(path, folder):
    """Simulates, arms and ends an arm on vcan0: what became of it."""
    own = {**os.environ, "XDG_RUNTIME_DIR": folder, "STATE_DIRECTORY": folder}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True, "env": own}
    sim = subprocess.Popen([PROGRAM, "-q", "sim", "--config", path], **quiet)
    node = subprocess.Popen([PROGRAM, "-q", "run", "--config", path], **quiet)
    armed = subprocess.run([PROGRAM, "ctl", "--wait=20", "arm"], capture_output=True, text=True, env=own)
    node.send_signal(signal.SIGTERM)
    ended = node.communicate(timeout=60)[1]
    words = []
    for joint in range(1, 7):
        read = subprocess.run([PROGRAM, "sdo", "-i", "vcan0", "read", str(joint), "0x6041", "u16"], capture_output=True, text=True)
        words.append(read.stdout.split()[-1] if read.returncode == 0 else "?")
    sim.send_signal(signal.SIGTERM)
    sim.communicate(timeout=60)
    if armed.returncode or node.returncode:
        return "refused: " + reason(ended or armed.stderr)
    in_fault = [word for word in words if word == "?" or int(word, 0) & 0x4F == 0x08]
    return "armed; a drive is in fault after SIGTERM" if in_fault else "armed; no drive in fault after SIGTERM"


def row(name, slug, folder):
    path = configuration(slug, folder)
    checked = subprocess.run([PROGRAM, "check", "--config", path, "--json"], capture_output=True, text=True)
    if checked.returncode:
        return [name, "–", "–", "–", "–", "–", "refused: " + reason(checked.stderr)]
    report = json.loads(checked.stdout)
    stops, force = report["stopping"][0]["stops_by"], report["stopping"][0]["max_force_n"]
    layout = re.search(r'^layout = "(.*)"', path.read_text(), re.MULTILINE).group(1)
    rate = f"{1_000_000 // report['sync_period_us']} Hz"
    load = f"{report['buses'][0]['load_percent']:.0f} %"
    return [name, layout, rate, load, f"{force:.1f} N", stops, run(path, folder)]


def main():
    with open(ROOT / "eds/drives/facts/devices.csv", newline="", encoding="utf-8") as file:
        devices = [(line["drive"], line["file"]) for line in csv.DictReader(file) if line["file"]]
    lines = ["| drive | layout | rate | load | force | stops by | result |", "|---|---|---|---|---|---|---|"]
    for name, file in devices:
        slug = file.removesuffix(".eds")
        with tempfile.TemporaryDirectory() as folder:
            cells = row(name, slug, folder)
        lines.append("| " + " | ".join(cells) + " |")
    table = "\n".join(lines)
    print(table)
    if "--check" in sys.argv and table not in PAGE.read_text():
        sys.exit(f"{PAGE.relative_to(ROOT)}: has another table")


main()
