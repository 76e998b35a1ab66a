//! Permit: the torque, commands and power that safety allows in one cycle. Control and the operator's watches read it.

use crate::record::Mode;

/// Torque, commands and power that safety allows in one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Permit {
    /// Mode of the node.
    pub mode: Mode,
    /// Share of gravity compensation, 0 to 1.
    pub gravity_share: f64,
    /// True while gravity compensation ramps up.
    pub gravity_ramps_up: bool,
    /// Share of reflection, centring and damping, 0 to 1.
    pub reflection_share: f64,
    /// True while the hold may move the arm.
    pub hold: bool,
    /// True while a drive that is tried may push.
    pub trial: bool,
    /// True while commands are sent and reflection acts.
    pub engaged: bool,
    /// True while the drives must be enabled.
    pub drives_on: bool,
}
