"""Times forward kinematics, grip Jacobian and gravity of kraft_like in pinocchio: the part of a controller step that
both programs compute. From the root, with the packages of tests/interop:

    target/interop/venv/bin/python lab/bench_pinocchio.py
"""

import json
import time

import numpy as np
import pinocchio as pin

model_file = json.load(open("tests/oracles/kraft_like.json"))["model"]


def before(row):
    """Rx(alpha) Tx(a) and Tz(d) with Rz(theta): the fixed part before a joint, d and theta constant."""
    ca, sa = np.cos(row["alpha_im1"]), np.sin(row["alpha_im1"])
    ct, st = np.cos(row["theta"]), np.sin(row["theta"])
    about_x = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    about_z = np.array([[ct, -st, 0], [st, ct, 0], [0, 0, 1]])
    shift = np.array([row["a_im1"], 0.0, 0.0]) + about_x @ np.array([0.0, 0.0, row["d"]])
    return pin.SE3(about_x @ about_z, shift)


model = pin.Model()
parent = 0
for row, link in zip(model_file["rows"], model_file["links"]):
    joint = pin.JointModelRZ() if row["type"] == "R" else pin.JointModelPZ()
    parent = model.addJoint(parent, joint, before(row), f"joint{parent + 1}")
    inertia = pin.Inertia(link["m"], np.array(link["r"]), np.array(link["I"]))
    model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
grip = np.array(model_file["T_6G"])
grip = pin.SE3(grip[:3, :3], grip[:3, 3])
frame = model.addFrame(pin.Frame("grip", parent, 0, grip, pin.FrameType.OP_FRAME))
data = model.createData()

config = json.load(open("tests/oracles/kraft_like.json"))["configs"][0]
q = np.array(config["q"])
jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL)
gravity = pin.computeGeneralizedGravity(model, data, q)
assert np.allclose(jacobian, config["J_body_G"], atol=1e-9)
assert np.allclose(gravity, config["gravity"], atol=1e-9)

spans = []
for _ in range(20_000):
    begun = time.perf_counter_ns()
    pin.framesForwardKinematics(model, data, q)
    pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL)
    pin.computeGeneralizedGravity(model, data, q)
    spans.append(time.perf_counter_ns() - begun)
spans.sort()
print(
    f"pinocchio {pin.__version__}, FK + Jacobian + gravity, called from Python: "
    f"p50 {spans[len(spans) // 2] / 1e3:.2f} µs, p99 {spans[len(spans) * 99 // 100] / 1e3:.2f} µs"
)
