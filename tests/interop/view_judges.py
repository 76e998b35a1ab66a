"""Geometry of `frhc view`: discs and arrows found in screenshots of headless Chromium, against pinocchio through the stated camera.

The descriptions come from `frhc demo`, the arms of pinocchio from the files. A page with a fault put into its script must fail.
"""

import contextlib
import json
import math
import os
import socket
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import pinocchio as pin

from arms import Arm, pose
from browser import SOFTWARE_GL, Browser
from mutant_page import mutated
from screens import shot
from telemetry_feed import ROOT, Feed, Motion, description
from view import FRHC, PAGE_TIMEOUT_S, is_sound, page, until

POSTURES = 20
SEED = 1997
TOLERANCE_PX = 2.0
TOLERANCE_DEG = 1.0
SCALES = {"hand": 0.04, "robot": 0.02}  # m/N, of docs/view.md
MIN_FORCE = 0.05  # N
MAX_PASSES = 5  # of the hand controller jpl_like, five markers are at one place
TEXT_TIMEOUT_S = 2
VIEWPORT = (1280, 900)

# Configuration, robot, cameras in the address, device pixel ratio. Without cameras, the page's own are judged.
STATED = "hand-eye=-0.9,-1.5,1.1&hand-target=0.1,0,0.1&robot-eye=1.6,2.2,1.4&robot-target=0.1,0,0.1"
ARMS = [
    ("kraft_like", "puma560", "", 1),
    ("jpl_like", "eight_r_synthetic", STATED, 1),
    ("sixr_spherical", None, "hand-eye=1.2,0.9,-0.4&hand-target=0.1,0,0.1&robot-eye=0.1,-0.6,0.9&robot-target=0.4,0,0.3", 2),
]


def described_by_a_demo(configuration, robot):
    """Returns the description that `frhc demo` sends with these files."""
    with tempfile.TemporaryDirectory() as folder:
        node = Path(folder) / "telemetry.sock"
        command = [FRHC, "demo", "--realtime", "--seconds", "60", "--quiet", "--config", str(ROOT / f"config/{configuration}.toml"), "--telemetry", str(node)]
        command += ["--robot", str(ROOT / f"config/robots/{robot}.toml")] if robot else []
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process, socket.socket(socket.AF_UNIX) as reader:
            try:
                end = time.monotonic() + PAGE_TIMEOUT_S
                while reader.connect_ex(str(node)):
                    assert process.poll() is None and time.monotonic() < end, f"no telemetry of {command}"
                    time.sleep(0.01)
                return json.loads(reader.makefile().readline())
            finally:
                process.terminate()


def open_with(browser, url, address, ratio=1):
    """Opens the page with parameters, at a device pixel ratio."""
    browser.open_url("about:blank", *VIEWPORT)
    browser.devtools("Emulation.setDeviceMetricsOverride", width=VIEWPORT[0], height=VIEWPORT[1], deviceScaleFactor=ratio, mobile=False)
    browser.command("POST", "/url", url=f"{url}?{address}")


class Case:
    """A posture with its wrenches: what the node reports of it, and where pinocchio puts the markers and arrows."""

    def __init__(self, arms, described, random, force=None):
        hand, robot = arms
        self.q = hand.posture(random)
        links, self.x_0_g = hand.links(self.q)
        self.q_r, robot_links, self.x_b_m = None, [], pin.SE3(pin.rpy.rpyToMatrix(random.uniform(-1, 1, 3)), np.array([0.4, 0, 0.3]) + random.uniform(-0.05, 0.05, 3))
        if robot:
            self.q_r = robot.posture(random)
            robot_links, self.x_b_m = robot.links(self.q_r)
        self.points = {
            "hand": {**{f"joint-{number}": link.translation for number, link in enumerate(links, 1)}, "grip": self.x_0_g.translation},
            "robot": {**{f"joint-{number}": link.translation for number, link in enumerate(robot_links, 1)}, "mrf": self.x_b_m.translation},
        }
        sizes = random.uniform(0.2, 12.0, 2) if force is None else [force, force]
        self.f_g, self.f_s = (size * direction(random) for size in sizes)
        x_b_s = self.x_b_m * from_pose(described["x_m_s"])
        self.arrows = {
            "hand": ends("felt", self.x_0_g, self.f_g, SCALES["hand"]),
            "robot": ends("sensed", x_b_s, self.f_s, SCALES["robot"]),
        }

    def snapshot(self, described, number):
        """Returns a snapshot of this posture, whose cycle is `number`."""
        moments = [0.1, -0.2, 0.3]
        values = {
            "cycle": number, "q": self.q.tolist(), "q_r": None if self.q_r is None else self.q_r.tolist(), "x_0_g": pose(self.x_0_g), "x_b_m": pose(self.x_b_m),
            "f_g": [*self.f_g.tolist(), *moments], "f_s": [*self.f_s.tolist(), *moments],
        }
        return {**Motion(description()).snapshot(0), **values}


