"""The world of mujoco_arm.xml: an arm with a peg, a wall, and a plate with a hole.

World.step(command, dt) is all that a far side needs. What it returns depends on the commands alone: no clock, no random numbers.
A command is any object with `motion` (None: hold where the arm is), `rate` and `pose`; see the package frhc.
"""
from pathlib import Path

import mujoco
import numpy as np

from resolved_rate import ResolvedRate, cross, quaternion

MODEL = Path(__file__).with_name("mujoco_arm.xml")
SERVO_LAG = 0.034
"""Time constant in s of the servos behind their command: that of UR's servoj."""
ACCOMMODATION = np.array([0.005] * 3 + [0.2] * 3)
"""K_FA: rate per contact wrench at {MRF}, in m/(s·N) and rad/(s·N·m). It acts on rate commands."""
SENSOR_RANGE = (150.0, 10.0)
"""Of the force/torque sensor, in N and N·m."""
STIFFNESS = 1000.0
"""Of wall and plate, in N/m: of their springs in mujoco_arm.xml."""


class World:
    """Arm, servos, sensor and what the peg touches. Poses are (position in m, quaternion x, y, z, w) of {MRF} in {b}."""

    def __init__(self):
        self.model = mujoco.MjModel.from_xml_path(str(MODEL))
        self.data = mujoco.MjData(self.model)
        self.mrf, self.sensor, self.hole = (self.model.site(name).id for name in ("mrf", "s", "hole"))
        self.joints = self.model.nu // 2  # a position and a velocity servo each
        tool = self.model.body("tool")
        self.weight = tool.mass[0] * self.model.opt.gravity  # in {b}, in N
        self.centre_of_mass = tool.ipos.copy()  # in {S}, whose axes are those of {MRF}
        self.from_s_to_m = self.model.site_pos[self.mrf] - self.model.site_pos[self.sensor]
        self.rate = ResolvedRate(self.model, self.mrf)
        self.reset()

    def reset(self, q=None):
        """Puts the arm at the joint positions `q` in rad, at the start without; everything is at rest."""
        mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        if q is not None:
            self.data.qpos[: self.joints] = q
        self.set_point = self.data.qpos[: self.joints].copy()  # behind the commanded joints by SERVO_LAG
        self.rate.stop_at(self.set_point)
        self.is_held = True
        mujoco.mj_forward(self.model, self.data)
        self.f_s = self.contact_wrench(self.data.sensordata)

    def step(self, command, dt):
        """Follows `command` for `dt` seconds. Returns the wrench of the environment at {S} in {S}, and the pose."""
        self.command_joints(command, dt)
        steps = max(1, round(dt / self.model.opt.timestep))
        reading = np.zeros(6)
        for _ in range(steps):
            self.drive_servos()
            mujoco.mj_step(self.model, self.data)
            reading += self.data.sensordata
        # The mean of the step: a sensor has a low pass, too.
        self.f_s = self.contact_wrench(reading / steps)
        return self.f_s, self.pose()

    def command_joints(self, command, dt):
        """Moves the commanded joints: by the command, or to where the arm is."""
        if command is None or command.motion is None:
            if not self.is_held:
                self.set_point = self.data.qpos[: self.joints].copy()
                self.rate.stop_at(self.set_point)
            self.is_held = True
            return
        self.is_held = False
        if command.rate is not None:
            self.rate.follow_rate(np.asarray(command.rate) + ACCOMMODATION * self.wrench_at_mrf(), dt)
        else:
            self.rate.follow_pose(*command.pose, dt)

    def drive_servos(self):
        """Sets position and rate of each servo for one physics step: those of a first-order lag."""
        rate = (self.rate.q - self.set_point) / SERVO_LAG
        self.set_point += (self.rate.q - self.set_point) * -np.expm1(-self.model.opt.timestep / SERVO_LAG)
        self.data.ctrl[: self.joints] = self.set_point
        self.data.ctrl[self.joints :] = rate

    def contact_wrench(self, reading):
        """Wrench of the environment on the tool, at {S} in {S}, in N and N·m: without its weight, with its inertia.

        MuJoCo's sensor reads what the arm exerts on the tool. Arm, environment and weight add up to zero at rest.
        """
        weight = self.data.site_xmat[self.sensor].reshape(3, 3).T @ self.weight
        return -reading - np.concatenate([weight, cross(self.centre_of_mass, weight)])

    def wrench_at_mrf(self):
        """The last wrench, at {MRF} in {MRF}."""
        return np.concatenate([self.f_s[:3], self.f_s[3:] - cross(self.from_s_to_m, self.f_s[:3])])

    def pose(self):
        """Pose of {MRF} in {b}."""
        return self.data.site_xpos[self.mrf].copy(), quaternion(self.data.site_xmat[self.mrf])

    def peg_in_hole(self):
        """Tip of the peg and direction of the peg, in the frame of the hole as it is now: z into the hole, from its mouth."""
        to_hole = self.data.site_xmat[self.hole].reshape(3, 3).T
        tip = to_hole @ (self.data.site_xpos[self.mrf] - self.data.site_xpos[self.hole])
        return tip, to_hole @ self.data.site_xmat[self.mrf].reshape(3, 3)[:, 2]

    def joints_at(self, position, orientation):
        """Joint positions in rad of a pose near the start. The commanded joints are then where the arm is."""
        self.rate.stop_at(self.model.key_qpos[0][: self.joints])
        for _ in range(100):
            before = self.rate.q
            self.rate.follow_pose(position, orientation, 0.02)
            if np.abs(self.rate.q - before).max() < 1e-12:
                break
        q = self.rate.q
        self.rate.stop_at(self.data.qpos[: self.joints])
        return q
