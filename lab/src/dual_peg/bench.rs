//! Hand controller, robot, pegs and plate of one trial.
//!
//! The robot always starts at the same joint positions, and the plate is placed in front of the pegs with a misalignment.
//! The operator model decides on a twist from the pegs' pose; the hand aims at `ΔX = v / K_V + DB`, which commands it.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::dual_peg::condition::Condition;
use crate::dual_peg::peg_operator::{PegOperator, PegOperatorSettings};
use crate::dual_peg::settings::DualPeg;
use crate::opening;
use config::Config;
use node::record::Record;
use sim::contact::{Plate, Scene, Shape};
use sim::operator_settings::OperatorSettings;
use sim::random::SplitMix;
use sim::scenario::{ConsoleRequest, Scenario};
use testbench::bench::Bench;
use testbench::robot_site::{Equipment, NoRobot, ReadingTime, RobotSite};
use units::spatial::Twist;

/// Time from the start of the scenario until the operator begins, in s.
const BEGIN_S: f64 = 2.2;

/// Speed of an axis below which the hand aims at its reference, in m/s or rad/s.
const STILL: f64 = 3e-4;

/// Time constant of the hand's motion to a new aim, in s.
const AIM_LAG: f64 = 0.08;

/// Initial pose and visual error of one trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Situation {
    /// Pose of the pegs' ends {E} in the frame of the plate {P}.
    x_p_e: Isometry3<f64>,
    /// Visual error of the position, in m.
    visual_error: f64,
    /// Visual error of the orientation, in rad.
    visual_turn_error: f64,
    /// Seed of visual error, search, tremor and sensor.
    seed: u64,
}

impl Situation {
    /// Draws the initial pose from `seed`: offset in m and turn in rad, each between two bounds.
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

/// Running trial.
#[derive(Debug)]
pub struct PegBench {
    bench: Bench<()>,
    operator: PegOperator,
    x_b_p: Isometry3<f64>,
    x_m_e: Isometry3<f64>,
    k_v: [f64; 6],
    /// Displacement of the aim at which a command begins, in m and rad: the deadband plus the hand's deflection. The
    /// operator compensates this deflection, which the return to centre causes.
    threshold: [f64; 6],
    /// Displacement of the hand from its reference, in m and rad.
    aim: [f64; 6],
    period: f64,
}

impl PegBench {
    /// Creates a trial of an operator in a condition, and boots the drives.
    ///
    /// # Errors
    /// Returns an error if the robot, pegs or plate cannot be simulated, or the drives do not boot.
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

    /// Returns the simulated robot; `None` with a virtual object.
    pub fn robot(&self) -> Option<&RobotSite> {
        self.bench.side().robot()
    }

    /// Returns the time since the operator began, in s.
    pub fn seconds(&self) -> f64 {
        self.bench.elapsed().as_secs_f64() - BEGIN_S
    }

    /// Returns the number of attempts of the operator, the running one included.
    pub const fn attempts(&self) -> u32 {
        self.operator.attempts()
    }

    /// Runs one cycle; the operator acts from `BEGIN_S` on.
    pub fn cycle(&mut self) -> Record {
        if self.bench.elapsed().as_secs_f64() >= BEGIN_S {
            self.operate();
        }
        self.bench.cycle()
    }

    /// Steps the operator model with the pegs' misalignment, and moves the aim of the hand.
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

/// Returns the displacement at which a command of each axis begins, in m and rad.
fn threshold(config: &Config, operator: &OperatorSettings) -> [f64; 6] {
    let [x, y, z, about_x, about_y, about_z] = config.controller.channels.plateaus();
    let lean = [x, y, z].map(|force| operator.deflection(force));
    let turn = [about_x, about_y, about_z].map(|moment| operator.turn_deflection(moment));
    let mut threshold = config.controller.channels.deadbands();
    let leads = lean.into_iter().chain(turn);
    threshold.iter_mut().zip(leads).for_each(|(threshold, lead)| *threshold += lead);
    threshold
}

/// Returns a script in rate mode, armed, with deadman and reflection on before [`BEGIN_S`].
fn scenario(seconds: f64) -> Result<Scenario, NoRobot> {
    let entries = opening::engaged(ConsoleRequest::Rate, [1.6, 1.7, 1.8]);
    Ok(Scenario::new(BEGIN_S + seconds + 1.0, entries)?)
}

/// Returns the preset of this name; `None` for an unknown name.
pub fn operator(name: &str) -> Option<OperatorSettings> {
    match name {
        "steady" => Some(OperatorSettings::STEADY),
        "relaxed" => Some(OperatorSettings::RELAXED),
        "firm" => Some(OperatorSettings::FIRM),
        "nervous" => Some(OperatorSettings::NERVOUS),
        _ => None,
    }
}
