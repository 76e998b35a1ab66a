"""Headless Chromium or Google Chrome, driven by the WebDriver protocol (W3C) over HTTP: pages of files, their errors and pictures.

    with Browser() as browser:
        browser.open(path, width=390, height=844, is_dark=True)
        assert browser.errors() == []
        path.with_suffix(".png").write_bytes(browser.screenshot())
"""

import base64
import contextlib
import json
import re
import shutil
import subprocess
import sys
import tempfile
import urllib.error
import urllib.request
from pathlib import Path

BROWSERS = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"]
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage", "--hide-scrollbars", "--force-device-scale-factor=1",
]
# WebGL without a graphics card, by SwiftShader; and none at all.
SOFTWARE_GL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
NO_GL = ["--disable-3d-apis"]
START_TIMEOUT_S = 60
COMMAND_TIMEOUT_S = 120


def version(program):
    """Returns the major version that a program prints; None without one."""
    try:
        said = subprocess.run([program, "--version"], capture_output=True, text=True, timeout=START_TIMEOUT_S).stdout
    except (OSError, subprocess.TimeoutExpired):
        return None
    found = re.search(r"(\d+)\.\d+\.\d+", said)
    return int(found[1]) if found else None


def installed():
    """Returns a browser and the driver of its version, as paths; None without such a pair."""
    driver = shutil.which("chromedriver")
    browsers = filter(None, map(shutil.which, BROWSERS))
    of_driver = driver and version(driver)
    return next(((browser, driver) for browser in browsers if of_driver and version(browser) == of_driver), None)


class WebDriverError(Exception):
    """The driver has refused a command: its error and message."""


class Browser:
    """A browser with a fresh profile and further flags; `with` ends it."""

    def __init__(self, flags=()):
        self.flags = flags

    def __enter__(self):
        with contextlib.ExitStack() as stack:
            pair = installed()
            if pair is None:
                raise WebDriverError("no browser with a chromedriver of its version (scripts/setup.sh browser)")
            browser, driver = pair
            profile = stack.enter_context(tempfile.TemporaryDirectory(prefix="frhc-browser-", ignore_cleanup_errors=True))
            # The driver prints the port that it has chosen.
            process = subprocess.Popen([driver, "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            stack.callback(ended, process)
            port = next((found[1] for line in process.stdout if (found := re.search(r"on port (\d+)\.", line))), None)
            self.url = f"http://127.0.0.1:{port}/session"
            flags = [*FLAGS, *self.flags, f"--user-data-dir={profile}"]
            options = {"goog:chromeOptions": {"binary": browser, "args": flags}, "goog:loggingPrefs": {"browser": "ALL"}}
            session = self.command("POST", "", capabilities={"alwaysMatch": options})
            self.version = session["capabilities"]["browserVersion"]
            self.url += "/" + session["sessionId"]
            stack.callback(self.command, "DELETE", "")
            self.rest = stack.pop_all()
        return self

    def __exit__(self, *_):
        self.rest.close()

    def command(self, method, path, **body):
        """Sends a command of WebDriver; returns its value."""
        content = json.dumps(body).encode() if method == "POST" else None
        request = urllib.request.Request(self.url + path, content, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=COMMAND_TIMEOUT_S) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as refused:
            value = json.load(refused)["value"]
            raise WebDriverError(f"{path or 'session'}: {value['error']}: {value['message'].splitlines()[0]}") from None

    def devtools(self, command, **params):
        """Sends a command of the DevTools protocol; returns its result."""
        return self.command("POST", "/goog/cdp/execute", cmd=command, params=params)

    def open(self, path, width=1280, height=900, is_dark=False, is_print=False):
        """Opens a file in a viewport of this size in px, and waits until it is loaded; its errors begin anew."""
        self.open_url(Path(path).resolve(strict=True).as_uri(), width, height, is_dark, is_print)

    def open_url(self, url, width=1280, height=900, is_dark=False, is_print=False):
        """Opens an address in the same way."""
        self.devtools("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if is_dark else "light"}
        self.devtools("Emulation.setEmulatedMedia", media="print" if is_print else "", features=[scheme])
        self.errors()
        self.command("POST", "/url", url=url)

    def errors(self):
        """Returns what the console was given since the last call, at level WARNING or above: failed requests are of it."""
        entries = self.command("POST", "/se/log", type="browser")
        return [entry["message"] for entry in entries if entry["level"] in ("WARNING", "SEVERE")]

    def script(self, text, *args):
        """Runs the body of a function in the page; returns what it returns."""
        return self.command("POST", "/execute/sync", script=text, args=args)

    def overflow(self):
        """Returns by how many px the page is wider than the viewport; a page that fits has 0."""
        return self.script("const page = document.documentElement; return Math.max(0, page.scrollWidth - window.innerWidth)")

    def screenshot(self, is_whole=False):
        """Returns the viewport, or the whole page, as PNG."""
        picture = self.devtools("Page.captureScreenshot", format="png", captureBeyondViewport=is_whole, **self.clip(is_whole))
        return base64.b64decode(picture["data"])

    def clip(self, is_whole):
        if not is_whole:
            return {}
        size = self.devtools("Page.getLayoutMetrics")["cssContentSize"]
        return {"clip": {**size, "scale": 1}}

    def pdf(self):
        """Returns the page as it is printed on A4, backgrounds left out, as PDF."""
        paper = {"paperWidth": 8.27, "paperHeight": 11.69, "printBackground": False}
        return base64.b64decode(self.devtools("Page.printToPDF", **paper)["data"])


def ended(process):
    """Ends the driver."""
    process.terminate()
    try:
        process.wait(START_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    process.stdout.close()


if __name__ == "__main__":
    if sys.argv[1:] != ["--which"]:
        sys.exit("usage: browser.py --which      (prints the browser and its driver; exit code 1 without them)")
    found = installed()
    print(*found or (), sep="\n")
    sys.exit(0 if found else 1)
