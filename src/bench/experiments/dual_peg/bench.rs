//! Hand controller, robot, pegs and plate of one trial.
//!
//! The plate stands in front of the pegs, misaligned; the robot always starts with the same joints. The operator sees the
//! pegs and decides on a twist; the hand aims at the displacement that commands it, `ΔX = v / K_V + DB`.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::dual_peg::condition::Condition;
use crate::dual_peg::settings::DualPeg;
use crate::opening;
use config::Config;
use node::record::Record;
use sim::contact::{Plate, Scene, Shape};
use sim::operator_settings::OperatorSettings;
use sim::peg_operator::{PegOperator, PegOperatorSettings};
use sim::random::SplitMix;
use sim::scenario::{ConsoleRequest, Scenario};
use testbench::bench::Bench;
use testbench::robot_site::{Equipment, NoRobot, ReadingTime, RobotSite};
use units::spatial::Twist;

/// Time from the start of the scenario until the operator begins, in s.
const BEGIN_S: f64 = 2.2;

/// Speed below which the hand stays where nothing is commanded, in m/s or rad/s.
const STILL: f64 = 3e-4;

/// Time constant of the hand's way to a new aim, in s.
const AIM_LAG: f64 = 0.08;

/// Start and sight of one trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Situation {
    /// Pose of the pegs' ends in the plate.
    x_p_e: Isometry3<f64>,
    /// Error of sight, in m.
    visual_error: f64,
    /// The same of orientation, in rad.
    visual_turn_error: f64,
    /// Seed of sight, search, tremor and sensor.
    seed: u64,
}

impl Situation {
    /// Draws the start of a trial from `seed`: misalignments in m and rad between two bounds each.
    pub fn drawn(
        settings: &DualPeg,
        seed: u64,
        offset: [f64; 2],
        turn: [f64; 2],
        visual_error: f64,
    ) -> Self {
        let mut random = SplitMix::new(seed ^ 0x5EED_0F9E_6000_0001);
        let mut between = |[low, high]: [f64; 2]| low + (high - low) * random.unit();
        let (offset, turn) = (between(offset), between(turn));
        let direction = between([0.0, std::f64::consts::TAU]);
        let axis = between([0.0, std::f64::consts::TAU]);
        let along = UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI);
        let tilt = Vector3::new(axis.cos(), axis.sin(), 0.5 * axis.cos()).normalize() * turn;
        let place =
            Vector3::new(offset * direction.cos(), offset * direction.sin(), settings.start_height);
        let rotation = UnitQuaternion::from_scaled_axis(tilt) * along;
        let share = visual_error / settings.task.visual_error.max(f64::MIN_POSITIVE);
        Self {
            x_p_e: Isometry3::from_parts(Translation3::from(place), rotation),
            visual_error,
            visual_turn_error: settings.task.visual_turn_error * share.min(10.0),
            seed,
        }
    }
}

/// A running trial.
#[derive(Debug)]
pub struct PegBench {
    bench: Bench<()>,
    operator: PegOperator,
    x_b_p: Isometry3<f64>,
    x_m_e: Isometry3<f64>,
    k_v: [f64; 6],
    /// Displacement of the aim at which a command begins, in m and rad: the deadband, and the way by which the hand
    /// leads against the return to centre, which the operator knows.
    threshold: [f64; 6],
    /// Displacement of the hand from its reference, in m and rad.
    aim: [f64; 6],
    period: f64,
}

impl PegBench {
    /// Creates a trial of an operator in a condition, and boots the drives.
    ///
    /// # Errors
    /// A robot, pegs or plate that cannot be simulated, or drives that do not boot.
    pub fn new(
        settings: &DualPeg,
        condition: Condition,
        operator: OperatorSettings,
        situation: &Situation,
    ) -> Result<Self, NoRobot> {
        let config = condition.applied(&settings.config);
        let x_m_e = settings.pegs.x_m_e();
        let x_b_p = config.remote.x_b_m * x_m_e * situation.x_p_e.inverse();
        let plate = Plate { x_b_p, ..settings.plate };
        let equipment = Equipment {
            shape: Shape::Pegs(settings.pegs),
            scene: Scene { plate: Some(plate), ..Scene::default() },
            sensor: settings.sensor,
            reading: ReadingTime::MEAN,
            limit: settings.stop,
        };
        let site = RobotSite::in_free_space(&config, &equipment, situation.seed)?;
        let scenario = scenario(settings.max_seconds)?.with_operator(operator);
        let bench = Bench::with_side(&config, site.into(), scenario, situation.seed, ());
        let Situation { visual_error, visual_turn_error, seed, .. } = *situation;
        let task = PegOperatorSettings { visual_error, visual_turn_error, ..settings.task };
        let mut trial = Self {
            bench,
            threshold: threshold(&config, &operator),
            operator: PegOperator::new(task, seed),
            x_b_p,
            x_m_e,
            k_v: *config.controller.command.rate_gain.values(),
            aim: [0.0; 6],
            period: config.period.as_secs_f64(),
        };
        trial.bench.bring_up()?;
        Ok(trial)
    }

