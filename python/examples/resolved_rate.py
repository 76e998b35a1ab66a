"""Resolved rate: joint rates that give {MRF} a twist, by the Jacobian of MuJoCo and damped least squares."""
import mujoco
import numpy as np

MAX_SPEED = (0.25, 1.0)
"""Of {MRF}, in m/s and rad/s."""
MAX_JOINT_RATE = 1.5
"""In rad/s. All joints are slowed down together, so that {MRF} stays on its line."""
WORKSPACE = np.array([[0.25, -0.25, 0.1], [0.5, 0.25, 0.5]])
"""Least and greatest position of {MRF} in {b}, in m."""
DAMPED_BELOW, DAMPING = 0.01, 0.01
"""Product of the singular values below which J⁺ is damped, and λ² of its damping at a singularity."""


def quaternion(matrix):
    """Quaternion x, y, z, w of a rotation matrix."""
    w_first = np.zeros(4)
    mujoco.mju_mat2Quat(w_first, np.asarray(matrix, dtype=float).ravel())
    return w_first[[1, 2, 3, 0]]


def cross(a, b):
    """Cross product of two 3-vectors; numpy's costs ten times as much."""
    product = np.zeros(3)
    mujoco.mju_cross(product, a, b)
    return product


class ResolvedRate:
    """Commanded joint positions `q`, in rad. Kinematics alone: how the arm follows them is its servos' matter."""

    def __init__(self, model, mrf):
        self.model, self.data, self.mrf = model, mujoco.MjData(model), mrf
        self.joints = model.nu // 2
        self.jacobian = np.zeros((6, model.nv))
        self.low, self.high = model.jnt_range[: self.joints].T
        self.stop_at(model.key_qpos[0][: self.joints])

    def stop_at(self, q):
        """Commands `q`, at rest."""
        self.q = np.array(q, dtype=float)
        self.update()

    def update(self):
        """Computes the kinematics of `q`."""
        self.data.qpos[: self.joints] = self.q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)  # the Jacobian needs it

    def follow_rate(self, twist, dt):
        """Moves for `dt` seconds by a twist of {MRF} written in {MRF}, in m/s and rad/s."""
        x_b_m = self.data.site_xmat[self.mrf].reshape(3, 3)
        linear, angular = x_b_m @ twist[:3], x_b_m @ twist[3:]
        position = self.data.site_xpos[self.mrf]
        self.move((np.clip(position + linear * dt, *WORKSPACE) - position) / dt, angular, dt)

    def follow_pose(self, position, orientation, dt):
        """Moves towards a pose of {MRF} in {b}, and reaches it within `dt` seconds unless a limit is in the way."""
        x_b_m = self.data.site_xmat[self.mrf].reshape(3, 3)
        turn = np.zeros(3)  # in {MRF}
        target, current = np.asarray(orientation, dtype=float), quaternion(x_b_m)
        mujoco.mju_subQuat(turn, target[[3, 0, 1, 2]], current[[3, 0, 1, 2]])
        linear = np.clip(position, *WORKSPACE) - self.data.site_xpos[self.mrf]
        self.move(linear / dt, x_b_m @ turn / dt, dt)

    def move(self, linear, angular, dt):
        """Moves for `dt` seconds by a twist of {MRF} written in {b}, within all limits."""
        speeds = [np.linalg.norm(linear) / MAX_SPEED[0], np.linalg.norm(angular) / MAX_SPEED[1]]
        twist = np.concatenate([linear, angular]) / max(1.0, *speeds)
        mujoco.mj_jacSite(self.model, self.data, self.jacobian[:3], self.jacobian[3:], self.mrf)
        j = self.jacobian[:, : self.joints]
        square = j @ j.T
        # Nakamura's damping: none where the arm is far from a singularity, so that the twist is met exactly.
        lack = max(0.0, 1.0 - np.sqrt(max(0.0, np.linalg.det(square))) / DAMPED_BELOW)
        rates = j.T @ np.linalg.solve(square + DAMPING * lack**2 * np.eye(6), twist)
        rates /= max(1.0, np.abs(rates).max() / MAX_JOINT_RATE)
        self.q = np.clip(self.q + rates * dt, self.low, self.high)
        self.update()
