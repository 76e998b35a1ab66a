//! One trial of the dual peg and its figures.

use serde::Serialize;

use crate::dual_peg::bench::{PegBench, Situation};
use crate::dual_peg::condition::Condition;
use crate::dual_peg::contact_work::ContactWork;
use crate::dual_peg::settings::DualPeg;
use sim::operator_settings::OperatorSettings;
use telemetry::shaking::Shaking;
use testbench::robot_site::NoRobot;
use units::spatial::Twist;

/// Force at which the contact phase begins, in N.
const CONTACT: f64 = 0.5;

/// Outcome of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Both pegs have reached the insertion depth.
    Inserted,
    /// Stop of the arm at its wrench limit.
    ArmStopped,
    /// Stop of the hand controller by the node.
    NodeStopped,
    /// End of the time limit.
    TimedOut,
}

/// Figures of one trial.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// Name of the operator's preset.
    pub operator: String,
    /// Positions of the switches.
    pub condition: Condition,
    /// Number of the trial, which selects its initial pose.
    pub number: u32,
    /// Success, stop or time limit.
    pub outcome: Outcome,
    /// Time from the operator's start to the end, in s.
    pub seconds: f64,
    /// Time since the first contact, in s.
    pub contact_seconds: f64,
    /// Number of attempts.
    pub attempts: u32,
    /// Eq. 11 as printed, per component of {MRF}, in J.
    pub literal_j: [f64; 6],
    /// `∫ |F dξ|` per component, in J.
    pub absolute_j: [f64; 6],
    /// Largest contact force, in N.
    pub peak_n: f64,
    /// Largest contact moment at {MRF}, in N·m.
    pub peak_nm: f64,
    /// Mean contact force over the contact phase, in N.
    pub mean_n: f64,
    /// Mean contact moment over the contact phase, in N·m.
    pub mean_nm: f64,
    /// Shaking of the arm in free motion.
    #[serde(skip)]
    pub shaking: Option<Shaking>,
}

impl Trial {
    /// Plays a trial.
    ///
    /// # Errors
    /// As [`PegBench::new`].
    pub fn play(
        settings: &DualPeg,
        condition: Condition,
        (name, operator): (&str, OperatorSettings),
        number: u32,
        situation: &Situation,
    ) -> Result<Self, NoRobot> {
        let mut bench = PegBench::new(settings, condition, operator, situation)?;
        let mut phase = ContactPhase::default();
        let mut shaking = Shaking::default();
        let outcome = loop {
            let record = bench.cycle();
            shaking.add(&record.f_s, bench.period());
            let Some(robot) = bench.robot() else { return Err(NoRobot::NoArm) };
            let arm = robot.arm();
            let (f_m, x_b_m) = (*arm.f_m_contact(), *arm.x_b_m());
            phase.add(&f_m, &x_b_m, bench.period());
            let insertions = arm.contact().insertions(&x_b_m);
            let is_deep = |depth: f64| depth >= settings.task.insert_depth;
            if insertions.iter().all(|peg| peg.is_some_and(|peg| is_deep(peg.depth))) {
                break Outcome::Inserted;
            } else if robot.control().is_stopped() {
                break Outcome::ArmStopped;
            } else if record.cause.is_some() {
                break Outcome::NodeStopped;
            } else if bench.seconds() >= settings.max_seconds {
                break Outcome::TimedOut;
            }
        };
        let ContactPhase { work, seconds, peak, mean, .. } = phase;
        let ([peak_n, peak_nm], [sum_n, sum_nm]) = (peak, mean);
        let over = |sum: f64| if seconds > 0.0 { sum / seconds } else { 0.0 };
        Ok(Self {
            operator: name.to_owned(),
            condition,
            number,
            outcome,
            seconds: bench.seconds(),
            contact_seconds: seconds,
            attempts: bench.attempts(),
            literal_j: work.literal_parts(),
            absolute_j: work.absolute_parts(),
            peak_n,
            peak_nm,
            mean_n: over(sum_n),
            mean_nm: over(sum_nm),
            shaking: shaking.reported(),
        })
    }

    /// Returns Eq. 11 as printed, in J.
    pub fn literal(&self) -> f64 {
        self.literal_j.iter().sum()
    }

    /// Returns `Σ ∫ |F dξ|`, in J.
    pub fn absolute(&self) -> f64 {
        self.absolute_j.iter().sum()
    }
}

/// Sums from the first contact on.
#[derive(Default)]
struct ContactPhase {
    has_begun: bool,
    before: Option<nalgebra::Isometry3<f64>>,
    work: ContactWork,
    seconds: f64,
    peak: [f64; 2],
    mean: [f64; 2],
}

impl ContactPhase {
    /// Adds a cycle of `dt` s that ended at `x_b_m`.
    fn add(&mut self, f_m: &units::spatial::Wrench, x_b_m: &nalgebra::Isometry3<f64>, dt: f64) {
        let (force, moment) = (f_m.force.norm(), f_m.moment.norm());
        self.has_begun |= force >= CONTACT;
        let before = self.before.replace(*x_b_m).unwrap_or(*x_b_m);
        if self.has_begun {
            self.work.add(f_m, &Twist::reaching(&(before.inverse() * x_b_m), 1.0));
            self.seconds += dt;
            self.peak = [self.peak[0].max(force), self.peak[1].max(moment)];
            self.mean = [self.mean[0] + force * dt, self.mean[1] + moment * dt];
        }
    }
}