def direction(random):
    """Returns a random direction."""
    raw = random.normal(size=3)
    return raw / np.linalg.norm(raw)


def from_pose(described):
    """Returns a pose of the telemetry as pinocchio has it."""
    w, x, y, z = described["quaternion"]
    return pin.SE3(pin.Quaternion(w, x, y, z).matrix(), np.array(described["position"]))


def ends(name, frame, force, scale):
    """Returns where an arrow's discs are, for a force in N that is written in its frame."""
    return {f"{name}-tip": frame.translation + scale * (frame.rotation @ force), f"{name}-tail": frame.translation}


class Judge:
    """A page, and the feed that it shows."""

    def __init__(self, browser, feed, url, described, arms):
        self.browser, self.feed, self.url, self.described, self.arms = browser, feed, url, described, arms
        self.number = 0

    def show(self, case):
        """Sends a posture; returns once the page has drawn it."""
        self.number += 1
        mode = {**Motion(description()).mode(0), "cycle": self.number}
        self.feed.show(self.described, mode, case.snapshot(self.described, self.number))
        end = time.monotonic() + PAGE_TIMEOUT_S
        while self.browser.script("return document.documentElement.dataset.cycle") != str(self.number):
            assert time.monotonic() < end, f"posture {self.number} is not drawn"

    def pictured(self, case):
        """Shows a posture, and returns its picture; again where the machine was so busy that the page has no data for a second by then."""
        end = time.monotonic() + PAGE_TIMEOUT_S
        while True:
            self.show(case)
            picture = shot(self.browser)
            if not self.browser.script("return document.documentElement.classList.contains('is-away')"):
                return picture
            assert time.monotonic() < end, f"posture {self.number} is not drawn in time for its picture"

    def open(self, case, address, ratio=1):
        """Opens the page with a posture, which a camera without a stated place is fitted to."""
        self.show_to_come(case)
        open_with(self.browser, self.url, address, ratio)
        until(self.browser, f"document.documentElement.dataset.cycle == {self.number}", "the first posture")

    def show_to_come(self, case):
        self.number += 1
        self.feed.show(self.described, Motion(description()).mode(0), case.snapshot(self.described, self.number))

    def cases(self, count, random, points, force=None):
        """Returns this many random postures whose points are in the pictures of the cameras that the page states."""
        cameras = {view: shot(self.browser).of(view).camera for view in SCALES}
        chosen, tried = [], 0
        while len(chosen) < count:
            tried += 1
            assert tried < 60 * count, "the cameras see too few postures"
            case = Case(self.arms, self.described, random, force)
            with contextlib.suppress(AssertionError):
                if all(cameras[view].has(point) for view, named in points(case).items() for point in named.values()):
                    chosen.append(case)
        return chosen

    def markers(self, address, ratio, count=POSTURES):
        """Judges all markers in random postures; returns the distances in px and how many places were hidden at the first pass.

        Where later markers hide one by prediction, it is judged in a further pass, without those that are done.
        """
        random = np.random.default_rng(SEED)
        first = Case(self.arms, self.described, random)
        self.open(first, f"{address}&markers=1", ratio)
        cases = self.cases(count, random, lambda case: case.points)
        left = [{view: dict(named) for view, named in case.points.items()} for case in cases]
        distances, hidden = [], None
        for _ in range(MAX_PASSES):
            names = {name for posture in left for named in posture.values() for name in named}
            if not names:
                break
            self.open(first, f"{address}&markers={','.join(sorted(names))}", ratio)
            for case, posture in zip(cases, left):
                if any(posture.values()):
                    distances += self.seen(self.pictured(case), case, posture, names)
            hidden = sum(len(named) for posture in left for named in posture.values()) if hidden is None else hidden
        assert not any(named for posture in left for named in posture.values()), f"never seen: {left}"
        return np.array(distances), hidden

    def seen(self, picture, case, posture, names):
        """Returns the distances of those that are seen; they leave `posture`."""
        distances = []
        for view, named in case.points.items():
            shown = {name: point for name, point in named.items() if name in names}
            for name, distance in picture.of(view).distances(shown).items():
                if distance is not None and name in posture[view]:
                    assert distance <= TOLERANCE_PX, f"{view}, {name}: {distance:.2f} px off at q = {case.q}, {case.q_r}"
                    del posture[view][name]
                    distances.append(distance)
        return distances

    def wrenches(self, address, ratio, count=POSTURES):
        """Judges arrows of random wrenches; returns distances in px of their ends and angles in degrees, of those longer than 40 px."""
        random = np.random.default_rng(SEED + 1)
        self.open(Case(self.arms, self.described, random), f"{address}&markers=felt,sensed", ratio)
        distances, angles = [], []
        for case in self.cases(count, random, lambda case: case.arrows):
            picture = self.pictured(case)
            for view, named in case.arrows.items():
                distance, angle = arrow_errors(picture.of(view), named)
                distances += distance
                angles += angle
        for force in (0.9 * MIN_FORCE, 0.0):
            picture = self.pictured(self.cases(1, random, lambda case: case.arrows, force)[0])
            for view, name in (("hand", "felt"), ("robot", "sensed")):
                for part in ("", "-tip", "-tail"):
                    assert picture.of(view).found(name + part).size == 0, f"an arrow of {force} N in {view}"
        return np.array(distances), np.array(angles)

    def labels(self, address, count):
        """Judges the numbers in N at the arrows and below the pictures."""
        random = np.random.default_rng(SEED + 2)
        self.open(Case(self.arms, self.described, random), address)
        cases = self.cases(count, random, lambda case: case.arrows)
        for case in cases:
            self.show(case)
            for view, force in (("hand", case.f_g), ("robot", case.f_s)):
                size = np.linalg.norm(force)
                newtons = f"{size:.{2 if size < 10 else 1}f}\u202fN"
                wanted = f"document.getElementById('{view}-label').textContent === '{newtons}' && !document.getElementById('{view}-label').hidden"
                self.soon(wanted, f"label of {newtons}", lambda: self.show(case))
                self.soon(f"document.getElementById('{view}-wrench').textContent.includes('{size:.2f}\u202fN')", f"line of {newtons}")
                scale = f"arrow {1000 * SCALES[view]:.0f}\u202fmm/N"
                assert scale in self.browser.script(f"return document.getElementById('{view}-wrench').textContent"), scale
        self.show(self.cases(1, random, lambda case: case.arrows, 0.9 * MIN_FORCE)[0])
        self.soon("document.getElementById('hand-label').hidden && document.getElementById('robot-label').hidden", "no label")

    def soon(self, condition, what, again=lambda: None):
        """Waits for a text, which the page writes up to ten times a second; that at an arrow, when it draws one."""
        end = time.monotonic() + TEXT_TIMEOUT_S
        while not self.browser.script(f"return Boolean({condition})"):
            assert time.monotonic() < end, what
            again()


