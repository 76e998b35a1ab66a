"""MuJoCo puts the peg of the simulation into a hole of convex wedges, and gets its contacts and its jams.

Both have the same sizes, the same springs and force at the grip, contacts as compliant, and drag alike in all directions.
The rig of `frhc-lab peg` has no mass; MuJoCo's peg has one, and with less drag across the hole than along it its
momentum carries it over where friction would hold it. Its friction creeps: a peg slower than 1 % of a free one is stuck.
"""

import contextlib
import functools
import json
import math
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np

import runner
from bench import ROOT, check, same

LAB = str(ROOT / "target/release/frhc-lab")

SEED = 1997
WEDGES = 96
SIZES = {
    "peg_radius_m": 5e-3,
    "peg_length_m": 0.03,
    "hole_radius_m": 5.05e-3,
    "hole_chamfer_m": [1e-3, 1e-3],
    "thickness_m": 0.03,
    "friction": 0.3,
    "stiffness_n_per_m": 3.6e7,
}
OUTSIDE = 0.02
"""Radius of the plate in MuJoCo, in m."""
GRIP = {
    "grip_centre_m": 0.0,
    "grip_lateral_n_per_m": 1e3,
    "grip_angular_nm_per_rad": 5.0,
    "grip_force_n": 5.0,
    "insert_depth_m": 0.012,
}
CHAMFER = [5e-4, 5e-4]
SHARP = [0.0, 0.0]
"""Width and length of the chamfer of a lowered peg, in m; a peg that is put somewhere is sharp."""
POINTS = 36
"""Points of a circle of ours, which share the stiffness."""
MASS = 0.5
"""Of MuJoCo's peg, in kg."""
IMPEDANCE = 0.99
"""Of MuJoCo's contacts."""
SPEED = 0.02
"""Of a free peg in MuJoCo, in m/s."""
DRAG = GRIP["grip_force_n"] / SPEED
"""Of MuJoCo's peg in all directions, in N·s/m."""
TURNING_DRAG = DRAG * GRIP["insert_depth_m"] ** 2
"""About all axes, in N·m·s/rad: the rig has a lever of the depth."""
GAP = 1e-4
"""Between peg and plate at the start, as in the rig, in m."""
WINDOW = 250
"""Steps between two tests of progress."""
OFFSETS = np.linspace(0.0, 1.4e-3, 8)
TILTS = np.linspace(-0.04, 0.04, 9)
SHARE = 0.95
NEAR = [5e-5, math.radians(0.1)]
"""Distance from the boundary, in m and rad, within which results may differ."""
DEPTH = 2e-5
"""Of single contacts, in m."""
POSES = 30
"""Per part of the plate."""


def asked(**question):
    """Answers of `frhc-lab peg`."""
    text = json.dumps({**SIZES, **question})
    command = [LAB, "peg", "-"]
    done = subprocess.run(
        command, input=text, cwd=ROOT, capture_output=True, text=True, timeout=600
    )
    same(done.returncode, 0, f"frhc-lab peg: {done.stderr}")
    return [json.loads(line) for line in done.stdout.splitlines()]


def vertices(corners):
    """Corners of a convex mesh, as MuJoCo's XML."""
    return " ".join(f"{number:.9g}" for corner in corners for number in corner)


def tip(chamfer):
    """Name and mesh of the chamfered end of a peg, as MuJoCo's XML; nothing for a sharp peg."""
    if chamfer == SHARP:
        return "", ""
    radius, (width, length) = SIZES["peg_radius_m"], chamfer
    turns = [math.tau * place / WEDGES for place in range(WEDGES)]
    circles = [(radius - width, 0.0), (radius, length)]
    corners = [(rho * math.cos(at), rho * math.sin(at), z) for rho, z in circles for at in turns]
    mesh = f'<mesh name="tip" vertex="{vertices(corners)}" inertia="convex"/>'
    return '<geom type="mesh" mesh="tip"/>', mesh


def time_constant(stiffness):
    """MuJoCo's time constant of a contact that yields as one of our points does.

    At rest it yields by (1 - d) f T² / (d m), with its impedance d.
    """
    return math.sqrt(IMPEDANCE / (1.0 - IMPEDANCE) * MASS * POINTS / stiffness)


