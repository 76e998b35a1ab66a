//! Whether what the drives say can be: one small watch for each way in which it cannot.
//!
//! ```text
//!  a position comes      credit ─► jump               is it the sample of this SYNC?      (intake)
//!                        overdue                      how old may it be?                  S2
//!  the controller has    speed, frozen, torque        can the samples be true?            S2
//!  stepped               limits, rate                 may the arm go on being felt?       S1
//! ```
//!
//! A watch raises a [`Cause`]; what follows from it only the fault table says. None of them looks at the mode.
//! A sample that could be true and is not passes: nobody can see a plausible but wrong encoder.

mod credit;
mod frozen;
mod intake;
mod jump;
mod limits;
mod overdue;
mod rate;
mod repeated;
mod sampled;
mod speed;
mod torque;

pub(super) use intake::Intake;
pub(super) use intake::Offer;
pub(super) use sampled::Sampled;

use crate::cause::Cause;
use crate::plausibility::frozen::Frozen;
use crate::plausibility::jump::Reach;
use crate::plausibility::limits::Limits;
use crate::plausibility::rate::Rate;
use crate::plausibility::speed::Moment;
use crate::plausibility::speed::Most;
use crate::plausibility::speed::Speed;
use crate::plausibility::torque::Torque;
use config::Config;
use controller::JointVector;
use controller::Output;
use controller::arm::JointKind;
use controller::torque_delay::TorqueDelay;
use units::numbering::Joint;

/// A clear motion of a joint that turns, in rad: ten times what a hand trembles.
const CLEAR_TURN: f64 = 0.02;

/// The same of one that slides, in m.
const CLEAR_SLIDE: f64 = 0.005;

/// All watches that look at a whole cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plausibility {
    anew: Watches,
    watches: Watches,
}

#[derive(Clone, Copy, Debug)]
struct Watches {
    limits: Limits,
    speed: Speed,
    frozen: Frozen,
    torque: Torque,
    rate: Rate,
    /// Target torques sent, in ‰ of rated torque.
    sent: TorqueDelay<[i16; 6]>,
}

impl Plausibility {
    /// Nothing seen yet.
    pub(super) fn new(config: &Config) -> Self {
        let joints = config.joints.each_ref();
        let watched = &config.plausibility;
        let clear = joints.map(|joint| {
            let clear = match joint.plant.link.kind {
                JointKind::Revolute => CLEAR_TURN,
                JointKind::Prismatic => CLEAR_SLIDE,
            };
            joint.calibration.span(clear)
        });
        let most =
            Most { joints: joints.map(|joint| joint.max_speed), grip: watched.max_grip_speed };
        let anew = Watches {
            limits: Limits::new(
                joints.map(|joint| joint.plant.link.range),
                joints.map(|joint| watched.limit_margin(joint.plant.link.kind)),
            ),
            speed: Speed::new(most, config.period),
            frozen: Frozen::new(watched.frozen, clear),
            torque: Torque::new(watched.torque_tolerance, watched.torque_differs),
            rate: Rate::new(config.period, watched.max_missing_percent),
            sent: TorqueDelay::new([0; 6]),
        };
        Self { anew, watches: anew }
    }

    /// The network starts anew: what was before does not count.
    pub(super) const fn restart(&mut self) {
        self.watches = self.anew;
    }

    /// Takes what a cycle has brought, and what the controller has made of it. `is_carried` unless the weight
    /// of the arm is being laid down, or lies.
    pub(super) fn judge(
        &mut self,
        sampled: &Sampled<'_>,
        output: &Output,
        is_carried: bool,
    ) -> Option<Cause> {
        if !is_carried {
            self.watches.frozen.forget();
        }
        self.watches.judge(sampled, output)
    }

    /// Takes the target torques that the drives hold, in ‰ of rated torque.
    pub(super) fn on_sent(&mut self, targets: &[i16; 6]) {
        self.watches.sent.push(*targets);
        self.watches.torque.tell(targets);
    }
}

impl Watches {
    /// What takes torque off comes before what only ends its reflection.
    fn judge(&mut self, sampled: &Sampled<'_>, output: &Output) -> Option<Cause> {
        let is_complete = sampled.fresh == [true; 6];
        let p_0_g = output.x_0_g.translation.vector;
        let moment = is_complete.then_some(Moment { at: sampled.at, q: output.q, p_0_g });
        let speed = moment.and_then(|moment| self.speed.judge(&moment));
        let frozen = self.frozen.judge(sampled, &self.sent.acted());
        let torque = self.torque.judge(sampled);
        let limits = self.limits.judge(&output.q);
        let rate = self.rate.end(&sampled.fresh);
        speed.or(frozen).or(torque).or(limits).or(rate)
    }
}

/// What takes in each joint's positions.
pub(super) fn intakes(config: &Config) -> [Intake; 6] {
    // What each actuator turns at most while every joint moves no faster than it may.
    let most = JointVector::from(config.joints.each_ref().map(|joint| joint.max_speed));
    let most = config.controller.calibration.coupling().fastest(&most);
    let patience = config.safety.missing_samples;
    let fastest: [f64; 6] = most.into();
    Joint::ALL.map(|joint| {
        let reach = joint.entry(&config.joints).calibration.span(*joint.entry(&fastest));
        Intake::new(joint, config.period, patience, Reach::new(reach, config.period))
    })
}