def arrow_errors(canvas, named):
    """Returns how far both ends of an arrow are from their places, in px, and the angle between; fails where they are too far."""
    distances = canvas.distances(named)
    seen = [distance for distance in distances.values() if distance is not None]
    assert seen and max(seen) <= TOLERANCE_PX, f"{distances} px off"
    if None in distances.values():
        return seen, []
    tip, tail = ([canvas.found(name).mean(axis=0), canvas.camera.project(point)] for name, point in named.items())
    found, wanted = (at - start for at, start in zip(tip, tail))
    size = np.linalg.norm(wanted) / canvas.camera.ratio
    if size < 40:
        return seen, []
    angle = math.degrees(abs(math.atan2(found[0] * wanted[1] - found[1] * wanted[0], found @ wanted)))
    assert angle <= TOLERANCE_DEG or math.radians(angle) * size <= TOLERANCE_PX, f"arrow turned by {angle:.2f}°"
    assert abs(np.linalg.norm(found) / canvas.camera.ratio - size) <= TOLERANCE_PX, "length of the arrow"
    return seen, [angle]


def turned(described):
    """Returns a description whose sensor is shifted and turned, so that {S} is not {MRF}."""
    x_m_s = pin.SE3(pin.rpy.rpyToMatrix(0.4, -0.7, 1.9), np.array([0.02, -0.03, -0.05]))
    return {**described, "x_m_s": pose(x_m_s)}


@contextlib.contextmanager
def judge(browser, configuration, robot, faults=()):
    """Gives the judge of a page that shows the arms of a demo, with faults put into its script."""
    described = described_by_a_demo(configuration, robot)
    arms = Arm(ROOT / f"config/{configuration}.toml"), Arm(ROOT / f"config/robots/{robot}.toml") if robot else None
    sensor = from_pose(described["x_m_s"])
    assert np.allclose(sensor.homogeneous, arms[0].sensor.homogeneous, atol=1e-12), "the sensor's place in the description"
    with tempfile.TemporaryDirectory() as folder, page(folder) as (url, node), Feed(node) as feed:
        yield Judge(browser, feed, url, turned(described), arms)


