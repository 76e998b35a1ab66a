//! Reasons why a configuration cannot be played.

use thiserror::Error;

use node::BringUpError;
use robot::accommodation::InvalidAccommodation;
use robot::object::InvalidServo;
use robot::payload::InvalidPayload;
use sim::scenario::Problem;
use testbench::robot_site::NoRobot;

/// Reason why an experiment cannot be played with a configuration.
#[derive(Debug, Error)]
pub enum NoTrial {
    /// Commanded side without a wall.
    #[error("the experiment presses against a wall: add [remote.wall]")]
    NoWall,
    /// K_T along x is zero.
    #[error("the experiment varies K_T: controller.wrench_gain along x must be above 0")]
    NoReflection,
    /// Zero gain or accommodation: no command comes to rest at the wall.
    #[error(
        "the {commanded} command does not come to rest at the wall: raise remote.accommodation_m_per_ns or \
         controller.rate_gain_per_s"
    )]
    NoRest {
        /// Mode of the command, `pose` or `rate`.
        commanded: String,
    },
    /// End of the sweep that the simulated hand cannot reach.
    #[error("{axis}: no hand reaches {reach} m or rad; lower deadband or wall of the axis")]
    OutOfReach {
        /// Axis of ΔX.
        axis: &'static str,
        /// Displacement, in m or rad.
        reach: f64,
    },
    /// Number of torque curves other than six.
    #[error("{found} calibrated joints where six are needed")]
    Joints {
        /// Number of calibrated joints.
        found: usize,
    },
    /// Invalid script.
    #[error(transparent)]
    Script(#[from] Problem),
    /// K_FA or its deadband is out of range.
    #[error(transparent)]
    Accommodation(#[from] InvalidAccommodation),
    /// Time constant or limit of the servo is out of range.
    #[error(transparent)]
    Servo(#[from] InvalidServo),
    /// Mass, centre of mass or inertia of the payload is invalid.
    #[error(transparent)]
    Payload(#[from] InvalidPayload),
    /// Arm or scene that cannot be simulated.
    #[error(transparent)]
    Robot(#[from] NoRobot),
    /// Drives that did not reach Operation enabled (CiA 402).
    #[error(transparent)]
    BringUp(#[from] BringUpError),
}
