"""`frhc run` commands a far side of the package in python/, in this process: contact is felt, and the node says how the far side ended."""

import gc
import os
import re
import signal
import subprocess
import sys
import time

import package  # the path of the package
import frhc
from bench import CONFIG, ROOT, check, same, until

sys.path.append(str(ROOT / "examples"))
from far_side_local import CAPABILITY, Robot

START, WALL_Z = (0.45, 0.0, 0.3), 0.37
CONTACT_S = 6.0  # the object meets the wall 3.5 s after the first SYNC


def linked(text):
    """Returns a configuration with a robot in another process that neither yields nor weighs."""
    for table in ("[remote.shared_control]", "[remote.wall]", "[remote.box]"):
        if table in text:
            before, after = text.split(table, 1)
            text = before + "[" + after.split("\n[", 1)[1]
    for old, new in (('kind = "virtual"', 'kind = "link"'), ("mass_kg = 0.8 ", "mass_kg = 0.0 "),
                     ("accommodation_m_per_ns = 0.01 ", "accommodation_m_per_ns = 0.0 "),
                     ("accommodation_rad_per_nms = 0.5", "accommodation_rad_per_nms = 0.0"), ('"../eds/', f'"{ROOT}/eds/'),
                     ("[safety]", "[remote.link]\nround_trip_ms = 5.0\nstiffest_contact_n_per_m = 2000.0\n\n[safety]")):
        check(old in text, f"{old!r} is not in {CONFIG}")
        text = text.replace(old, new)
    return text


def start(bench):
    """Starts drives and node; returns both."""
    os.environ["XDG_RUNTIME_DIR"] = str(bench.folder)  # where the package looks for sockets
    os.environ.pop("RUNTIME_DIRECTORY", None)
    config = bench.folder / "linked.toml"
    config.write_text(linked(CONFIG.read_text()))
    return (bench.start("sim", "--config", config, "--scenario", "contact_10s"), bench.start("run", "--config", config))


def is_in_contact():
    """Checks that the operator feels the wall, and that no message was rejected."""
    status = frhc.status()
    same(status["mode"], "engaged", "mode")
    force = sum(part**2 for part in status["f_g_task"][:3]) ** 0.5
    check(force > 0.3, f"{force} N felt")
    found = {key: status["link"][key] for key in ("far_side", "leader", "rejects", "connected")}
    same(found, dict(far_side="following", leader="this node", rejects={}, connected=True), "link")


def stopped_by():
    """Returns why the node ended reflection."""
    status = until(lambda: (found := frhc.status())["mode"] == "reflection-off" and found, "reflection ends", 0.2)
    check(all(abs(torque) < 1e-9 for torque in status["budget"]["task"]), f"{status['budget']}")
    return status["stopped_by"]


class Rig:
    """Drives, node, and a far side that leads its robot into contact."""

    def __init__(self, bench):
        self.bench = bench
        self.sim, self.run = start(bench)
        self.far, self.robot = frhc.FarSide("arm1", capability=CAPABILITY), Robot(START, 2, WALL_Z)
        arming = bench.start("ctl", "--wait", "arm")
        self.follow(lambda: arming.poll() is not None)
        bench.ends(arming, 0)
        self.follow_for(CONTACT_S)
        is_in_contact()
        same((self.far.reason, self.far.rejects), (frhc.Reason.NONE, {}), "reason to hold, rejects")

    def follow(self, is_over):
        """Follows the commands for at least a cycle."""
        for command in self.far:
            self.far.send(*self.robot.step(command, self.far.period))
            if is_over():
                return

    def follow_for(self, seconds):
        start = time.monotonic()
        self.follow(lambda: time.monotonic() - start > seconds)

    def end(self):
        """Ends node and drives. The far side may have ended before."""
        self.far = None
        self.bench.stop(self.run, code=6)
        self.bench.stop(self.sim)


def body_that_raises_is_a_fault_of_the_robot(bench):
    rig = Rig(bench)
    try:
        with rig.far as far:
            for command in far:
                far.send(*rig.robot.step(command, far.period))
                raise RuntimeError("the robot's driver")
    except RuntimeError:
        pass
    same(stopped_by(), "the far side holds: fault of the robot", "cause")
    rig.end()


def body_that_ends_is_the_end_of_the_far_side(bench):
    rig = Rig(bench)
    with rig.far:
        pass
    same(stopped_by(), "the far side holds: far side ends", "cause")
    rig.end()


def collected_far_side_is_the_end_of_the_far_side(bench):
    rig = Rig(bench)
    rig.far = None
    gc.collect()
    same(stopped_by(), "the far side holds: far side ends", "cause")
    rig.end()


def body_that_sleeps_3_s_is_a_lost_link_and_moves_nothing(bench):
    rig = Rig(bench)
    time.sleep(3.0)
    same(stopped_by(), "no new wrench from the commanded side", "cause")
    before, session = list(rig.robot.position), rig.far.session
    rig.follow_for(0.5)
    same(rig.robot.position, before, "position, after the commands that waited")
    same((rig.far.reason, rig.far.session), (frhc.Reason.SILENCE, session), "reason to hold, and session")
    same(frhc.status()["link"]["far_side"], "holding: no fresh command", "the far side for the operator")
    reset = None

    def is_reset():
        nonlocal reset
        if reset is None:
            reset = bench.start("ctl", "reset")
        elif reset.poll() not in (None, 0):
            reset = None  # the hand has not released the deadman yet
        return reset is not None and reset.poll() == 0

    start = time.monotonic()
    rig.follow(lambda: is_reset() or time.monotonic() - start > 10.0)
    rig.follow(lambda: rig.far.reason is frhc.Reason.NONE or time.monotonic() - start > 11.0)
    same((rig.far.reason, rig.far.session), (frhc.Reason.NONE, session), "after a reset")
    rig.far.close()
    rig.end()


def wrench_that_is_nan_is_named(bench):
    rig = Rig(bench)
    next(rig.far)
    rig.far.send([float("nan")] * 6, rig.robot.step(frhc.Command(), rig.far.period)[1])
    rig.follow_for(0.1)
    same(stopped_by(), "the far side holds: force sensor invalid", "cause")
    rig.far.close()
    rig.end()


def cycles_without_a_send_have_no_wrench(bench):
    rig = Rig(bench)
    for _ in range(50):
        next(rig.far)
    same(rig.far.reason, frhc.Reason.NONE, "it follows")
    same(stopped_by(), "no new wrench from the commanded side", "cause")
    rig.far.close()
    rig.end()


def program_of_the_page_is_led_into_contact(bench):
    text = re.search(r"```python\n(.*?)```", (ROOT / "docs/python.md").read_text(), re.S)[1]
    sim, run = start(bench)
    program = subprocess.Popen([sys.executable, "-B", "-c", text], env=dict(os.environ), stderr=subprocess.DEVNULL)
    bench.processes.append(program)
    bench.frhc("ctl", "--wait", "arm")
    time.sleep(CONTACT_S)
    is_in_contact()
    program.send_signal(signal.SIGINT)
    same(stopped_by(), "the far side holds: far side ends", "cause")
    check(program.wait(timeout=5) != 0, "Ctrl-C ends it")
    bench.stop(run, code=6)
    bench.stop(sim)


TESTS = [program_of_the_page_is_led_into_contact, body_that_raises_is_a_fault_of_the_robot, body_that_ends_is_the_end_of_the_far_side,
         collected_far_side_is_the_end_of_the_far_side, body_that_sleeps_3_s_is_a_lost_link_and_moves_nothing,
         wrench_that_is_nan_is_named, cycles_without_a_send_have_no_wrench]
