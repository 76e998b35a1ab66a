//! Input and output of one cycle, with every intermediate of Fig. 3.

use nalgebra::Isometry3;
use serde::Serialize;
use thiserror::Error;

use crate::JointVector;
use crate::adjustment::Adjusted;
use crate::command::Gate;
use crate::port::Passed;
use crate::reference::{Displacement, Reference};
use crate::switches::{Mode, Pressed, Switches};
use crate::velocity::Moving;
use units::drive::{Counts, PerMille};
use units::numbering::Joint;
use units::spatial::{Jacobian, Motion, Wrench};

/// Targets that the drives hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveTargets {
    /// Those sent.
    Sent([PerMille; 6]),
    /// Zero: those sent were withdrawn after a stall. Torques rise from zero again.
    Withdrawn,
}

impl DriveTargets {
    /// Returns the target of each drive.
    pub const fn targets(self) -> [PerMille; 6] {
        match self {
            Self::Sent(targets) => targets,
            Self::Withdrawn => [PerMille(0); 6],
        }
    }
}

/// Input of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Actual positions of the drives (6064h).
    pub counts: [Counts; 6],
    /// The wrench of the environment on the object, at the sensor {S}, payload removed.
    pub f_s: Wrench,
    /// Pose of the object, in its base.
    pub x_b_m: Isometry3<f64>,
    /// Closed switches.
    pub switches: Switches,
    /// Meaning of a displacement: rate or pose.
    pub mode: Mode,
    /// Share of the arm's weight to compensate, 0 to 1; ramped by the caller.
    pub gravity_share: f64,
    /// Share of task and assist to reflect, 0 to 1; ramped by the caller.
    pub reflection_share: f64,
    /// Targets that the drives hold since the last cycle; `None` where they are those of its output.
    pub held: Option<DriveTargets>,
    /// Forget earlier cycles: this is the first one, or follows an overrun.
    pub restart: bool,
}

/// Output of one cycle, with every intermediate of Fig. 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// Joint positions, in rad or m.
    pub q: JointVector,
    /// The first joint outside its range.
    pub joint_out_of_range: Option<Joint>,
    /// The grip's pose (Eq. 1).
    pub x_0_g: Isometry3<f64>,
    /// Permissions and requests of the switches.
    pub pressed: Pressed,
    /// Reference from this cycle on.
    pub reference: Reference,
    /// The grip's pose seen from the reference (Eq. 2, 3).
    pub x_h_g: Isometry3<f64>,
    /// The same as six numbers (Eq. 4).
    pub dx: Displacement,
    /// The same less the deadband: the part that commands.
    pub dx_db: Displacement,
    /// Gate of the operator's command.
    pub gate: Gate,
    /// Command for the object (Eq. 5, 3.5).
    pub command: Motion,
    /// Scales, locks and alignment from this cycle on.
    pub adjusted: Adjusted,
    /// Twist of the grip, in {G}.
    pub moving: Moving,
    /// The wrench on the object at {MRF} (Eq. 6), or that of the virtual coupling, felt or not.
    pub f_m_task: Wrench,
    /// The part of it to reflect, at {G}.
    pub f_g_task: Wrench,
    /// Wrench that keeps the reflection port passive, at {G}, with the energies it is computed from.
    pub port: Passed,
    /// The return to centre, at {G} (Eq. 8).
    pub f_g_centring: Wrench,
    /// Damping, at {G} (Eq. 9).
    pub f_g_damping: Wrench,
    /// The Jacobian of {G} in {G}.
    pub j_g: Jacobian<6>,
    /// Components of every joint's torque.
    pub ledger: Ledger,
    /// Commanded joint torques (Eq. 10), in N·m or N.
    pub tau: JointVector,
    /// The same as target torques (6071h, Fig. 6).
    pub targets: [PerMille; 6],
    /// The worst fault, if any. The torques are safe to send all the same.
    pub fault: Option<Fault>,
}

/// Torque budget of one cycle: every request, and the scales applied to it. In N·m or N. It serializes as the `budget` of a
/// status.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ledger {
    /// The task (Eq. 7).
    pub task: JointVector,
    /// Gravity compensation times its share.
    pub gravity: JointVector,
    /// The return to centre, before its scaling.
    pub centring: JointVector,
    /// Damping, before its scaling.
    pub damping: JointVector,
    /// Damper of the passivity layer.
    pub passivity: JointVector,
    /// The soft stops.
    pub soft_stops: JointVector,
    /// Friction compensation, times the share of the engagement ramp.
    pub friction: JointVector,
    /// Joint that its friction compensation drove without a hand: the compensation is withdrawn until the next arming.
    #[serde(skip)]
    pub self_driven: Option<Joint>,
    /// Scale of return to centre and damping, 0 to 1.
    pub assist_scale: f64,
    /// Scale of task and assist together, 0 to 1.
    pub rest_scale: f64,
    /// Share of task and assist that is reflected at all, 0 to 1.
    #[serde(skip)]
    pub share: f64,
    /// Joint that set the scale.
    pub limiting_joint: Option<Joint>,
    /// First joint whose torque was limited in its rate of change.
    pub slewing_joint: Option<Joint>,
}

impl Ledger {
    /// No requests.
    pub(crate) fn nothing() -> Self {
        let none = JointVector::zeros();
        Self {
            task: none,
            gravity: none,
            centring: none,
            damping: none,
            passivity: none,
            soft_stops: none,
            friction: none,
            self_driven: None,
            assist_scale: 1.0,
            rest_scale: 1.0,
            share: 1.0,
            limiting_joint: None,
            slewing_joint: None,
        }
    }

    /// Torques that carry the arm's weight and overcome its friction: the arm takes them, not the hand.
    pub fn carried(&self) -> JointVector {
        self.gravity + self.friction * (self.rest_scale * self.share)
    }
}

impl Output {
    /// Returns whether a joint at its capacity reduces the reflected wrench.
    pub const fn is_saturated(&self) -> bool {
        self.ledger.limiting_joint.is_some()
    }
}

/// An invalid value that was replaced. Worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Fault {
    /// All torques were replaced by zero.
    #[error("a torque is not a finite number")]
    TorqueNotFinite,
    /// Reflection is zero.
    #[error("the sensed wrench is not finite")]
    WrenchNotFinite,
    /// Reflection is zero.
    #[error("the sensed wrench is larger than any sensor reads")]
    WrenchTooLarge,
    /// The last good pose is used.
    #[error("the object's pose is not finite or its rotation is not a unit quaternion")]
    ObjectPoseNotFinite,
    /// Gravity compensation or reflection is zero.
    #[error("a share is not within 0 and 1")]
    ShareOutOfRange,
    /// The command is held until the operator takes a new reference.
    #[error("the hand is turned too far from its reference to be commanded")]
    TurnedTooFar,
}
