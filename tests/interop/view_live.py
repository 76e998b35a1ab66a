"""How fast `frhc view` passes a feed on, and `frhc demo --view` with its own node, in headless Chromium."""

import contextlib
import json
import os
import re
import signal
import subprocess
import tempfile
import threading
import time

import numpy as np

import machine
from browser import SOFTWARE_GL, Browser
from telemetry_feed import ROOT, Feed, Motion, description
from view import FRHC, drawn, faults, is_sound, page, text_of, until

SNAPSHOTS = 500
MAX_FEED_TO_PAGE_MS = 50
FELT_N = 2.0
END_TIMEOUT_S = 1.0
ROBOTS = ["puma560", "eight_r_synthetic"]

# A listener of its own, so that no code of the page is trusted: time of sending and of arrival, both of the wall clock, in ms.
LISTENER = """
window.arrivals = [];
new EventSource("feed").addEventListener("snapshot", (event) => {
  window.arrivals.push([JSON.parse(event.data).at_us / 1000, performance.timeOrigin + performance.now()]);
});
"""


class StampedMotion(Motion):
    """A motion whose snapshots have the time at which they are made."""

    def snapshot(self, number):
        start_us = time.time_ns() // 1000
        return {**super().snapshot(number), "at_us": start_us}


def view_passes_snapshots_on_within_its_limit(_):
    with tempfile.TemporaryDirectory() as folder, page(folder) as (url, node), Feed(node, StampedMotion(description())), Browser(SOFTWARE_GL) as browser:
        browser.open_url(url, 1280, 720)
        drawn(browser)
        browser.script(LISTENER)
        with machine.Others() as others:
            until(browser, f"window.arrivals.length >= {SNAPSHOTS}", "the snapshots")
        ages = np.diff(browser.script("return window.arrivals"), axis=1)
        p50, p99 = np.percentile(ages, [50, 99])
        shown_ms = float(browser.script("return document.documentElement.dataset.age_ms"))
        print(f"  {len(ages)} snapshots from the feed to the page: median {p50:.1f} ms, p99 {p99:.1f} ms, at most {ages.max():.1f} ms; "
              f"the newest drawn {shown_ms:.1f} ms after it came", flush=True)
        assert ages.min() > 0, "the clocks differ"
        machine.judge(p99 <= MAX_FEED_TO_PAGE_MS, f"p99 {p99:.1f} ms", others)
        is_sound(browser, "latency")


class Demo:
    """A `frhc demo --view` with a folder of its own for its sockets; `with` ends it."""

    def __init__(self, robot):
        self.robot = robot

    def __enter__(self):
        with contextlib.ExitStack() as stack:
            runtime = stack.enter_context(tempfile.TemporaryDirectory())
            command = [FRHC, "demo", "--view", "--listen", "127.0.0.1:0", "--robot", str(ROOT / f"config/robots/{self.robot}.toml")]
            environment = {**os.environ, "XDG_RUNTIME_DIR": runtime}
            self.process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            stack.callback(self.kill)
            self.url = next((found[1] for line in self.process.stderr if (found := re.search(r"look at (http://\S+/)", line))), None)
            assert self.url, f"{command} prints no address"
            # What it prints later must not block it.
            threading.Thread(target=self.process.stderr.read, daemon=True).start()
            self.rest = stack.pop_all()
        return self

    def __exit__(self, *_):
        self.rest.close()

    def kill(self):
        self.process.kill()
        self.process.wait()

    def interrupt(self):
        """Sends Ctrl-C; returns the exit code and the seconds until the end."""
        start = time.monotonic()
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(10 * END_TIMEOUT_S), time.monotonic() - start


def name_of(robot):
    """Returns the name of a robot in its file."""
    return re.search(r'^name = "(.+)"', (ROOT / f"config/robots/{robot}.toml").read_text(), re.MULTILINE)[1]


def demo_shows_contact_in_its_page_and_ends_with_ctrl_c(_):
    with Demo(ROBOTS[0]) as demo, Browser(SOFTWARE_GL) as browser:
        browser.open_url(demo.url)
        drawn(browser)
        until(browser, "document.getElementById('mode').textContent === 'Engaged'", "engaged")
        newtons = "parseFloat(document.getElementById('hand-label').textContent)"
        is_felt = f"!document.getElementById('hand-label').hidden && {newtons} > {FELT_N} && !document.getElementById('robot-label').hidden"
        until(browser, is_felt, "contact")
        assert name_of(ROBOTS[0]) in text_of(browser, "#robot-note")
        is_sound(browser, "demo")
        code, seconds = demo.interrupt()
        assert code == 130 and seconds <= END_TIMEOUT_S, (code, seconds)
        until(browser, "document.getElementById('mode').textContent.startsWith('No data since')", "the end of the data")
        # The server has gone with the node: the console says so, too.
        faults(browser)
        print(f"  Ctrl-C ends the demo within {seconds:.2f} s", flush=True)


def demos_at_once_show_their_own_node_each(_):
    with Demo(ROBOTS[0]) as first, Demo(ROBOTS[1]) as second, Browser(SOFTWARE_GL) as browser:
        assert first.url != second.url
        for demo in (first, second, first):
            browser.open_url(demo.url)
            drawn(browser)
            note = text_of(browser, "#robot-note")
            shown = [name_of(robot) in note for robot in ROBOTS]
            assert shown == [robot == demo.robot for robot in ROBOTS], (demo.robot, note)
            camera = json.loads(browser.script("return document.getElementById('robot-view').dataset.camera"))
            assert camera["width"] > 100, camera
            is_sound(browser, demo.robot)
        assert first.interrupt()[0] == 130
        browser.open_url(second.url)
        drawn(browser)
        is_sound(browser, "the other goes on")
        assert second.interrupt()[0] == 130


TESTS = [demo_shows_contact_in_its_page_and_ends_with_ctrl_c, demos_at_once_show_their_own_node_each]
TIMED = [machine.tried(view_passes_snapshots_on_within_its_limit)]
