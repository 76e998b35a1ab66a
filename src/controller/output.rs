//! Input and output of one cycle, with every intermediate of Fig. 3.

use nalgebra::Isometry3;
use serde::Serialize;
use thiserror::Error;

use crate::JointVector;
use crate::adjustment::AdjustmentState;
use crate::command::Gate;
use crate::hold::HoldOutput;
use crate::port::PortOutput;
use crate::reference::{Displacement, Reference};
use crate::switches::{CommandMode, Permissions, Switches};
use crate::velocity::GripTwist;
use units::drive::{Counts, PerMille};
use units::numbering::Joint;
use units::spatial::{Jacobian, Motion, Wrench};

/// Target torques (6071h) that the drives hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveTargets {
    /// Targets that the node has sent to the drives.
    Sent([PerMille; 6]),
    /// Zero, because the sent targets were withdrawn after a stall; torques rise from zero again.
    Withdrawn,
}

impl DriveTargets {
    /// Returns the held target of each drive, base first.
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
    /// Wrench of the environment on the object at {S}, without the payload.
    pub f_s: Wrench,
    /// Pose of the object, in its base.
    pub x_b_m: Isometry3<f64>,
    /// Levels of the switches.
    pub switches: Switches,
    /// Rate or pose mode.
    pub mode: CommandMode,
    /// Share of the arm's weight to compensate, 0 to 1; ramped by the caller.
    pub gravity_share: f64,
    /// Share of task and assist to reflect, 0 to 1; ramped by the caller.
    pub reflection_share: f64,
    /// True while the hold may move the arm.
    pub hold: bool,
    /// Targets that the drives hold since the last cycle; `None` if they equal its output.
    pub held: Option<DriveTargets>,
    /// First cycle, or first after a gap: differences to earlier cycles are invalid.
    pub restart: bool,
}

/// Output of one cycle, with every intermediate of Fig. 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// Joint positions, in rad or m.
    pub q: JointVector,
    /// First joint outside its range.
    pub joint_out_of_range: Option<Joint>,
    /// Pose of the grip in {0} (Eq. 1).
    pub x_0_g: Isometry3<f64>,
    /// Permissions and requests of the switches.
    pub permissions: Permissions,
    /// Reference from this cycle on.
    pub reference: Reference,
    /// Pose of the grip in the reference (Eq. 2, 3).
    pub x_h_g: Isometry3<f64>,
    /// ΔX, the displacement as six components (Eq. 4).
    pub dx: Displacement,
    /// ΔX less the deadband: the commanding part.
    pub dx_db: Displacement,
    /// Gate of the operator's command.
    pub gate: Gate,
    /// Command for the object (Eq. 5, 3.5).
    pub command: Motion,
    /// Scales, locks and alignment from this cycle on.
    pub adjusted: AdjustmentState,
    /// Twist of the grip, in {G}.
    pub twist: GripTwist,
    /// Wrench on the object at {MRF} (Eq. 6), or the wrench of the virtual coupling, reflected or not.
    pub f_m_task: Wrench,
    /// Reflected task wrench at {G}.
    pub f_g_task: Wrench,
    /// Wrenches and energies of the reflection port.
    pub port: PortOutput,
    /// Return to centre, at {G} (Eq. 8).
    pub f_g_centring: Wrench,
    /// Damping, at {G} (Eq. 9).
    pub f_g_damping: Wrench,
    /// Jacobian of {G}, written in {G}.
    pub j_g: Jacobian<6>,
    /// State of the hold; `None` without a goal.
    pub hold: Option<HoldOutput>,
    /// Contributions to every joint torque.
    pub ledger: Ledger,
    /// Commanded joint torques (Eq. 10), in N·m or N.
    pub tau: JointVector,
    /// Target torques (6071h, Fig. 6) of `tau`.
    pub targets: [PerMille; 6],
    /// Most severe invalid value of the cycle. The torques are safe to send all the same.
    pub invalid_value: Option<InvalidValue>,
}

/// Torque budget of one cycle: requested contributions in N·m or N, and the scales applied to them. It serializes as the
/// `budget` of a status.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ledger {
    /// Reflected task wrench (Eq. 7).
    pub task: JointVector,
    /// Gravity compensation times its share.
    pub gravity: JointVector,
    /// Return to centre, before its scaling.
    pub centring: JointVector,
    /// Damping, before its scaling.
    pub damping: JointVector,
    /// Dampers of passivity layer and tank.
    pub passivity: JointVector,
    /// Torques of the soft stops.
    pub soft_stops: JointVector,
    /// Friction compensation, scaled by the engagement ramp.
    pub friction: JointVector,
    /// Torques of the hold, which are not scaled.
    pub hold: JointVector,
    /// Self-driven joint, for which friction compensation is withdrawn until the next arming.
    #[serde(skip)]
    pub self_driven: Option<Joint>,
    /// Scale of return to centre and damping, 0 to 1.
    pub assist_scale: f64,
    /// Scale of task and assist together, 0 to 1.
    pub rest_scale: f64,
    /// Share of task and assist to reflect, 0 to 1: the input's `reflection_share`.
    #[serde(skip)]
    pub share: f64,
    /// Joint that determines `rest_scale`.
    pub limiting_joint: Option<Joint>,
    /// First joint whose torque the slew limits.
    pub slewing_joint: Option<Joint>,
}

impl Ledger {
    /// Returns a budget with zero torques and scales of 1.
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
            hold: none,
            self_driven: None,
            assist_scale: 1.0,
            rest_scale: 1.0,
            share: 1.0,
            limiting_joint: None,
            slewing_joint: None,
        }
    }

    /// Returns the torques for weight and friction of the arm, in N·m or N; the hand does not receive them.
    pub fn carried(&self) -> JointVector {
        self.gravity + self.friction * (self.rest_scale * self.share)
    }
}

impl Output {
    /// Returns whether the capacity of a joint reduces the reflected wrench.
    pub const fn is_saturated(&self) -> bool {
        self.ledger.limiting_joint.is_some()
    }
}

/// Invalid value that was replaced, most severe first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum InvalidValue {
    /// Infinite or NaN torque: all torques are zero.
    #[error("a torque is not a finite number")]
    TorqueNotFinite,
    /// Infinite or NaN component of the sensed wrench: reflection is zero.
    #[error("the sensed wrench is not finite")]
    WrenchNotFinite,
    /// Component of the sensed wrench beyond 1e5 N or N·m: reflection is zero.
    #[error("the sensed wrench is larger than any sensor reads")]
    WrenchTooLarge,
    /// Invalid pose of the object: the last valid pose is used.
    #[error("the object's pose is not finite or its rotation is not a unit quaternion")]
    ObjectPoseNotFinite,
    /// Share outside 0 to 1: gravity compensation or reflection is zero.
    #[error("a share is not within 0 and 1")]
    ShareOutOfRange,
    /// Orientation of the hand beyond the commandable range: the object holds until the operator sets a new reference.
    #[error("the hand is turned too far from its reference to be commanded")]
    TurnedTooFar,
}
