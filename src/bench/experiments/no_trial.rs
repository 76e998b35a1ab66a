//! Reasons why a configuration cannot be played.

use thiserror::Error;

use node::BringUpError;
use robot::accommodation::InvalidAccommodation;
use robot::object::InvalidServo;
use robot::payload::InvalidPayload;
use sim::scenario::Problem;
use testbench::robot_site::NoRobot;

/// Reason why a configuration has no trial.
#[derive(Debug, Error)]
pub enum NoTrial {
    /// Nothing to press against.
    #[error("the experiment presses against a wall: add [remote.wall]")]
    NoWall,
    /// Nothing is reflected.
    #[error("the experiment varies K_T: controller.wrench_gain along x must be above 0")]
    NoReflection,
    /// No script leads to a force at rest.
    #[error(
        "the {commanded} command does not come to rest at the wall: raise remote.accommodation_m_per_ns or \
         controller.rate_gain_per_s"
    )]
    NoRest {
        /// The command.
        commanded: String,
    },
    /// The hand of the simulation does not reach so far.
    #[error("{axis}: no hand reaches {reach} m or rad; lower deadband or wall of the axis")]
    OutOfReach {
        /// The axis.
        axis: &'static str,
        /// Displacement, in m or rad.
        reach: f64,
    },
    /// A joint without a curve.
    #[error("{found} calibrated joints where six are needed")]
    Joints {
        /// Number of joints.
        found: usize,
    },
    /// An invalid script.
    #[error(transparent)]
    Script(#[from] Problem),
    /// Gain out of range.
    #[error(transparent)]
    Accommodation(#[from] InvalidAccommodation),
    /// Servo out of range.
    #[error(transparent)]
    Servo(#[from] InvalidServo),
    /// Payload out of range.
    #[error(transparent)]
    Payload(#[from] InvalidPayload),
    /// An arm or scene that cannot be simulated.
    #[error(transparent)]
    Robot(#[from] NoRobot),
    /// The drives do not boot.
    #[error(transparent)]
    BringUp(#[from] BringUpError),
}
