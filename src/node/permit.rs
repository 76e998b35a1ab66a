//! What safety allows in one cycle. Control and the watches of the operator read it.

use crate::record::Mode;

/// Torque, commands and power that safety allows in one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Permit {
    /// The mode.
    pub mode: Mode,
    /// Share of gravity compensation, 0 to 1.
    pub gravity_share: f64,
    /// Whether that share still grows: the weight of the arm is being taken up.
    pub takes_up: bool,
    /// Share of reflection, centring and damping, 0 to 1.
    pub reflection_share: f64,
    /// Whether commands and reflection may flow.
    pub engaged: bool,
    /// Whether the drives are to be enabled.
    pub drives_on: bool,
}