def scene(body, mesh="", yields=4e-4):
    """A plate with its hole, and a body, as MuJoCo's XML. The inner faces of the wedges touch bore and chamfer."""
    (w, c), r, t = SIZES["hole_chamfer_m"], SIZES["hole_radius_m"], SIZES["thickness_m"]
    profile = [(r, -c), (r, -t), (OUTSIDE, -t), (OUTSIDE, 0.0), (r + w, 0.0)]
    slope = math.tan(math.pi / WEDGES)
    wedge = [(rho, rho * side * slope, z) for rho, z in profile for side in (-1.0, 1.0)]
    halves = [math.pi * place / WEDGES for place in range(WEDGES)]
    ring = "".join(
        f'<geom type="mesh" mesh="wedge" quat="{math.cos(half)} 0 0 {math.sin(half)}"/>'
        for half in halves
    )
    return f"""<mujoco>
      <compiler angle="radian"/>
      <option gravity="0 0 0" timestep="2e-4" cone="elliptic" impratio="100" integrator="implicitfast"
              ccd_tolerance="1e-9" ccd_iterations="200"/>
      <default>
        <geom friction="{SIZES["friction"]} 0 0" condim="3" solref="{yields} 1"
              solimp="{IMPEDANCE} {IMPEDANCE} 1e-6"/>
      </default>
      <asset>
        <mesh name="wedge" vertex="{vertices(wedge)}" inertia="convex"/>{mesh}
      </asset>
      <worldbody>{ring}{body}</worldbody>
    </mujoco>"""


def peg(place, joints, chamfer, end):
    """The peg as a body, whose origin is the centre of its end: a cylinder behind the length of its chamfer."""
    radius, length = SIZES["peg_radius_m"], SIZES["peg_length_m"]
    half, middle = (length - chamfer) / 2, (length + chamfer) / 2
    return f"""<body {place}>{joints}
      <inertial pos="0 0 0.005" mass="{MASS}" diaginertia="5e-5 5e-5 5e-5"/>
      <geom type="cylinder" size="{radius} {half}" pos="0 0 {middle}"/>{end}
    </body>"""


def turned(a, b):
    """Quaternion of the rotation vector [a, b, 0]."""
    angle = math.hypot(a, b)
    share = math.sin(angle / 2) / angle if angle else 0.0
    return np.array([math.cos(angle / 2), a * share, b * share, 0.0])


def matrix(quaternion):
    """Its rotation matrix."""
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, quaternion)
    return flat.reshape(3, 3)


def rim(a, b):
    """Points of the rim of a tilted peg, from the centre of its end."""
    angle = np.linspace(0.0, math.tau, 3600, endpoint=False)
    circle = SIZES["peg_radius_m"] * np.array([np.cos(angle), np.sin(angle), 0.0 * angle])
    return matrix(turned(a, b)) @ circle


def on_the_face(rng):
    """A tilted peg, whose lowest point is beside the hole."""
    tilt, towards, around = rng.uniform(0.05, 0.2), *rng.uniform(0.0, math.tau, 2)
    a, b = tilt * math.cos(towards), tilt * math.sin(towards)
    points = rim(a, b)
    lowest = points[:, points[2].argmin()]
    x, y = 0.012 * np.array([math.cos(around), math.sin(around)]) - lowest[:2]
    return [x, y, lowest[2] + DEPTH, a, b]


def shifted(around, depth, a, b, inside):
    """A peg at a depth, shifted until its deepest point is `inside` the material by DEPTH."""
    points = rim(a, b) - [[0.0], [0.0], [depth]]
    along = np.array([[math.cos(around)], [math.sin(around)], [0.0]])
    low, high = 0.0, 3e-3
    for _ in range(60):
        middle = (low + high) / 2
        x, y, z = points + along * middle
        low, high = (low, middle) if inside(np.hypot(x, y), z).max() > DEPTH else (middle, high)
    return [*(along[:2, 0] * low).tolist(), depth, a, b]


