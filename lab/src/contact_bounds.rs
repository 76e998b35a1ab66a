//! Measurement of the bounds of force accommodation: an arm against a wall without damping, or free with a payload. Its
//! gain is a share of a bound of `controller::stability::bounds`.
//!
//! ```text
//!  servo      K_FA k_e τ_s <= 1/4                    from rest at the wall, the tool never turns back
//!  sampled    K_FA k_e T < 2 cos(n π/(2n + 1))       a disturbance of the force at rest dies out; no lag, force n cycles late
//!  payload    K_FA m < T/2 coth(T/2τ_s)              a motion in free space dies out, the inertia of m removed or not
//! ```
//!
//! The arm has no dry friction, which would hide small motions, and no other payload. It starts in contact and stays
//! there, so that the loop is linear.

use std::collections::VecDeque;
use std::time::Duration;

use nalgebra::{Unit, Vector3};
use serde::Serialize;

use crate::no_trial::NoTrial;
use config::Config;
use config::robots::RobotArm;
use controller::stability::bounds;
use remote::site::{Contact, Virtual};
use remote::{Command, Remote};
use robot::accommodation::Accommodation;
use robot::object::{Object, Servo};
use robot::payload::Payload;
use sim::contact::HALF_CUBE;
use sim::manipulator::MAX_STEP;
use testbench::robot_site::{Equipment, ReadingTime, RobotSite};
use units::spatial::{Motion, Twist, Wrench};
use units::time::Instant;

/// Stiffness of the wall, in N/m.
const STIFFNESS: f64 = 1_000.0;

/// Commanded rate for the servo's bound, in m/s.
const SPEED: f64 = 0.02;

/// Duration of a course for the servo's bound, in time constants of the servo.
const LAGS: f64 = 50.0;

/// Backward speed that counts as turning back, as a share of the largest speed.
const TURNS_BACK: f64 = 1e-6;

/// Cycle of the sampled bound, in s: many steps of the simulation.
const CYCLE: f64 = 0.01;

/// Lag of the simulated servos for the sampled bound, in s.
const NO_LAG: f64 = 1e-4;

/// Depth at rest, and its disturbance at the start, in m.
const DEPTH: f64 = 5e-3;
const DISTURBANCE: f64 = 1e-8;

/// Payload, in kg, its distance from the wall in m, and the rate of the first cycle in m/s.
const MASS: f64 = 1.5;
const CLEARANCE: f64 = 0.01;
const KICK: f64 = 1e-6;

/// First cycles of the early and the late window in which the disturbance is measured, and the length of both.
const EARLY: usize = 5;
const LATE: usize = 45;
const WINDOW: usize = 10;

/// Time for the redundant joints to come to rest, in s.
const SETTLING: f64 = 60.0;

/// Bound of force accommodation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    /// K_FA k_e τ_s: no turning back at the wall.
    Servo,
    /// K_FA k_e T, with the force delayed by this number of cycles.
    Sampled(u32),
    /// K_FA m, with or without removal of the payload's inertia.
    Payload {
        /// Set if the inertia is removed, by the joints' motion.
        is_removed: bool,
    },
}

/// Model of an arm at the wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Model {
    /// Joints that follow their rates exactly.
    Kinematic,
    /// Masses, servos and a wrist sensor that reads at the end of the cycle.
    Simulated,
    /// Masses, servos and a wrist sensor that reads the mean of the cycle.
    SimulatedMean,
}

/// Run of one arm with a gain near a bound.
#[derive(Clone, Copy, Debug)]
pub struct Course {
    /// Bound that the gain is compared with.
    pub bound: Bound,
    /// Model of the arm.
    pub model: Model,
    /// Gain as a share of that at the bound.
    pub share: f64,
}

/// Course in figures.
#[derive(Clone, Debug, Serialize)]
pub struct CourseResult {
    /// Name of the robot file.
    pub arm: String,
    /// Bound that the gain is compared with.
    pub bound: Bound,
    /// Model of the arm.
    pub model: Model,
    /// Gain as a share of that at the bound.
    pub share: f64,
    /// Servo: largest backward speed over the largest speed. Others: growth of the disturbance per cycle.
    pub figure: f64,
    /// Set if the tool never turns back, or the disturbance dies out.
    pub is_calm: bool,
}

/// Arm at a wall, with one step per cycle.
#[derive(Debug)]
enum ArmAtWall {
    Kinematic { object: Box<Object>, wall: f64, late: VecDeque<f64> },
    Simulated { site: Box<RobotSite>, now: Instant },
}

