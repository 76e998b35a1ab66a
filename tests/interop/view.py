"""`frhc view` in a headless browser, with software GL, at the feed of telemetry_feed.py: what a page must survive, and how fast it draws.

INTEROP_PICTURES=DIR keeps the pictures.
"""

import contextlib
import json
import os
import subprocess
import tempfile
import time
import urllib.error
import urllib.request
from pathlib import Path

import machine
import telemetry_feed
from browser import NO_GL, SOFTWARE_GL, Browser
from telemetry_feed import Feed, Motion, description, hostile

FRHC = os.environ["FRHC"]
PAGE_TIMEOUT_S = 30
WIDTHS = {"desktop": (1280, 720), "phone": (375, 812)}
MAX_WIRE_BYTES = 250_000
MIN_FPS = 30
MAX_FIRST_PICTURE_MS = 1000


@contextlib.contextmanager
def page(folder):
    """Starts `frhc view`; gives its address and the socket at which it looks for a node."""
    node = Path(folder) / "telemetry.sock"
    command = [FRHC, "view", "--listen", "127.0.0.1:0", "--socket", str(node)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().strip(), node
        finally:
            process.terminate()
    assert process.returncode == 0, process.returncode


def until(browser, condition, what):
    """Waits until an expression of the page is true."""
    end = time.monotonic() + PAGE_TIMEOUT_S
    while not browser.script(f"return Boolean({condition})"):
        assert time.monotonic() < end, f"{what}: {browser.script('return document.body.innerText')[:600]}"
        time.sleep(0.05)


def drawn(browser):
    until(browser, "document.documentElement.dataset.first_picture_ms && document.querySelectorAll('#joints tbody td').length", "a picture")


def text_of(browser, selector):
    return browser.script("return document.querySelector(arguments[0]).textContent", selector)


def faults(browser):
    """Returns what the console was given, but for the driver's remarks on speed."""
    return [entry for entry in browser.errors() if "GL Driver Message" not in entry]


def is_sound(browser, name):
    assert faults(browser) == [], name
    assert browser.overflow() == 0, (name, browser.overflow())
    assert browser.script("return document.getElementById('fault').hidden"), text_of(browser, "#fault")


def picture(browser, name):
    folder = os.environ.get("INTEROP_PICTURES")
    if folder:
        Path(folder).mkdir(parents=True, exist_ok=True)
        (Path(folder) / f"view-{name}.png").write_bytes(browser.screenshot(is_whole=True))


def view_draws_arm_and_robot_in_both_schemes_and_widths(_):
    with tempfile.TemporaryDirectory() as folder, page(folder) as (url, node), Feed(node, Motion(description())), Browser(SOFTWARE_GL) as browser:
        for device, (width, height) in WIDTHS.items():
            for is_dark in (False, True):
                with machine.Others() as others:
                    browser.open_url(url, width, height, is_dark)
                    drawn(browser)
                first = float(browser.script("return document.documentElement.dataset.first_picture_ms"))
                machine.judge(first < MAX_FIRST_PICTURE_MS, f"first picture after {first} ms", others)
                until(browser, "document.getElementById('mode').textContent == 'Engaged'", "the mode")
                until(browser, "document.documentElement.dataset.fps", "pictures a second")
                scheme = "dark" if is_dark else "light"
                is_sound(browser, (device, scheme))
                picture(browser, f"{device}-{scheme}")
                camera = json.loads(browser.script("return document.getElementById('hand-view').dataset.camera"))
                assert set(camera) == {"eye", "target", "up", "fov_y_deg", "width", "height"}, camera
                assert "Felt at the grip" in text_of(browser, "#hand-wrench")


def view_is_fast_enough_and_light(_):
    with tempfile.TemporaryDirectory() as folder, page(folder) as (url, node), Feed(node, Motion(description())), Browser(SOFTWARE_GL) as browser:
        browser.open_url(url, 1280, 720)
        drawn(browser)
        sizes = browser.script("return performance.getEntriesByType('resource').filter(e => !e.name.endsWith('/feed')).map(e => e.transferSize)")
        wire = sum(sizes) + browser.script("return performance.getEntriesByType('navigation')[0].transferSize")
        assert 10_000 < wire <= MAX_WIRE_BYTES, f"{wire} bytes"
        rates = []
        with machine.Others() as others:
            while len(rates) < 4:
                time.sleep(1.1)
                rates.append(float(browser.script("return document.documentElement.dataset.fps ?? 0")))
        first = browser.script("return document.documentElement.dataset.first_picture_ms")
        rate = sorted(rates[1:])[1]
        print(f"  {rate:.0f} pictures a second at 1280 x 720 with software GL; first after {first} ms; {wire / 1000:.0f} kB", flush=True)
        machine.judge(rate >= MIN_FPS, f"{rates} pictures a second", others)
        is_sound(browser, "speed")


def view_shows_hostile_names_as_text(_):
    described = hostile(description())
    with tempfile.TemporaryDirectory() as folder, page(folder) as (url, node), Feed(node, Motion(described)), Browser(SOFTWARE_GL) as browser:
        for device, (width, height) in WIDTHS.items():
            browser.open_url(url, width, height)
            drawn(browser)
            names = browser.script("return [...document.querySelectorAll('#joints bdi')].map(name => name.textContent)")
            assert names[0] == telemetry_feed.HOSTILE[0] and names[3].startswith("aaaa"), names
            assert "\u202e" not in "".join(names) and "\x1b" not in "".join(names), names
            assert browser.script("return document.querySelectorAll('main img, main script').length") == 0
            is_sound(browser, device)
            picture(browser, f"hostile-{device}")


def without_numbers(value):
    """Returns a line with null for every number, and for the version as it is."""
    if isinstance(value, dict):
        return {key: part if key in ("version", "kind") else without_numbers(part) for key, part in value.items()}
    if isinstance(value, list):
        return [without_numbers(part) for part in value]
    return None if isinstance(value, (int, float)) and not isinstance(value, bool) else value


def view_survives_null_numbers_and_missing_keys(_):
    motion = Motion(description())
    snapshot, mode = motion.snapshot(50), motion.mode(50)
    bare = {"version": 1}
    odd = [[], "x", {}, None, [None], {"name": None}, -1]
    cases = [
        [motion.described, mode, without_numbers(snapshot)],
        [without_numbers(motion.described), without_numbers(mode), without_numbers(snapshot)],
        [{**bare, "kind": "description"}, {**bare, "kind": "mode"}, {**bare, "kind": "snapshot"}],
        *([*(dict(line, **{key: value for key in line if key not in bare and key != "kind"}) for line in (motion.described, mode, snapshot))] for value in odd),
    ]
    for count in (7, 8, 9):
        robot = {**motion.described["robot"], "joints": (motion.described["robot"]["joints"] * 2)[:count]}
        cases.append([{**motion.described, "robot": robot}, mode, {**snapshot, "q_r": [0.1] * count}])
    with tempfile.TemporaryDirectory() as folder, page(folder) as (url, node), Feed(node) as feed, Browser(SOFTWARE_GL) as browser:
        browser.open_url(url)
        for number, lines in enumerate(cases):
            # The last line says that those before have come.
            done = {**motion.snapshot(0), "cycle": 1000 + number}
            feed.show(motion.described, mode, *lines, motion.described, done)
            until(browser, f"document.documentElement.dataset.cycle == {1000 + number}", f"case {number}")
            feed.show(*lines)
            time.sleep(0.3)
            is_sound(browser, number)
        feed.show(motion.described, mode, without_numbers(snapshot))
        until(browser, "document.querySelector('#joints td').textContent == '–'", "dashes")


def view_says_why_there_is_no_picture_without_webgl(_):
    with tempfile.TemporaryDirectory() as folder, page(folder) as (url, node), Feed(node, Motion(description())), Browser(NO_GL) as browser:
        browser.open_url(url)
        drawn(browser)
        assert "no WebGL" in text_of(browser, "#hand-absent") and "no WebGL" in text_of(browser, "#robot-absent")
        until(browser, "document.getElementById('mode').textContent == 'Engaged'", "the mode")
        until(browser, "document.querySelector('#joints td').textContent.includes('rad')", "positions")
        is_sound(browser, "no WebGL")
        picture(browser, "no-webgl")


def view_says_that_there_is_no_node_and_connects_when_one_comes(_):
    with tempfile.TemporaryDirectory() as folder, page(folder) as (url, node), Browser(SOFTWARE_GL) as browser:
        browser.open_url(url)
        until(browser, "document.getElementById('mode-text').textContent.includes('No node offers')", "the reason")
        picture(browser, "no-node")
        with Feed(node, Motion(description(), stop_at=0.0)):
            until(browser, "document.getElementById('mode').textContent == 'Drives off'", "the stop")
            assert telemetry_feed.STOP in text_of(browser, "#cause")
            assert browser.script("return document.querySelectorAll('#way-out li').length") == len(telemetry_feed.WAY_OUT)
            assert "elbow" in text_of(browser, "#not-off")
            picture(browser, "stopped")
        until(browser, "document.getElementById('mode').textContent.startsWith('No data since')", "the end of the node")
        with Feed(node) as feed:
            feed.show({**description(), "version": 2})
            until(browser, "document.getElementById('mode-text').textContent.includes('version 2')", "the other version")
        is_sound(browser, "no node")


def view_answers_no_other_host(_):
    with tempfile.TemporaryDirectory() as folder, page(folder) as (url, _node):
        request = urllib.request.Request(f"{url}feed", headers={"Host": "evil.example"})
        try:
            urllib.request.urlopen(request, timeout=PAGE_TIMEOUT_S)
        except urllib.error.HTTPError as refused:
            assert refused.code == 403, refused.code
        else:
            raise AssertionError("answered")


TESTS = [
    view_draws_arm_and_robot_in_both_schemes_and_widths,
    view_shows_hostile_names_as_text,
    view_survives_null_numbers_and_missing_keys,
    view_says_why_there_is_no_picture_without_webgl,
    view_says_that_there_is_no_node_and_connects_when_one_comes,
    view_answers_no_other_host,
]
TIMED = [machine.tried(view_is_fast_enough_and_light)]
