//! `frhc ctl park`: the hold brings an armed arm back to its rest posture while the deadman is held.
//!
//! A power-up then finds it there, for the [rest posture](crate::rest) and for zeros that are set by it.

use thiserror::Error;

use crate::Node;
use crate::cause::Cause;
use crate::joint_reading::JointReading;
use crate::safety::Refusal;
use bus::Bus;
use controller::arm::JointKind;
use controller::hold::HoldState;
use controller::hold::weight::TooHeavy;
use controller::{JointVector, Output};
use remote::Remote;
use units::numbering::Joint;
use units::time::Instant;
use units::wording::listed;

/// Share of the maximum speed on a way that was not travelled before.
const FIRST_SPEED: f64 = 0.5;

/// Reason why the arm cannot be parked.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ParkError {
    /// The rest posture is not stated for each joint.
    #[error("no rest posture to park in: rest_deg (rest_m) is missing for {}", listed(.0))]
    NoRest(Vec<String>),
    /// An actuator cannot carry the arm on the way.
    #[error("the way to the rest posture is too heavy: {0}; move the arm nearer to it by hand")]
    TooHeavy(#[from] TooHeavy),
    /// The mode or the deadman does not allow it.
    #[error(transparent)]
    Refused(#[from] Refusal),
}

impl<B: Bus, R: Remote> Node<B, R> {
    /// Enters `Measuring` with the rest posture as the goal of the hold. Nothing moves before the deadman is held.
    ///
    /// # Errors
    /// When a joint has no rest position, the way is too heavy, or the mode does not allow it.
    pub(crate) fn park(&mut self, now: Instant) -> Result<(), ParkError> {
        let goal = self.rest.goal(&self.joint_names, FIRST_SPEED).map_err(ParkError::NoRest)?;
        self.control.check_way(&self.positions(), &goal.q)?;
        self.safety.measure(now, self.operator.enable_state())?;
        self.control.set_hold(Some(goal));
        Ok(())
    }

    /// Returns the joint positions of the newest samples, in rad or m.
    fn positions(&self) -> JointVector {
        self.zeros.positions_with(&[false; 6], self.samples.latest())
    }
}

/// Returns the cause of a hold that has failed.
pub(crate) fn cause(output: &Output, kinds: &[JointKind; 6]) -> Option<Cause> {
    let reading =
        |joint: Joint| Some(JointReading::new(*output.q.get(joint.index())?, *joint.entry(kinds)));
    match output.hold?.state {
        HoldState::Waiting | HoldState::Moving | HoldState::Arrived => None,
        HoldState::Blocked(joint) => Some(Cause::Blocked { joint, position: reading(joint)? }),
        HoldState::NotFollowing(joint) => {
            Some(Cause::NotFollowing { joint, position: reading(joint)? })
        }
    }
}
