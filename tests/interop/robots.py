"""pinocchio computes the shipped robot arms from their files, and gets what `frhc explain robot` prints.

It reads the TOML itself: modified Denavit-Hartenberg parameters (Craig 1989), degrees, and inertias about the centres of
mass. Its mass matrix gets the rotors, which it calls armature.
"""

import functools
import json
import math
import subprocess
import tomllib

import numpy as np
import pinocchio as pin

from bench import FRHC, ROOT, check, same

ARMS = sorted((ROOT / "config/robots").glob("*.toml"))
POSTURES = 50
SEED = 1997
TOLERANCE = 1e-9
GRAVITY = np.array([0.0, 0.0, -9.81])
"""Of the simulation, in {b}."""


def placed(position, degrees):
    """A pose by position and rotations about x, y, z, in this order about the fixed axes."""
    return pin.SE3(pin.rpy.rpyToMatrix(*np.radians(degrees)), np.array(position))


def before(joint):
    """Rx(alpha) Tx(a) Tz(d) Rz(theta): the fixed part before a joint."""
    alpha = placed([0.0, 0.0, 0.0], [joint["alpha_deg"], 0.0, 0.0])
    theta = placed([0.0, 0.0, 0.0], [0.0, 0.0, joint.get("theta_deg", 0.0)])
    along_x = placed([joint["a_m"], 0.0, 0.0], [0.0] * 3)
    along_z = placed([0.0, 0.0, joint["d_m"]], [0.0] * 3)
    return alpha * along_x * along_z * theta


def tensor(xx, yy, zz, xy, xz, yz):
    """A symmetric matrix, in the order of the robot files."""
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@functools.cache
def built(file):
    """The arm of a file in pinocchio: model and frame under control."""
    arm = tomllib.loads(file.read_text())
    model = pin.Model()
    model.gravity.linear = GRAVITY
    base = placed(arm["base_m"], arm.get("base_deg", [0.0] * 3))
    parent = 0
    for joint in arm["joint"]:
        place = base * before(joint) if parent == 0 else before(joint)
        parent = model.addJoint(parent, pin.JointModelRZ(), place, f"joint {parent + 1}")
        inertia = tensor(*joint["inertia_kg_m2"])
        body = pin.Inertia(joint["mass_kg"], np.array(joint["centre_of_mass_m"]), inertia)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    model.armature = np.array([joint["rotor_inertia_kg_m2"] for joint in arm["joint"]])
    tool = placed(arm["tool_m"], arm.get("tool_deg", [0.0] * 3))
    frame = model.addFrame(pin.Frame("MRF", parent, 0, tool, pin.FrameType.OP_FRAME))
    return model, frame


def postures(file):
    """Seeded joint positions within their limits, in degrees."""
    limits = np.array([joint["limit_deg"] for joint in tomllib.loads(file.read_text())["joint"]])
    low, high = limits.T
    return np.random.default_rng(SEED).uniform(low, high, (POSTURES, len(limits)))


@functools.cache
def explained(file):
    """Every posture, as `frhc explain robot` computes it."""
    command = [FRHC, "explain", "robot", str(file), "--json"]
    for degrees in postures(file):
        command += ["--q", ",".join(map(repr, np.radians(degrees).tolist()))]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
    same(done.returncode, 0, f"frhc explain robot: {done.stderr}")
    return [json.loads(line) for line in done.stdout.splitlines()]


def agrees(name, compute):
    """Compares a value of all postures of all arms with what `compute` returns for model, frame and q."""
    check(len(ARMS) >= 2, f"{ARMS} are too few arms")
    for file in ARMS:
        model, frame = built(file)
        answers = explained(file)
        same(len(answers), POSTURES, f"{file.name}: answers")
        worst = 0.0
        for degrees, answer in zip(postures(file), answers, strict=True):
            theirs = compute(model, frame, np.radians(degrees))
            ours = np.array(answer[name]["value"])
            same(ours.shape, np.shape(theirs), f"{file.name}: shape of {name}")
            worst = max(worst, np.abs(ours - theirs).max())
        check(worst <= TOLERANCE, f"{file.name}: {name} differs by {worst:.1e}")
        print(f"   {file.stem}: {name} differs by {worst:.1e} at most", flush=True)


def pinocchio_finds_the_frame_under_control_where_we_do(_):
    def pose(model, frame, q):
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        return data.oMf[frame].homogeneous

    agrees("x_b_m", pose)


def pinocchio_has_our_jacobian(_):
    def jacobian(model, frame, q):
        return pin.computeFrameJacobian(model, model.createData(), q, frame, pin.LOCAL)

    agrees("j_m", jacobian)


def pinocchio_has_our_smallest_singular_value(_):
    for file in ARMS:
        law = tomllib.loads(file.read_text()).get("resolved_rate", {})
        scale = np.diag([1.0 / law.get("length_m", 0.5)] * 3 + [1.0] * 3)
        model, frame = built(file)
        for degrees, answer in zip(postures(file), explained(file), strict=True):
            q = np.radians(degrees)
            jacobian = pin.computeFrameJacobian(model, model.createData(), q, frame, pin.LOCAL)
            theirs = np.linalg.svd(scale @ jacobian, compute_uv=False)[5]
            ours = answer["sigma_min"]["value"]
            is_near = math.isclose(ours, theirs, rel_tol=0.0, abs_tol=1e-7)
            check(is_near, f"{file.name}: sigma_min {ours}, {theirs}")


def pinocchio_carries_the_arm_with_our_torques(_):
    def gravity(model, _frame, q):
        return pin.computeGeneralizedGravity(model, model.createData(), q)

    agrees("tau_gravity", gravity)


def pinocchio_has_our_mass_matrix(_):
    def mass(model, _frame, q):
        upper = np.triu(pin.crba(model, model.createData(), q))
        return upper + np.triu(upper, 1).T

    agrees("mass_matrix", mass)


TESTS = [
    pinocchio_finds_the_frame_under_control_where_we_do,
    pinocchio_has_our_jacobian,
    pinocchio_has_our_smallest_singular_value,
    pinocchio_carries_the_arm_with_our_torques,
    pinocchio_has_our_mass_matrix,
]
