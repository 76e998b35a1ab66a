//! What the law is made of: the paper's parts, and what stands beside them.

use crate::arm::Arm;
use crate::assist::ContactFade;
use crate::calibration::Calibration;
use crate::channels::Channels;
use crate::command::CommandLaw;
use crate::engagement::Engagement;
use crate::gains::Gains;
use crate::limits::AssistFraction;
use crate::limits::Slew;
use crate::passivity::Passivity;
use crate::period::Period;
use crate::readings::Readings;
use crate::reflection::Reflection;
use crate::soft_stops::SoftStops;
use crate::tank::Tank;
use crate::velocity::Filter;
use crate::virtual_coupling::VirtualCoupling;

/// Everything the law is made of; each part cannot be wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How the paper is read.
    pub readings: Readings,
    /// The cycle.
    pub period: Period,
    /// The hand controller's links.
    pub arm: Arm<6>,
    /// Its encoders, gears and torque curves; their ends are the joints' capacities.
    pub calibration: Calibration<6>,
    /// Deadband and return to centre.
    pub channels: Channels,
    /// From displacement to command.
    pub command: CommandLaw,
    /// From the sensor to the grip.
    pub reflection: Reflection,
    /// K_D, against the hand's motion, in N·s/m and N·m·s/rad.
    pub damping: Gains,
    /// What the assist may take of each joint's capacity.
    pub assist_fraction: AssistFraction,
    /// What the paper does not have.
    pub beyond: Beyond,
}

/// What stands beside the paper's law; everything off by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Beyond {
    /// A low pass on the grip's velocity.
    pub velocity_filter: Filter,
    /// Whether the walls of the channels also stand in pose mode.
    pub walls_in_pose: bool,
    /// How the assist gives way in contact.
    pub contact_fade: Option<ContactFade>,
    /// How what is felt begins; at once without.
    pub engagement: Option<Engagement>,
    /// What turns joints back before their ends.
    pub soft_stops: Option<SoftStops<6>>,
    /// How fast torques may change.
    pub slew: Option<Slew<6>>,
    /// What takes back energy that a contact gives off.
    pub passivity: Option<Passivity>,
    /// What bounds the energy that can be given at all.
    pub tank: Option<Tank>,
    /// What ties the hand to the object in pose mode, in place of the sensor.
    pub virtual_coupling: Option<VirtualCoupling>,
}