    /// Returns the duration of a cycle, in s.
    pub const fn period(&self) -> f64 {
        self.period
    }

    /// Returns the robot.
    pub fn robot(&self) -> Option<&RobotSite> {
        self.bench.side().robot()
    }

    /// Returns the time since the operator began, in s.
    pub fn seconds(&self) -> f64 {
        self.bench.elapsed().as_secs_f64() - BEGIN_S
    }

    /// Returns how often the operator has begun.
    pub const fn attempts(&self) -> u32 {
        self.operator.attempts()
    }

    /// Runs one cycle; the operator acts from two seconds on.
    pub fn cycle(&mut self) -> Record {
        if self.bench.elapsed().as_secs_f64() >= BEGIN_S {
            self.operate();
        }
        self.bench.cycle()
    }

    /// Has the operator look, and aim the hand.
    fn operate(&mut self) {
        let Some(robot) = self.bench.side().robot() else { return };
        let x_b_m = *robot.pose();
        let Some(pegs) = robot.arm().contact().misalignment(&x_b_m) else { return };
        let wanted = self.operator.step(self.period, &pegs);
        // From the plate's axes at {E} to {M}.
        let r_e_p = (x_b_m * self.x_m_e).rotation.inverse() * self.x_b_p.rotation;
        let v_e = Twist { linear: r_e_p * wanted.linear, angular: r_e_p * wanted.angular };
        let v_m = v_e.at(&self.x_m_e);
        let part = -(-self.period / AIM_LAG).exp_m1();
        let axes =
            self.aim.iter_mut().zip(v_m.components()).zip(self.k_v.iter().zip(&self.threshold));
        for ((aim, v), (k_v, threshold)) in axes {
            let displaced = if v.abs() > STILL { v / k_v + threshold.copysign(v) } else { 0.0 };
            *aim += (displaced - *aim) * part;
        }
        let [x, y, z, a, b, c] = self.aim;
        let displaced = Isometry3::new([x, y, z].into(), [a, b, c].into());
        let world = self.bench.world_mut();
        let x_0_d = world.x_0_start() * displaced;
        world.set_aim(Some(x_0_d));
    }
}

/// Returns the displacement at which a command of each axis begins.
fn threshold(config: &Config, operator: &OperatorSettings) -> [f64; 6] {
    let [x, y, z, about_x, about_y, about_z] = config.controller.channels.plateaus();
    let lean = [x, y, z].map(|force| operator.deflection(force));
    let turn = [about_x, about_y, about_z].map(|moment| operator.turn_deflection(moment));
    let mut threshold = config.controller.channels.deadbands();
    let leads = lean.into_iter().chain(turn);
    threshold.iter_mut().zip(leads).for_each(|(threshold, lead)| *threshold += lead);
    threshold
}

/// Rate mode, armed; deadman and reflection switch on before the operator begins.
fn scenario(seconds: f64) -> Result<Scenario, NoRobot> {
    let entries = opening::engaged(ConsoleRequest::Rate, [1.6, 1.7, 1.8]);
    Ok(Scenario::new(BEGIN_S + seconds + 1.0, entries)?)
}

/// Returns the operator of a preset's name.
pub fn operator(name: &str) -> Option<OperatorSettings> {
    match name {
        "steady" => Some(OperatorSettings::STEADY),
        "relaxed" => Some(OperatorSettings::RELAXED),
        "firm" => Some(OperatorSettings::FIRM),
        "nervous" => Some(OperatorSettings::NERVOUS),
        _ => None,
    }
}