def view_draws_joints_where_pinocchio_has_them(_):
    with Browser(SOFTWARE_GL) as browser:
        for configuration, robot, address, ratio in ARMS:
            with judge(browser, configuration, robot) as page_judge:
                distances, hidden = page_judge.markers(address, ratio)
                is_sound(browser, configuration)
            arms = " and ".join(filter(None, (configuration, robot)))
            print(f"  {arms}, {ratio} px/px: {len(distances)} markers in {POSTURES} postures, median {np.median(distances):.2f} px off, "
                  f"at most {distances.max():.2f}; {hidden} of them hidden by others at the first pass", flush=True)


def view_draws_wrenches_as_their_arrows(_):
    with Browser(SOFTWARE_GL) as browser:
        for configuration, robot, address, ratio in ARMS:
            with judge(browser, configuration, robot) as page_judge:
                distances, angles = page_judge.wrenches(address, ratio)
                page_judge.labels(address, 3)
                is_sound(browser, configuration)
            print(f"  {configuration}: {len(distances)} ends of arrows at most {distances.max():.2f} px off, {len(angles)} directions at most "
                  f"{angles.max():.2f}° off", flush=True)


# Faults that a page may have, as texts of its scripts and what replaces them; each is seen by the judge named.
FAULTS = [
    ("markers", "kinematics.js", "multiply(rotationX(joint.alpha), translation([joint.a, 0, 0]))", "multiply(rotationX(-joint.alpha), translation([joint.a, 0, 0]))"),
    ("markers", "kinematics.js", "multiply(rotationX(joint.alpha), translation([joint.a, 0, 0]))", "rotationX(joint.alpha)"),
    ("markers", "kinematics.js", "[joint.theta + q, joint.d]", "[q, joint.d]"),
    ("markers", "kinematics.js", "[joint.theta + q, joint.d]", "[joint.theta - q, joint.d]"),
    ("markers", "robot_scene.js", "links(this.joints, q, this.x_b_0)", "links(this.joints, q)"),
    ("markers", "hand_scene.js", "multiply(this.poses.at(-1), this.x_6_g)", "this.poses.at(-1).slice()"),
    ("markers", "camera.js", "fov_y_deg: FOV_Y_DEG,", "fov_y_deg: FOV_Y_DEG + 1,"),
    ("wrenches", "arrows.js", "scale(turned(frame, acting.force), metresPerNewton)", "scale(acting.force, metresPerNewton)"),
    ("wrenches", "arrows.js", "scale(turned(frame, acting.force), metresPerNewton)", "scale(turned(frame, acting.force), -metresPerNewton)"),
    ("wrenches", "arrows.js", "scale(turned(frame, acting.force), metresPerNewton)", "scale(turned(frame, acting.force), 1.2 * metresPerNewton)"),
    ("wrenches", "arrows.js", "force: six.slice(0, 3)", "force: six.slice(3)"),
    ("wrenches", "arrows.js", "newtons < MIN_FORCE", "newtons < 0"),
    ("wrenches", "robot_scene.js", "multiply(this.x_b_m, this.x_m_s)", "this.x_b_m"),
    ("labels", "arrows.js", "const newtons = length(acting.force);", "const newtons = 1.05 * length(acting.force);"),
]

# What the judges say of a picture, not of a page that does not draw.
REASONS = ["px off", "is not in the picture", "arrow", "label of"]
PRISMATIC_FAULTS = [("markers", "kinematics.js", "[joint.theta, joint.d + q]", "[joint.theta, joint.d]")]


def view_with_faults_in_its_scripts_fails_its_judges(_):
    judged = {"markers": lambda judge: judge.markers(STATED, 1, 2), "wrenches": lambda judge: judge.wrenches(STATED, 1, 2), "labels": lambda judge: judge.labels(STATED, 1)}
    with Browser(SOFTWARE_GL) as browser:
        for configuration, faults in (("sixr_spherical", FAULTS), ("jpl_like", PRISMATIC_FAULTS)):
            with judge(browser, configuration, "puma560") as page_judge:
                sound = page_judge.url
                with mutated(sound) as page_judge.url:
                    for judged_without in {kind: judged[kind] for kind, *_ in faults}.values():
                        judged_without(page_judge)
                for kind, file, text, fault in faults:
                    with mutated(sound, file, text, fault) as page_judge.url:
                        reason = failure(lambda: judged[kind](page_judge))
                        assert reason and any(word in reason for word in REASONS), f"{reason or 'not seen'}: {fault} in {file}"
            print(f"  {configuration}: {len(faults)} of {len(faults)} faults are seen", flush=True)


def failure(work):
    """Returns what an assertion says that fails; empty where none does."""
    try:
        work()
    except AssertionError as failed:
        return str(failed)
    return ""


TESTS = [view_draws_joints_where_pinocchio_has_them, view_draws_wrenches_as_their_arrows, view_with_faults_in_its_scripts_fails_its_judges]