def on_the_chamfer(rng):
    """A peg, tilted by up to 3°, with its rim on the chamfer."""
    (w, c), r = SIZES["hole_chamfer_m"], SIZES["hole_radius_m"]

    def inside(rho, z):
        return (c * (rho - r) - w * (z + c)) / math.hypot(w, c)

    a, b = rng.uniform(-0.035, 0.035, 2)
    return shifted(rng.uniform(0.0, math.tau), rng.uniform(3e-4, 7e-4), a, b, inside)


def on_the_bore(rng):
    """A peg whose rim touches the bore; it leans so little that its side does not touch the edge."""
    around, depth = rng.uniform(0.0, math.tau), rng.uniform(4e-3, 0.02)
    lean = 2e-5 / depth
    a, b = lean * math.sin(around), -lean * math.cos(around)
    return shifted(around, depth, a, b, lambda rho, _: rho - SIZES["hole_radius_m"])


@functools.cache
def free_peg():
    """A model whose peg can be put anywhere.

    Its collisions are those of libccd: MuJoCo's own report the sides of neighbouring wedges, too, which are no surface.
    """
    model = mujoco.MjModel.from_xml_string(scene(peg("", "<freejoint/>", 0.0, "")))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD)
    return model


def mujoco_push(pose):
    """MuJoCo's contact normals towards the peg, weighted by their depths as springs weight them."""
    x, y, depth, a, b = pose
    model = free_peg()
    data = mujoco.MjData(model)
    data.qpos[:] = [x, y, -depth, *turned(a, b)]
    mujoco.mj_fwdPosition(model, data)
    push = np.zeros(3)
    for contact in data.contact[: data.ncon]:
        # The normal points from the first body of a contact to the second; the peg comes after the wedges.
        side = 1.0 if contact.geom[1] >= WEDGES else -1.0
        push += contact.frame[:3] * side * max(0.0, -contact.dist)
    check(push.any(), f"MuJoCo has no contact at {pose}")
    return push


def mujoco_pushes_the_peg_where_we_do(_):
    rng = np.random.default_rng(SEED)
    for part, pose in [("face", on_the_face), ("cone", on_the_chamfer), ("bore", on_the_bore)]:
        poses = [[float(number) for number in pose(rng)] for _ in range(POSES)]
        worst = 0.0
        for at, ours in zip(poses, asked(poses=poses), strict=True):
            touched = [name for name, count in ours["points"].items() if count]
            check(part in touched, f"{part}: our peg touches {touched} at {at}")
            push, theirs = np.array(ours["f_e"][:3]), mujoco_push(at)
            angle = math.atan2(np.linalg.norm(np.cross(push, theirs)), push @ theirs)
            check(angle < math.radians(5.0), f"{part}: {math.degrees(angle):.1f}° apart at {at}")
            worst = max(worst, angle)
        print(f"   {part}: {math.degrees(worst):.2f}° apart at most", flush=True)


def gripped_peg(approach, chamfer, stiffness):
    """A model whose peg hangs in the springs of the grip."""
    x, y, a, b = approach
    height = SIZES["peg_radius_m"] * math.sin(math.hypot(a, b)) + GAP
    quat = turned(a, b)
    # Axes of the plate, in the peg.
    axes = [" ".join(map(str, axis)) for axis in matrix(quat)]
    centre = f'pos="0 0 {GRIP["grip_centre_m"]}"'
    across = f'type="slide" {centre} stiffness="{GRIP["grip_lateral_n_per_m"]}" damping="{DRAG}"'
    joints = f"""<joint {across} axis="{axes[0]}"/><joint {across} axis="{axes[1]}"/>
      <joint type="slide" {centre} axis="{axes[2]}" damping="{DRAG}"/>
      <joint type="ball" {centre} stiffness="{GRIP["grip_angular_nm_per_rad"]}" damping="{TURNING_DRAG}"/>"""
    place = f'pos="{x} {y} {height}" quat="{" ".join(map(str, quat))}"'
    end, mesh = tip(chamfer)
    body = peg(place, joints, chamfer[1], end)
    return mujoco.MjModel.from_xml_string(scene(body, mesh, time_constant(stiffness)))


