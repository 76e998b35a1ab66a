"""`frhc report`, judged by what has no code of the program: numpy computes figures from bus.log alone, xmllint reads the page as XML, and a
browser shows it: light, dark, printed and as wide as a phone.
"""

import html
import os
import re
import struct
import subprocess
import tempfile
from pathlib import Path

import numpy

from browser import Browser
from sessions import recorded

FRHC = os.environ["FRHC"]
ENGAGED = 3
SYNC = "080#"
BIT_RATE = 1_000_000
LONGEST_CYCLE_S = 0.1
# Widths of a desktop, a tablet and a phone, in px.
WIDTHS = {"desktop": (1280, 900), "tablet": (768, 1024), "phone": (375, 812)}
PNG = b"\x89PNG\r\n\x1a\n"


def reported(session, *args):
    """Writes the report of a session; returns its path."""
    done = subprocess.run([FRHC, "report", str(session), *args], check=True, capture_output=True, text=True)
    return Path(done.stdout.strip())


def stopped(folder):
    """Records a session that a drive without power stops (exit code 6); returns its folder."""
    session = Path(folder) / "session"
    command = [FRHC, "-q", "demo", "--out", str(session), "--scenario", "faults/unplug", "--seconds", "4"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 6, done.stderr
    return session


def section(page, name):
    return page.split(f'<section id="{name}"')[1].split("</section>")[0]


def shown(page, name):
    """Returns the value of a name in the summary, without markup."""
    value = re.search(rf"<dt>{re.escape(name)}</dt><dd>(.*?)</dd>", section(page, "summary"))[1]
    return html.unescape(value)


def number(text):
    """Returns the number that a text begins with."""
    return float(re.match("[\u2212\u202f0-9.]+", text)[0].replace("\u2212", "-").replace("\u202f", ""))


def cycles_of(session):
    """Returns the time of SYNC, the mode and the force of each cycle in bus.log."""
    times, modes, forces = [], [], []
    sync = force = None
    for line in (session / "bus.log").read_text().splitlines():
        stamp, interface, frame = line.split(" ")[:3]
        if frame.startswith(SYNC):
            sync = sync or float(stamp.strip("()"))
        elif interface == "wrench0":
            data = bytes.fromhex(frame.split("##0")[1])
            force = struct.unpack("<6d", data)[:3]
        elif interface == "node0":
            times.append(sync or float(stamp.strip("()")))
            modes.append(int(frame.split("##0")[1][:2], 16))
            forces.append(force)
            sync = None
    return numpy.array(times), numpy.array(modes), numpy.array(forces)


def crc_of(bits):
    """Returns the 15 bits of CAN's checksum."""
    crc = 0
    for bit in bits:
        crc = (crc << 1 ^ (0x4599 if bit ^ crc >> 14 & 1 else 0)) & 0x7FFF
    return [crc >> place & 1 for place in range(14, -1, -1)]


def bits_of(identifier, data):
    """Returns the length of a classical frame on the wire, stuff bits and the space after it included."""
    bits = [0] + [identifier >> place & 1 for place in range(10, -1, -1)] + [0, 0, 0]
    bits += [len(data) >> place & 1 for place in range(3, -1, -1)]
    bits += [byte >> place & 1 for byte in data for place in range(7, -1, -1)]
    bits += crc_of(bits)
    stuffed, run, last = 0, 0, None
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            # The stuff bit begins the next run.
            stuffed, run, last = stuffed + 1, 1, 1 - bit
    # CRC delimiter, acknowledge, its delimiter, end of frame, interframe space.
    return len(bits) + stuffed + 3 + 7 + 3


def load_of(session):
    """Returns the load of vcan0 in the cycles, in percent, from SYNC to SYNC; a pause, as in a boot, is no cycle."""
    lengths, bits, seconds = {}, 0, 0.0
    pending, before, has_cycle = 0, None, False
    for line in (session / "bus.log").read_text().splitlines():
        stamp, interface, frame = line.split(" ")[:3]
        if interface == "node0":
            has_cycle = True
        if interface != "vcan0":
            continue
        at = float(stamp.strip("()"))
        if frame.startswith(SYNC):
            if has_cycle and before is not None and at - before < LONGEST_CYCLE_S:
                bits, seconds = bits + pending, seconds + at - before
            pending, before = 0, at
        if frame not in lengths:
            identifier, data = frame.split("#")
            lengths[frame] = bits_of(int(identifier, 16), bytes.fromhex(data))
        pending += lengths[frame]
    return 100 * bits / (seconds * BIT_RATE)


def numpy_finds_the_figures_of_a_report_in_the_log(_):
    with tempfile.TemporaryDirectory() as folder:
        session = recorded(folder, "--scenario", "contact_10s", "--seconds", "8")
        page = reported(session).read_text()
        times, modes, forces = cycles_of(session)
        is_engaged = modes == ENGAGED
        steps = numpy.diff(times, prepend=times[0])
        sizes = numpy.linalg.norm(forces[is_engaged], axis=1)
        figures = {
            "Engaged": steps[is_engaged].sum(),
            "Greatest force sensed": sizes.max(),
            "Force sensed, rms": numpy.sqrt((sizes ** 2).mean()),
            "Cycles": len(times),
            "Bus load, mean": load_of(session),
        }
        for name, expected in figures.items():
            found = number(shown(page, name).removeprefix("vcan0 "))
            assert abs(found - expected) <= 0.006 * abs(expected), f"{name}: {found}, numpy {expected}"
        assert figures["Greatest force sensed"] > 1.0, "the object has met the wall"


def reports_are_xml_and_load_nothing(_):
    with tempfile.TemporaryDirectory() as folder:
        whole = stopped(folder)
        record = next((whole / "faults").iterdir())
        for name, report in {
            "session": reported(whole),
            "record": reported(record),
            "comparison": reported(whole, "--compare", str(whole), "-o", str(whole / "comparison.html")),
        }.items():
            subprocess.run(["xmllint", "--noout", "--nonet", str(report)], check=True)
            text = report.read_text()
            loaded = re.findall(r"<script|<iframe|<img|<object|(?:src|href)=\"(?!#|data:,\")|url\(|@import", text)
            assert loaded == [], (name, loaded)


def browser_shows_reports_without_an_error_or_a_sideways_scroll(_):
    pictures = Path(os.environ.get("INTEROP_PICTURES", tempfile.mkdtemp()))
    pictures.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, Browser() as browser:
        whole = stopped(folder)
        record = next((whole / "faults").iterdir())
        compared = whole / "comparison.html"
        for name, report in {
            "session": reported(whole),
            "record": reported(record),
            "comparison": reported(whole, "--compare", str(whole), "-o", str(compared)),
        }.items():
            for device, (width, height) in WIDTHS.items():
                for is_dark in (False, True):
                    browser.open(report, width=width, height=height, is_dark=is_dark)
                    assert browser.errors() == [], (name, device)
                    assert browser.overflow() == 0, (name, device, browser.overflow())
                    # No text of a picture reaches beyond it.
                    cut = browser.script(
                        "return [...document.querySelectorAll('svg text')].filter(text => text.getClientRects().length).filter(text => {"
                        "const [inner, outer] = [text.getBoundingClientRect(), text.ownerSVGElement.getBoundingClientRect()];"
                        "return inner.left < outer.left - 1 || inner.right > outer.right + 1}).map(text => text.textContent)")
                    assert cut == [], (name, device, cut)
                    scheme = "dark" if is_dark else "light"
                    picture = browser.screenshot(is_whole=True)
                    assert picture.startswith(PNG)
                    (pictures / f"{name}-{device}-{scheme}.png").write_bytes(picture)
                    ground = browser.script("return getComputedStyle(document.body).backgroundColor")
                    brightness = sum(map(int, re.findall(r"\d+", ground)[:3]))
                    assert brightness < 200 if is_dark else brightness > 600, (scheme, ground)
            browser.open(report, width=1280, height=900)
            printed = browser.pdf()
            assert printed.startswith(b"%PDF"), name
            (pictures / f"{name}.pdf").write_bytes(printed)


TESTS = [
    numpy_finds_the_figures_of_a_report_in_the_log,
    reports_are_xml_and_load_nothing,
    browser_shows_reports_without_an_error_or_a_sideways_scroll,
]
