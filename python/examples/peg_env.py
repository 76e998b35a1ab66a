"""The peg and its hole as a gymnasium environment: the arm, servos, sensor and plate of mujoco_world.py.

    env = PegEnv()
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

Learned or planned motions act on the same world as the hand of an operator does through mujoco_arm.py.
"""
import frhc
import gymnasium
import mujoco
import numpy as np
from gymnasium.spaces import Box, Dict

from mujoco_world import SENSOR_RANGE, World

PERIOD, PERIODS = 0.002, 10
"""Period of the arm in s, as in mujoco_arm.py, and how many of them an action lasts."""
MAX_TWIST = np.array([0.05] * 3 + [0.2] * 3)
"""Greatest action, in m/s and rad/s."""
RADIUS, INSERTED = 0.0085, 0.025
"""Radius of the hole, and the depth at which the peg is in it, in m."""
MAX_STEPS = 500
"""Actions of an episode: 10 s."""
LIMITS = np.repeat(SENSOR_RANGE, 3)


class PegEnv(gymnasium.Env):
    """Peg in hole. Deterministic by the seed of `reset` and the actions.

    Action: twist of {MRF}, the tip of the peg, written in {MRF}: m/s, then rad/s; with the accommodation of the arm.
    Observation: `pose` of {MRF} in {b} (m; x, y, z, w), `wrench` at {S} in {S} (N, N·m), and in the frame of the hole, whose z
    leads into it, `tip` of the peg in m and its `direction`. Reward: depth of the tip in the hole, in m, after each action.
    """

    metadata = {"render_modes": []}

    def __init__(self):
        self.world = World()
        self.action_space = Box(-MAX_TWIST, MAX_TWIST, dtype=np.float64)
        self.observation_space = Dict({
            "pose": Box(-1.0, 1.0, (7,), np.float64),
            "wrench": Box(-LIMITS, LIMITS, dtype=np.float64),
            "tip": Box(-1.0, 1.0, (3,), np.float64),
            "direction": Box(-1.0, 1.0, (3,), np.float64),
        })
        self.steps_left = 0

    def reset(self, *, seed=None, options=None):
        """Puts the peg 5 to 10 mm before the plate, beside the hole by up to 4 mm, and tilted by up to 0.03 rad."""
        super().reset(seed=seed)
        self.world.reset()
        to_b = self.world.data.site_xmat[self.world.hole].reshape(3, 3)
        across, before = self.np_random.uniform(-0.004, 0.004, 2), self.np_random.uniform(0.005, 0.01)
        position = self.world.data.site_xpos[self.world.hole] + to_b @ [*across, -before]
        turn = np.array([*self.np_random.uniform(-0.03, 0.03, 2), 0.0])  # in {MRF}
        orientation = self.world.pose()[1][[3, 0, 1, 2]]
        mujoco.mju_quatIntegrate(orientation, turn, 1.0)
        self.world.reset(self.world.joints_at(position, orientation[[1, 2, 3, 0]]))
        self.steps_left = MAX_STEPS
        return self.observe(), {}

    def step(self, action):
        """Applies a twist for 20 ms. An episode ends with the peg in the hole, or the sensor saturated."""
        twist = np.clip(action, -MAX_TWIST, MAX_TWIST)
        command = frhc.Command(frhc.Motion.RATE, rate=twist)
        wrench = np.zeros(6)
        for _ in range(PERIODS):
            wrench, _ = self.world.step(command, PERIOD)
        depth = self.depth()
        is_saturated = bool((np.abs(wrench) >= LIMITS).any())
        self.steps_left -= 1
        info = {"depth": depth, "is_inserted": depth >= INSERTED, "is_saturated": is_saturated}
        return self.observe(), depth, depth >= INSERTED or is_saturated, self.steps_left <= 0, info

    def depth(self):
        """Depth of the tip below the mouth of the hole, in m; 0 beside it."""
        x, y, z = self.world.peg_in_hole()[0]
        return float(max(0.0, z)) if np.hypot(x, y) < RADIUS else 0.0

    def observe(self):
        """Observation of the present state, within its bounds."""
        tip, direction = self.world.peg_in_hole()
        parts = {
            "pose": np.concatenate(self.world.pose()),
            "wrench": self.world.f_s,
            "tip": tip,
            "direction": direction,
        }
        spaces = self.observation_space.spaces
        return {name: np.clip(part, spaces[name].low, spaces[name].high) for name, part in parts.items()}
