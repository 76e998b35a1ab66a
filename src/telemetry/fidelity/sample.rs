//! One sample: the felt wrench, the wanted one, and the known parts of the difference.

use derive_more::Display;
use nalgebra::Vector3;
use serde::Serialize;

use units::spatial::Wrench;
use units::time::Instant;

/// Place at which a wrench is judged.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Judged {
    /// The wrench between grip and hand, which only a simulation knows.
    #[display("hand")]
    Hand,
    /// The wrench of the commanded torques, without gravity compensation.
    #[display("command")]
    Command,
}

/// Known parts of what is felt beside the task, on the hand, at {G} in {G}.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// Friction and end stops of the joints; zero where it is not known.
    pub friction: Wrench,
    /// Friction compensation.
    pub compensation: Wrench,
    /// Return to centre.
    pub centring: Wrench,
    /// Damping.
    pub damping: Wrench,
    /// Damper of the passivity layer.
    pub passivity: Wrench,
    /// Soft stops.
    pub soft_stops: Wrench,
    /// Inertia of the arm; zero where it is not known.
    pub inertia: Wrench,
}

impl Parts {
    /// The assist that is commanded on purpose, and the inertia that no torque removes.
    pub(super) fn intended(&self) -> Wrench {
        self.centring + self.damping + self.passivity + self.soft_stops + self.inertia
    }
}

/// One cycle, engaged and with reflection on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time of its SYNC.
    pub at: Instant,
    /// Place of the grip in {0}, in m.
    pub x_0: Vector3<f64>,
    /// Force on the object, in N.
    pub contact_force: f64,
    /// A joint is at its capacity: nothing is judged.
    pub is_saturated: bool,
    /// K_T times the sensed wrench, on the hand, at {G} in {G}.
    pub wanted: Wrench,
    /// The wrench on the hand, at {G} in {G}.
    pub felt: Wrench,
    /// Its known parts.
    pub parts: Parts,
}
