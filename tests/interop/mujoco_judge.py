"""The MuJoCo arm of python/examples does what its configuration says of it, and its environment is one of gymnasium's.

Lag, stiffness, energy, limits and holding are measured at World.step alone, without node and bus; mujoco_felt.py has these.
"""

import math
import subprocess
import sys
import tomllib
import warnings
from types import SimpleNamespace

import numpy as np

import package  # noqa: F401  (frhc of python/)
from bench import CONFIG, FRHC, ROOT, check, same

EXAMPLES = ROOT / "python/examples"
sys.path.insert(0, str(EXAMPLES))

from gymnasium.utils.env_checker import check_env  # noqa: E402

import mujoco_arm  # noqa: E402
import mujoco_world  # noqa: E402
import resolved_rate  # noqa: E402
from mujoco_world import World  # noqa: E402
from peg_env import PegEnv  # noqa: E402

ARM_CONFIG = EXAMPLES / "mujoco_arm.toml"
DT = 0.002
MUCH_ENERGY = 1e-3
"""That contacts may give back, in J: rounding of their integral."""


def rate(*twist):
    """Command of a twist of {MRF}."""
    return SimpleNamespace(motion="rate", rate=np.array(twist), pose=None)


def pose(position, orientation):
    """Command of a pose of {MRF}."""
    return SimpleNamespace(motion="pose", rate=None, pose=(position, orientation))


HOLD = SimpleNamespace(motion=None, rate=None, pose=None)


def followed(world, path, seconds):
    """Follows a path of positions with the start's orientation; returns places and wrenches, a row for each step."""
    orientation = world.pose()[1]
    rows = []
    for step in range(round(seconds / DT)):
        wrench, (position, _) = world.step(pose(path(step * DT), orientation), DT)
        rows.append([*position, *wrench])
    return np.array(rows)


def held_at(world, position, seconds=1.5):
    """Wrench after the tip was led to a position and stayed there."""
    start = world.pose()[0]
    share = lambda t: min(1.0, t / (0.5 * seconds))
    return followed(world, lambda t: start + share(t) * (np.asarray(position) - start), seconds)[-1]


def mujoco_arm_lags_as_its_configuration_says(_):
    for axis in range(3):
        world, speed = World(), 0.05
        start, way = world.pose()[0], -np.eye(3)[axis]
        rows = followed(world, lambda t: start + speed * t * way, 0.6)
        # The last command is of the begin of the step.
        commanded = speed * (0.6 - DT)
        lag = (commanded - (rows[-1][:3] - start) @ way) / speed
        print(f"   along {'xyz'[axis]}: {1e3 * lag:.1f} ms behind", flush=True)
        check(abs(lag - mujoco_world.SERVO_LAG) < 0.002, f"along {'xyz'[axis]}: {lag} s behind")


def mujoco_wall_is_the_spring_that_is_stated(_):
    world = World()
    x, y, z = world.pose()[0]
    forces = []
    for depth in (0.002, 0.006, 0.012):
        at = held_at(world, [0.43 + depth, y, z])
        forces.append(-at[5])
        check(abs(-at[5] / (at[0] - 0.43) / mujoco_world.STIFFNESS - 1.0) < 0.03, f"{-at[5]} N at {depth} m")
    stiffness = (forces[2] - forces[0]) / 0.01
    print(f"   wall: {stiffness:.1f} N/m", flush=True)
    check(abs(stiffness / mujoco_world.STIFFNESS - 1.0) < 0.03, f"{stiffness} N/m")


