//! Plausibility of the drives' samples: one check per fault.
//!
//! ```text
//!  position received     balance ─► jump              sample of this SYNC?      sample_filter
//!                        overdue                      age of the samples        zero torque (S2)
//!  controller has run    speed, frozen, torque        plausible samples?        zero torque (S2)
//!                        held_target                  target taken?             zero torque (S2)
//!                        limits, missing_rate         fit for reflection?       reflection off (S1)
//! ```
//!
//! `zero_torque` raises none: it has the torque actual values at zero target torque, by which a disarm is answered.
//! A check raises a [`Cause`], in every mode; the fault table decides the reaction. A wrong but plausible encoder stays
//! undetected.

mod balance;
mod frozen;
mod held_target;
mod jump;
mod limits;
mod missing_rate;
mod overdue;
mod repeat_detector;
mod sample_filter;
mod sample_set;
mod speed;
mod torque;
mod torque_range;
mod zero_torque;

pub(crate) use frozen::Weight;
pub(super) use sample_filter::{FilterResult, SampleFilter};
pub(super) use sample_set::SampleSet;

use crate::cause::Cause;
use crate::plausibility::frozen::Frozen;
use crate::plausibility::held_target::HeldTarget;
use crate::plausibility::jump::TravelLimit;
use crate::plausibility::limits::Limits;
use crate::plausibility::missing_rate::MissingRate;
use crate::plausibility::speed::{Snapshot, Speed, SpeedLimits};
use crate::plausibility::torque::Torque;
use crate::plausibility::torque_range::TorqueRange;
use crate::plausibility::zero_torque::ZeroTorque;
use config::Config;
use controller::torque_delay::TorqueDelay;
use controller::{JointVector, Output};
use units::drive::PerMille;
use units::numbering::Joint;

/// Clear motion of a revolute joint, in rad: ten times the tremor of a hand.
const CLEAR_ROTATION: f64 = 0.02;

/// Clear motion of a prismatic joint, in m.
const CLEAR_TRANSLATION: f64 = 0.005;

/// All plausibility checks of a cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plausibility {
    initial: Checks,
    checks: Checks,
}

#[derive(Clone, Copy, Debug)]
struct Checks {
    limits: Limits,
    speed: Speed,
    frozen: Frozen,
    torque: Torque,
    held_target: HeldTarget,
    missing_rate: MissingRate,
    zero_torque: ZeroTorque,
    /// Target torques sent, in ‰ of rated torque.
    sent: TorqueDelay<[i16; 6]>,
}

impl Plausibility {
    /// Returns all checks before the first sample.
    pub(super) fn new(config: &Config) -> Self {
        let joints = config.joints.each_ref();
        let settings = &config.plausibility;
        let clear = joints.map(|joint| {
            joint.calibration.span(joint.plant.link.kind.pick([CLEAR_ROTATION, CLEAR_TRANSLATION]))
        });
        let limits = SpeedLimits {
            joints: joints.map(|joint| joint.max_speed),
            grip: settings.max_grip_speed,
        };
        let torque_range = settings
            .torque_tolerance
            .map_or_else(|| TorqueRange::following(config.period), TorqueRange::within);
        let initial = Checks {
            limits: Limits::new(
                joints.map(|joint| joint.plant.link.range),
                joints.map(|joint| settings.limit_margin(joint.plant.link.kind)),
                joints.map(|joint| joint.plant.link.kind),
            ),
            speed: Speed::new(limits, config.period),
            frozen: Frozen::new(settings.frozen, clear),
            torque: Torque::new(torque_range, settings.torque_differs),
            held_target: HeldTarget::new(),
            missing_rate: MissingRate::new(config.period, settings.max_missing_percent),
            zero_torque: ZeroTorque::default(),
            sent: TorqueDelay::new([0; 6]),
        };
        Self { initial, checks: initial }
    }

    /// Clears the history, before the network boots.
    pub(super) const fn restart(&mut self) {
        self.checks = self.initial;
    }

    /// Clears the last positions: the next ones are from other zeros.
    pub(super) const fn on_zero_set(&mut self) {
        self.checks.speed = self.initial.speed;
    }

    /// Checks the samples of a cycle and the output of the controller. Causes of zero torque precede those that end reflection
    /// only. Limits of joints without a known zero are not checked.
    pub(super) fn check(
        &mut self,
        sampled: &SampleSet<'_>,
        output: &Output,
        weight: Weight,
        known: &[bool; 6],
    ) -> Option<Cause> {
        let checks = &mut self.checks;
        let is_complete = sampled.fresh == [true; 6];
        let p_0_g = output.x_0_g.translation.vector;
        let snapshot = is_complete.then_some(Snapshot { at: sampled.at, q: output.q, p_0_g });
        let speed = snapshot.and_then(|snapshot| checks.speed.check(&snapshot));
        let frozen = checks.frozen.check(sampled, &checks.sent.acted(), weight);
        let torque = checks.torque.check(sampled);
        let held = checks.held_target.check(&sampled.demands);
        checks.zero_torque.on_samples(sampled);
        let limits = checks.limits.check(&output.q, known);
        let missing = checks.missing_rate.end_cycle(&sampled.fresh);
        speed.or(frozen).or(held).or(torque).or(limits).or(missing)
    }

    /// Takes the target torques sent to the drives, in ‰ of rated torque.
    pub(super) fn on_sent(&mut self, targets: &[i16; 6]) {
        self.checks.sent.push(*targets);
        self.checks.torque.on_sent(targets);
        self.checks.held_target.on_sent(targets);
        self.checks.zero_torque.on_sent(targets);
    }

    /// Returns the newest torque actual value (6077h) of each joint since zero target torque acts.
    pub(super) const fn torques_at_zero(&self) -> [Option<PerMille>; 6] {
        self.checks.zero_torque.shown()
    }

    /// Returns the joints whose drives are the likeliest to hold another target than was sent.
    pub(super) fn suspects(&self) -> [bool; 6] {
        let (suspect, off) = (self.checks.torque.is_suspect(), self.checks.held_target.was_off());
        Joint::ALL.map(|joint| *joint.entry(&suspect) || *joint.entry(&off))
    }

    /// Records that the target torque (6071h) of a drive is requested now.
    pub(super) fn on_target_requested(&mut self, joint: Joint) {
        self.checks.held_target.on_requested(joint);
    }

    /// Checks the target torque (6071h) that a drive replied; `None` if it cannot be read.
    pub(super) fn on_target_read(
        &mut self,
        joint: Joint,
        taken: Option<PerMille>,
    ) -> Option<Cause> {
        self.checks.held_target.on_reply(joint, taken)
    }
}

/// Returns the sample filters of all joints.
pub(super) fn sample_filters(config: &Config) -> [SampleFilter; 6] {
    // Coupled actuators can be faster than every joint's limit.
    let joints = JointVector::from(config.joints.each_ref().map(|joint| joint.max_speed));
    let actuators: [f64; 6] = config.controller.calibration.coupling().fastest(&joints).into();
    let max_missed = config.safety.missing_samples;
    Joint::ALL.map(|joint| {
        let per_second = joint.entry(&config.joints).calibration.span(*joint.entry(&actuators));
        let limit = TravelLimit::new(per_second, config.period);
        SampleFilter::new(joint, config.period, max_missed, limit)
    })
}