def is_inserted_in_mujoco(approach, chamfer, stiffness):
    """Lowers a peg; returns whether it reaches the wanted depth."""
    model = gripped_peg(approach, chamfer, stiffness)
    data = mujoco.MjData(model)
    data.qfrc_applied[2] = -GRIP["grip_force_n"]
    stuck = 0.01 * SPEED * WINDOW * model.opt.timestep
    place, quat = data.xpos[1] + math.inf, data.xquat[1].copy()
    for _ in range(200):
        mujoco.mj_step(model, data, WINDOW)
        if -data.xpos[1][2] >= GRIP["insert_depth_m"]:
            return True
        turn = 2.0 * math.acos(min(1.0, abs(data.xquat[1] @ quat)))
        moved = np.linalg.norm(data.xpos[1] - place) + SIZES["peg_length_m"] * turn
        if moved < stuck:
            return False
        place, quat = data.xpos[1].copy(), data.xquat[1].copy()
    return False


def are_inserted_by_us(approaches, chamfer, stiffness):
    """Whether `frhc-lab peg` gets each to the wanted depth."""
    approaches = [[float(number) for number in approach] for approach in approaches]
    settings = {"peg_chamfer_m": chamfer, "stiffness_n_per_m": stiffness, **GRIP}
    return [answer["outcome"] == "inserted" for answer in asked(approaches=approaches, **settings)]


def is_near_the_boundary(approach, chamfer, stiffness):
    """Whether our result is another one within NEAR."""
    x, y, a, b = approach
    around = [(sx, sb) for sx in (-1, 0, 1) for sb in (-1, 0, 1)]
    moved = [[x + sx * NEAR[0], y, a, b + sb * NEAR[1]] for sx, sb in around]
    return len(set(are_inserted_by_us(moved, chamfer, stiffness))) == 2


def same_pegs_are_inserted(chamfer, stiffness):
    """Compares one peg on the whole grid."""
    grid = [[x, 0.0, 0.0, b] for x in OFFSETS for b in TILTS]
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        theirs = list(threads.map(lambda at: is_inserted_in_mujoco(at, chamfer, stiffness), grid))
    ours = are_inserted_by_us(grid, chamfer, stiffness)
    inserted = sum(ours)
    check(len(grid) < 7 * inserted < 6 * len(grid), f"{inserted} of {len(grid)} inserted: a useless grid")
    pairs = zip(grid, ours, theirs, strict=True)
    different = [list(map(float, at)) for at, one, other in pairs if one != other]
    equal = len(grid) - len(different)
    peg = f"{'sharp' if chamfer == SHARP else 'chamfered'} peg at {stiffness:.1e} N/m"
    print(f"   {peg}: {inserted} inserted, {equal} of {len(grid)} equal, different at {different}", flush=True)
    check(equal >= SHARE * len(grid), f"{peg}: {equal} of {len(grid)} are equal")
    for approach in different:
        near = is_near_the_boundary(approach, chamfer, stiffness)
        check(near, f"{peg}: {approach} differs, far from the boundary")


def mujoco_inserts_and_jams_chamfered_pegs_that_we_do(_):
    same_pegs_are_inserted(CHAMFER, 3.6e7)


def mujoco_inserts_and_jams_sharp_pegs_that_we_do(_):
    same_pegs_are_inserted(SHARP, 3.6e7)


def mujoco_inserts_and_jams_soft_chamfered_pegs_that_we_do(_):
    same_pegs_are_inserted(CHAMFER, 3.6e6)


def mujoco_inserts_and_jams_soft_sharp_pegs_that_we_do(_):
    same_pegs_are_inserted(SHARP, 3.6e6)


TESTS = [
    mujoco_pushes_the_peg_where_we_do,
    mujoco_inserts_and_jams_chamfered_pegs_that_we_do,
    mujoco_inserts_and_jams_sharp_pegs_that_we_do,
    mujoco_inserts_and_jams_soft_chamfered_pegs_that_we_do,
    mujoco_inserts_and_jams_soft_sharp_pegs_that_we_do,
]

if __name__ == "__main__":
    sys.exit(runner.run(TESTS, contextlib.nullcontext, sys.argv[1:]))