def mujoco_plate_is_not_stiffer_than_stated(_):
    world = World()
    x, y, z = world.pose()[0]
    held_at(world, [x, -0.06, z])
    held_at(world, [0.45, -0.06, z])
    same(world.peg_in_hole()[0][2] > 0.015, True, "the peg is in the hole")
    for name, across in [("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])]:
        sides = [held_at(world, np.array([0.45, -0.06, z]) + side * 0.01 * np.array(across)) for side in (0.5, 1.0)]
        one, two = (np.linalg.norm(side[3:6]) for side in sides)
        stiffness = (two - one) / 0.005
        print(f"   plate along {name}: {stiffness:.0f} N/m", flush=True)
        check(0.7 < stiffness / mujoco_world.STIFFNESS < 1.02, f"along {name}: {stiffness} N/m")
        held_at(world, [0.45, -0.06, z])


def mujoco_contacts_give_no_energy(_):
    for speed in (0.02, 0.1):
        world = World()
        start, way = world.pose()[0], 0.042
        path = lambda t: start + [way * 0.5 * (1.0 - math.cos(speed / way * math.pi * t)), 0.0, 0.0]
        rows = followed(world, path, 3 * 2 * way / speed)
        steps, forces = np.diff(rows[:, 0]), -rows[1:, 5]
        check(forces.max() > 8.0, f"the wall was touched with {forces.max()} N")
        work = float(steps @ forces)
        print(f"   three contacts at up to {1.6 * speed:.2f} m/s: {1e3 * work:.1f} mJ into the wall", flush=True)
        check(work > -MUCH_ENERGY, f"{-work} J out of the wall")


def mujoco_contact_at_rest_is_calm(_):
    world = World()
    x, y, z = world.pose()[0]
    way = lambda t: [x + min(0.04, 0.02 * t), y, z]
    wrenches = followed(world, way, 8.0)[-1000:, 3:]
    noise = np.diff(wrenches, axis=0).std(axis=0)
    creep = np.abs(wrenches[-1] - wrenches[0])[:3].max() / (1000 * DT)
    print(f"   from sample to sample {noise[:3].max():.1e} N, {noise[3:].max():.1e} N·m rms; creep {creep:.1e} N/s", flush=True)
    check(noise[:3].max() < 1e-3 and noise[3:].max() < 1e-4, f"{noise}")
    check(creep < 0.02, f"{creep} N/s")


def mujoco_wall_has_a_soft_touch(_):
    world, speed = World(), 0.1
    start = world.pose()[0]
    rows = followed(world, lambda t: start + [speed * t, 0.0, 0.0], 0.5)
    touch = int(np.argmax(rows[:, 0] > 0.43))
    impact = (-rows[touch - 2 : touch + 5, 5]).max()
    print(f"   touched at {speed} m/s: {impact:.1f} N within 10 ms", flush=True)
    check(0.5 < impact < 4.0, f"{impact} N")


def mujoco_arm_holds_where_it_is(_):
    for speed in (0.02, 0.2):
        world = World()
        for _ in range(100):
            world.step(rate(0.0, 0.0, -speed, 0.0, 0.0, 0.0), DT)
        place = world.pose()[0]
        last = [world.step(command, DT) for command in [HOLD] * 500][-1]
        moved = np.linalg.norm(last[1][0] - place)
        check(moved < 1e-3, f"moved {moved} m after {speed} m/s")
    world = World()
    held_at(world, [0.44, *world.pose()[0][1:]])
    place = world.pose()[0]
    for _ in range(500):
        _, (position, _) = world.step(None, DT)
    check(np.linalg.norm(position - place) < 5e-4, f"{position - place} from where it pressed")


def mujoco_arm_keeps_to_its_limits(_):
    world = World()
    places = np.array([world.step(rate(50.0, -50.0, 50.0, 9.0, 9.0, 9.0), DT)[1][0] for _ in range(1500)])
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1).max() / DT
    check(speed < 1.05 * resolved_rate.MAX_SPEED[0], f"{speed} m/s")
    low, high = resolved_rate.WORKSPACE
    check((places > low - 1e-3).all() and (places < high + 1e-3).all(), f"{places.min(0)} to {places.max(0)}")
    check(np.isfinite(places).all(), "no position is invalid")


def mujoco_arm_yields_to_force_in_rate_mode(_):
    world, push = World(), 0.02
    for _ in range(3000):
        wrench, _ = world.step(rate(0.0, 0.0, push, 0.0, 0.0, 0.0), DT)
    expected = push / mujoco_world.ACCOMMODATION[2]
    check(abs(-wrench[2] / expected - 1.0) < 0.02, f"{-wrench[2]} N, expected {expected}")


def mujoco_world_repeats_to_the_last_bit(_):
    def run():
        world = World()
        rng = np.random.default_rng(1997)
        return np.array([world.step(rate(*rng.normal(0.0, 0.05, 6)), DT)[0] for _ in range(500)])

    check((run() == run()).all(), "two runs of the same commands differ")


def configuration_is_that_of_the_mujoco_arm(_):
    done = subprocess.run([FRHC, "check", "--config", ARM_CONFIG], capture_output=True, text=True)
    same(done.returncode, 0, f"frhc check: {done.stderr}")
    ours, figures = tomllib.loads(ARM_CONFIG.read_text()), mujoco_arm.CAPABILITY
    remote = ours.pop("remote")
    link = remote["link"]
    same(remote["servo_time_constant_s"], figures.servo_lag, "servo lag")
    same((remote["max_speed_m_per_s"], remote["max_turn_rad_per_s"]), tuple(figures.max_speed), "speeds")
    k_fa = [remote["accommodation_m_per_ns"]] * 3 + [remote["accommodation_rad_per_nms"]] * 3
    same(k_fa, list(figures.accommodation), "accommodation")
    same(link["stiffest_contact_n_per_m"], figures.stiffest_contact, "stiffest contact")
    same(link["sample_period_ms"] / 1e3, figures.sample_period, "period")
    same((link["sensor_range_n"], link["sensor_range_nm"]), tuple(figures.sensor_range), "sensor's range")
    world = World()
    same(remote["mass_kg"], float(world.model.body("tool").mass[0]), "payload")
    same(remote["centre_of_mass_m"], world.centre_of_mass.tolist(), "its centre of mass")
    same(remote["sensor_m"], (-world.from_s_to_m).tolist(), "sensor")
    theirs = tomllib.loads(CONFIG.read_text().replace('"../eds/', '"../../eds/'))
    theirs.pop("remote")
    theirs["controller"]["mode"] = "pose"
    same(ours, theirs, f"all but [remote] and the mode of {CONFIG.name}")


def peg_env_passes_the_check_of_gymnasium(_):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(PegEnv(), skip_render_check=True)


def random_episodes(seed, count=400):
    """Observations and rewards of random actions."""
    env = PegEnv()
    env.action_space.seed(seed)
    observation, _ = env.reset(seed=seed)
    rows = []
    for _ in range(count):
        observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        check(env.observation_space.contains(observation), f"{observation} is outside of its space")
        rows.append(np.concatenate([*observation.values(), [reward]]))
        if terminated or truncated:
            observation, _ = env.reset()
    return np.array(rows)


def peg_env_is_deterministic_by_its_seed(_):
    one = random_episodes(7)
    check((one == random_episodes(7)).all(), "the same seed gives other episodes")
    check(not (one == random_episodes(8)).all(), "another seed gives the same episodes")


def guided(seed, sideways):
    """Leads the peg by what is observed, with a gain for the way to the axis; returns the greatest force and the last info."""
    env = PegEnv()
    observation, _ = env.reset(seed=seed)
    force = 0.0
    while True:
        # Axes of the hole in those of {MRF}: x is -y, y is x.
        (x, y, z), (dx, dy, _) = observation["tip"], observation["direction"]
        is_at_axis = sideways == 0.0 or math.hypot(x, y) < 0.003
        action = [-sideways * y, sideways * x, 0.015 * is_at_axis, 2.0 * -dx, 2.0 * -dy, 0.0]
        observation, _, terminated, truncated, info = env.step(np.array(action))
        force = max(force, float(np.linalg.norm(observation["wrench"][:3])))
        if terminated or truncated:
            return force, info


def peg_env_rewards_a_peg_that_is_led_to_the_axis(_):
    for seed in range(8):
        force, info = guided(seed, 2.0)
        check(info["is_inserted"], f"seed {seed}: {info}, {force:.1f} N")


def peg_env_feels_the_plate_beside_the_hole(_):
    forces = [guided(seed, 0.0)[0] for seed in range(8)]
    print(f"   pushed as it lies: {min(forces):.1f} to {max(forces):.1f} N", flush=True)
    check(max(forces) > 1.0, f"nothing was felt: {forces}")


TESTS = [
    mujoco_arm_lags_as_its_configuration_says,
    mujoco_wall_is_the_spring_that_is_stated,
    mujoco_plate_is_not_stiffer_than_stated,
    mujoco_contacts_give_no_energy,
    mujoco_contact_at_rest_is_calm,
    mujoco_wall_has_a_soft_touch,
    mujoco_arm_holds_where_it_is,
    mujoco_arm_keeps_to_its_limits,
    mujoco_arm_yields_to_force_in_rate_mode,
    mujoco_world_repeats_to_the_last_bit,
    configuration_is_that_of_the_mujoco_arm,
    peg_env_passes_the_check_of_gymnasium,
    peg_env_is_deterministic_by_its_seed,
    peg_env_rewards_a_peg_that_is_led_to_the_axis,
    peg_env_feels_the_plate_beside_the_hole,
]