impl Course {
    /// Plays the course with an arm that holds the object of `config`.
    ///
    /// # Errors
    /// Returns an error if the arm cannot be simulated.
    pub fn play(&self, config: &Config, arm: &RobotArm) -> Result<CourseResult, NoTrial> {
        let (figure, limit) = match self.bound {
            Bound::Servo => (self.turned_back(config, arm)?, TURNS_BACK),
            Bound::Sampled(delay) => (self.growth_in_contact(config, arm, delay)?, 1.0),
            Bound::Payload { .. } => (self.growth_in_free_space(config, arm)?, 1.0),
        };
        let is_calm = figure < limit;
        let Self { bound, model, share } = *self;
        Ok(CourseResult { arm: arm.name.clone(), bound, model, share, figure, is_calm })
    }

    /// Returns the largest backward speed over the largest speed, from rest at the wall.
    fn turned_back(&self, config: &Config, arm: &RobotArm) -> Result<f64, NoTrial> {
        let (servo, cycle) = (config.remote.servo, config.period.as_secs_f64());
        let yield_rate =
            self.share * bounds::max_yield_rate_without_oscillation(servo.time_constant());
        let mut arm_at_wall = self.arm_at_wall(config, arm, servo, yield_rate, 0.0)?;
        let (mut forwards, mut backwards, mut t) = (0.0_f64, 0.0_f64, 0.0);
        while t < LAGS * servo.time_constant() {
            let speed = arm_at_wall.step(cycle, SPEED);
            (forwards, backwards) = (forwards.max(speed), backwards.max(-speed));
            t += cycle;
        }
        Ok(backwards / forwards)
    }

    /// Returns the growth per cycle of a disturbance of the depth at rest.
    fn growth_in_contact(
        &self,
        config: &Config,
        arm: &RobotArm,
        delay: u32,
    ) -> Result<f64, NoTrial> {
        let lag = if self.model == Model::Kinematic { 0.0 } else { NO_LAG };
        let yield_rate = self.share * bounds::max_yield_rate(CYCLE, delay);
        let servo = Servo::new(lag, 1.0, 1.0)?;
        let mut arm_at_wall =
            self.arm_at_wall(config, arm, servo, yield_rate, DEPTH + DISTURBANCE)?;
        Ok(growth((0..LATE + WINDOW).map(|_| arm_at_wall.step(CYCLE, yield_rate * DEPTH))))
    }

    /// Returns the growth per cycle of a motion in free space.
    fn growth_in_free_space(&self, config: &Config, arm: &RobotArm) -> Result<f64, NoTrial> {
        let (servo, cycle) = (config.remote.servo, config.period.as_secs_f64());
        let most = bounds::max_yielded_inertia(cycle, servo.time_constant());
        let yield_rate = self.share * most / MASS * STIFFNESS;
        let mut arm_at_wall = self.arm_at_wall(config, arm, servo, yield_rate, -CLEARANCE)?;
        let command = |number| if number == 0 { KICK } else { 0.0 };
        Ok(growth((0..LATE + WINDOW).map(|number| arm_at_wall.step(cycle, command(number)))))
    }

    /// Returns the arm at the wall, at a depth in m.
    fn arm_at_wall(
        &self,
        config: &Config,
        arm: &RobotArm,
        servo: Servo,
        yield_rate: f64,
        depth: f64,
    ) -> Result<ArmAtWall, NoTrial> {
        let arm = &prepared(arm);
        let gain = yield_rate / STIFFNESS;
        let mut interaction = config.remote.interaction;
        interaction.accommodation =
            Accommodation::new([gain, gain, gain, 0.0, 0.0, 0.0], [0.0; 6])?;
        let at_origin = interaction.sensor.x_m_s.inverse().translation.vector.into();
        let (payload, delay) = match self.bound {
            Bound::Servo => (Payload::default(), 0),
            Bound::Payload { .. } => (Payload::new(MASS, at_origin)?, 0),
            Bound::Sampled(delay) => {
                (Payload::default(), usize::try_from(delay).unwrap_or(usize::MAX))
            }
        };
        interaction.payload = payload;
        interaction.removes_inertia = self.bound == Bound::Payload { is_removed: true };
        if self.model == Model::Kinematic {
            let following = arm.following();
            let object = Object::new(servo, following.pose())
                .with_interaction(interaction)
                .held_by(following);
            let wall = -depth;
            let late = VecDeque::from(vec![depth * STIFFNESS; delay]);
            return Ok(ArmAtWall::Kinematic { object: Box::new(object), wall, late });
        }
        let x_b_m = arm.following().pose();
        let ahead = x_b_m.rotation * Vector3::z();
        let contact = Contact { stiffness: STIFFNESS, damping: 0.0, friction: 0.0 };
        let point = x_b_m.translation.vector + ahead * (HALF_CUBE - depth);
        let wall = Some((point, Unit::new_normalize(-ahead), contact));
        let config = config.clone().with_robot(arm.clone());
        let remote = Virtual { servo, interaction, wall, ..config.remote.clone() };
        let config = config.with_remote(Virtual { block: None, sphere: None, ..remote });
        let span = if self.model == Model::Simulated { MAX_STEP } else { f64::INFINITY };
        let reading = ReadingTime { span, late: delay };
        let equipment = Equipment { reading, ..Equipment::from_remote(&config.remote) };
        let mut site = RobotSite::new(&config, &equipment, 1)?;
        site.exchange(Instant::ZERO, &Command::HOLD);
        Ok(ArmAtWall::Simulated { site: Box::new(site), now: Instant::ZERO })
    }
}

