"""Pictures of `frhc view` for README.md and docs: what a headless browser shows of `frhc demo --view`. scripts/pictures.sh calls it."""

import base64
import contextlib
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from browser import SOFTWARE_GL, Browser

FRHC = os.environ["FRHC"]
PAGE_TIMEOUT_S = 60
MAX_BYTES = 200_000
# Pixels of the picture in a px of the page.
SCALE = 1.5
PUMA = ["--robot", "config/robots/puma560.toml"]

# Cameras of a picture, from the side of the contact.
SIDE = "?robot-eye=-0.45,-1.65,0.85&robot-target=0.06,0.1,0.14"

# Name, width and height in px, dark, arguments of the demo, query of the page, and the condition in it.
PRESSED = "forces().sensed > 4 && forces().felt > 2.2"
PICTURES = [
    ("view", 1120, 564, False, PUMA, SIDE, PRESSED),
    ("view-stopped", 1000, 620, True, ["--scenario", "faults/unplug", "--speed", "0.3"], "", "document.querySelector('#banner').textContent.includes('elbow')"),
    ("view-phone", 375, 812, False, PUMA, SIDE, PRESSED),
]
FORCES = """
const force = (text) => Number((text.match(/: *([0-9.]+)/) || [0, 0])[1]);
const forces = () => ({sensed: force(document.querySelector('#robot-wrench').textContent), felt: force(document.querySelector('#hand-wrench').textContent)});
"""


@contextlib.contextmanager
def demo(arguments):
    """Starts a demo; gives the address of its page."""
    with tempfile.TemporaryDirectory() as runtime:
        command = [FRHC, "-q", "demo", "--view", "--listen", "127.0.0.1:0", *arguments]
        environment = {**os.environ, "XDG_RUNTIME_DIR": runtime}
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment) as process:
            try:
                yield next(found[0] for line in process.stderr if (found := re.search(r"http://\S+", line)))
            finally:
                process.terminate()


def picture(browser, address, width, height, is_dark, condition):
    """Returns the page as PNG once the condition holds."""
    browser.open_url(address, width, height, is_dark)
    browser.devtools("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=SCALE, mobile=False)
    end = time.monotonic() + PAGE_TIMEOUT_S
    while not browser.script(f"{FORCES} return Boolean({condition})"):
        if time.monotonic() > end:
            sys.exit(f"pictures: {condition} has not come: {browser.script('return document.body.innerText')[:400]}")
        time.sleep(0.02)
    return base64.b64decode(browser.devtools("Page.captureScreenshot", format="png")["data"])


def main():
    folder = Path(sys.argv[1])
    for name, width, height, is_dark, arguments, query, condition in PICTURES:
        with Browser(SOFTWARE_GL) as browser, demo(arguments) as address:
            content = picture(browser, address + query, width, height, is_dark, condition)
        if len(content) > MAX_BYTES:
            sys.exit(f"pictures: {name}: {len(content)} bytes, at most {MAX_BYTES}")
        (folder / f"{name}.png").write_bytes(content)
        print(f"{name}.png: {width} x {height} px, {len(content) // 1000} kB")


if __name__ == "__main__":
    main()
