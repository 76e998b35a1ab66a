"""Arms of configuration files in pinocchio: its joints and placements, from the modified Denavit-Hartenberg parameters (Craig 1989, 3.4) of the TOML."""

import tomllib

import numpy as np
import pinocchio as pin

from robots import before, placed


def pose(place):
    """Returns a pose as the telemetry has it."""
    x, y, z, w = map(float, pin.Quaternion(place.rotation).coeffs())
    return {"position": [float(part) for part in place.translation], "quaternion": [w, x, y, z]}


def placed_by(settings, name):
    """Returns the pose that the keys of a frame set; the identity without them."""
    degrees = settings.get(f"{name}_deg", np.degrees(settings.get(f"{name}_rad", [0.0] * 3)))
    return placed(settings.get(f"{name}_m", [0.0] * 3), degrees)


class Arm:
    """A hand controller or a robot of a file: its model, its base, and what its last link carries."""

    def __init__(self, file):
        settings = tomllib.loads(file.read_text())
        self.joints = settings["joint"]
        held = settings.get("arm", {})
        self.tip = placed_by(held, "grip") if held else placed_by(settings, "tool")
        self.sensor = placed_by(settings.get("remote", {}), "sensor")
        base = placed_by(settings, "base")
        self.model = pin.Model()
        parent = 0
        for joint in self.joints:
            place = before(joint) if parent else base * before(joint)
            kind = pin.JointModelPZ() if joint.get("kind") == "prismatic" else pin.JointModelRZ()
            parent = self.model.addJoint(parent, kind, place, f"joint {parent + 1}")
        self.data = self.model.createData()

    def ranges(self):
        """Returns least and greatest positions, in rad or m."""
        ends = [joint["limit_m"] if "limit_m" in joint else np.radians(joint["limit_deg"]) for joint in self.joints]
        return np.array(ends).T

    def posture(self, random):
        """Returns random positions within the ranges."""
        return random.uniform(*self.ranges())

    def links(self, q):
        """Returns the poses of the links, and of what the last one carries."""
        pin.forwardKinematics(self.model, self.data, np.asarray(q, float))
        links = [self.data.oMi[number] for number in range(1, self.model.njoints)]
        return [link.copy() for link in links], links[-1] * self.tip