/// Returns the growth per cycle between the early and the late window of `speeds`, one per cycle.
fn growth(speeds: impl Iterator<Item = f64>) -> f64 {
    let speeds: Vec<f64> = speeds.collect();
    let size = |from: usize| {
        speeds.iter().skip(from).take(WINDOW).fold(0.0, |most: f64, v| most.max(v.abs()))
    };
    let cycles = f64::from(u32::try_from(LATE - EARLY).unwrap_or(u32::MAX));
    (size(LATE) / size(EARLY)).powf(cycles.recip())
}

/// Returns the arm without dry friction, started at the joints where its centring ends.
fn prepared(arm: &RobotArm) -> RobotArm {
    let mut following = arm.following();
    let mut t = 0.0;
    while t < SETTLING {
        following.moved(CYCLE, &Twist::ZERO);
        t += CYCLE;
    }
    let mut arm = arm.clone();
    for (joint, q) in arm.joints.iter_mut().zip(following.q()) {
        joint.start = *q;
        joint.coulomb = 0.0;
    }
    arm
}

impl ArmAtWall {
    /// Commands a rate into the wall for one cycle; returns the speed of the tool into it, in m/s.
    fn step(&mut self, cycle: f64, speed: f64) -> f64 {
        let command = Motion::Rate(Twist::from_components([0.0, 0.0, speed, 0.0, 0.0, 0.0]));
        match self {
            Self::Kinematic { object, wall, late } => {
                late.push_back(STIFFNESS * -wall.min(0.0));
                let force = late.pop_front().unwrap_or_default();
                let f_m = Wrench::from_components([0.0, 0.0, -force, 0.0, 0.0, 0.0]);
                object.step(cycle, &command, &f_m);
                *wall -= object.twist().linear.z * cycle;
                object.twist().linear.z
            }
            Self::Simulated { site, now } => {
                *now = *now + Duration::from_secs_f64(cycle);
                site.exchange(*now, &command.into());
                site.arm().v_m().linear.z
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn rows(bound: Bound, model: Model, share: f64) -> [CourseResult; 2] {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        ["puma560", "eight_r_synthetic"].map(|name| {
            let arm = RobotArm::load(Path::new(&format!("config/robots/{name}.toml"))).unwrap();
            Course { bound, model, share }.play(&config, &arm).unwrap()
        })
    }

    fn assert_calm(bound: Bound, model: Model, share: f64, is_calm: bool) {
        for row in rows(bound, model, share) {
            assert_eq!(row.is_calm, is_calm, "{row:?}");
        }
    }

    #[test]
    fn tool_turns_back_beyond_the_servo_bound_only() {
        for model in [Model::Kinematic, Model::Simulated, Model::SimulatedMean] {
            assert_calm(Bound::Servo, model, 0.9, true);
            assert_calm(Bound::Servo, model, 1.1, false);
        }
    }

    #[test]
    fn disturbance_dies_out_within_the_sampled_bound_only() {
        for (delay, model) in
            [0, 1, 2].into_iter().flat_map(|n| [(n, Model::Kinematic), (n, Model::Simulated)])
        {
            assert_calm(Bound::Sampled(delay), model, 0.9, true);
            assert_calm(Bound::Sampled(delay), model, 1.1, false);
        }
    }

    #[test]
    fn free_arm_shakes_beyond_the_payload_bound_only() {
        // Removal of the inertia raises the bound by a factor of 1.4.
        for (is_removed, most) in [(false, 1.1), (true, 1.5)] {
            assert_calm(Bound::Payload { is_removed }, Model::SimulatedMean, 0.9, true);
            assert_calm(Bound::Payload { is_removed }, Model::SimulatedMean, most, false);
        }
    }

    #[test]
    fn mean_over_the_cycle_counts_as_half_a_cycle() {
        let (model, bound) = (Model::SimulatedMean, |n| bounds::max_yield_rate(CYCLE, n));
        assert_calm(Bound::Sampled(0), model, 0.9, true);
        for delay in [1, 2] {
            assert_calm(Bound::Sampled(delay), model, 0.9, false);
            let next = bound(delay + 1) / bound(delay);
            assert_calm(Bound::Sampled(delay), model, 0.9 * next, true);
        }
    }
}
