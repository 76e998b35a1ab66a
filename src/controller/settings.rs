//! Parameters of the law: the paper's parts, and the extensions beside them.

use crate::JointVector;
use crate::adjustment::Bounds;
use crate::arm::Arm;
use crate::assist::ContactFade;
use crate::calibration::Calibration;
use crate::channels::Channels;
use crate::command::CommandLaw;
use crate::engagement::Engagement;
use crate::friction::FrictionCompensation;
use crate::gains::Gains;
use crate::interpretation::Interpretation;
use crate::limits::{AssistFraction, Slew};
use crate::passivity::Passivity;
use crate::period::Period;
use crate::reflection::Reflection;
use crate::soft_stops::SoftStops;
use crate::tank::Tank;
use crate::velocity::Filter;
use crate::virtual_coupling::VirtualCoupling;

/// Parameters of the control law. The constructor of each part checks it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Interpretation of the paper.
    pub interpretation: Interpretation,
    /// Cycle period.
    pub period: Period,
    /// Kinematics and masses of the hand controller.
    pub arm: Arm<6>,
    /// Encoders, gears and torque curves, whose ends are the joints' capacities.
    pub calibration: Calibration<6>,
    /// Deadband and return to centre of each axis.
    pub channels: Channels,
    /// Gains from displacement to command.
    pub command: CommandLaw,
    /// Sensor pose, K_T and limits at the grip.
    pub reflection: Reflection,
    /// K_D, in N·s/m and N·m·s/rad.
    pub damping: Gains,
    /// Fraction of each joint's capacity that the assist may use.
    pub assist_fraction: AssistFraction,
    /// Bounds of the operator's adjustments.
    pub bounds: Bounds,
    /// Dry friction of each joint as described, in N·m or N.
    pub dry_friction: JointVector,
    /// Extensions that are not in the paper.
    pub extensions: Extensions,
}

/// Extensions beside the paper's law; all off by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extensions {
    /// Low pass on the grip's velocity.
    pub velocity_filter: Filter,
    /// Walls of the channels also act in pose mode.
    pub walls_in_pose: bool,
    /// Fade of the return to centre in contact.
    pub contact_fade: Option<ContactFade>,
    /// Ramp of reflection; `None` starts it at once.
    pub engagement: Option<Engagement>,
    /// Feed-forward of the joints' friction.
    pub friction: Option<FrictionCompensation>,
    /// Springs and dampers before the ends of the joints.
    pub soft_stops: Option<SoftStops<6>>,
    /// K_D never pulls the hand into the surface; implied by a passivity layer.
    pub damping_never_pulls: bool,
    /// Limits on the rate of change of torques.
    pub slew: Option<Slew<6>>,
    /// Passivity observer and controller at the reflection port.
    pub passivity: Option<Passivity>,
    /// Energy tank at the reflection port.
    pub tank: Option<Tank>,
    /// Virtual coupling of hand and object in pose mode; replaces the sensed wrench.
    pub virtual_coupling: Option<VirtualCoupling>,
}
