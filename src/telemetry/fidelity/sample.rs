//! Sample of the wrench at the hand, its reference, and the known parts of the difference.

use derive_more::Display;
use nalgebra::Vector3;
use serde::Serialize;

use units::spatial::Wrench;
use units::time::Instant;

/// Source of the wrench at the hand.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum WrenchSource {
    /// Wrench between grip and hand, which only a simulation provides.
    #[display("hand")]
    Hand,
    /// Wrench of the commanded torques, without gravity compensation.
    #[display("command")]
    Command,
}

/// Known parts of the wrench on the hand besides the task wrench, at {G} in {G}.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WrenchParts {
    /// Friction and end stops of the joints; zero if unknown.
    pub friction: Wrench,
    /// Friction compensation.
    pub compensation: Wrench,
    /// Return to centre.
    pub centring: Wrench,
    /// Damper of the assist (Eq. 9).
    pub damping: Wrench,
    /// Damper of the passivity layer.
    pub passivity: Wrench,
    /// Springs at the ends of the joints' ranges.
    pub soft_stops: Wrench,
    /// Inertia of the arm; zero if unknown.
    pub inertia: Wrench,
}

impl WrenchParts {
    /// Returns the commanded assist plus the inertia, which no torque removes.
    pub(super) fn intended(&self) -> Wrench {
        self.centring + self.damping + self.passivity + self.soft_stops + self.inertia
    }
}

/// Sample of one engaged cycle with reflection on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time of the cycle's SYNC.
    pub at: Instant,
    /// Position of the grip in {0}, in m.
    pub x_0: Vector3<f64>,
    /// Force on the object, in N.
    pub contact_force: f64,
    /// Set if a joint is at its capacity; the sample does not count.
    pub is_saturated: bool,
    /// K_T times the sensed wrench, on the hand, at {G} in {G}.
    pub reference: Wrench,
    /// Wrench on the hand, at {G} in {G}.
    pub felt: Wrench,
    /// Known parts of that wrench.
    pub parts: WrenchParts,
}
