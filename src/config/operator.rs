//! `[operator]`: impedance of the hand for the stability checks of the gains.

use crate::problem::Problems;
use crate::raw;
use crate::value::Optional;
use controller::stability::axis::Impedance;

/// Impedance of the hand for the stability checks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OperatorImpedance {
    /// Impedance along an axis, in N/m and N·s/m.
    pub linear: Impedance,
    /// Impedance about an axis, in N·m/rad and N·m·s/rad.
    pub angular: Impedance,
}

/// Impedance of a firm but not stiff grip, as in the simulation.
impl Default for OperatorImpedance {
    fn default() -> Self {
        Self {
            linear: Impedance { stiffness: 500.0, damping: 15.0 },
            angular: Impedance { stiffness: 6.0, damping: 0.12 },
        }
    }
}

/// Reads the impedance, with defaults for absent keys. Returns `None` after a problem.
pub(super) fn read(raw: &raw::Operator, problems: &mut Problems<'_>) -> Option<OperatorImpedance> {
    let OperatorImpedance { linear, angular } = OperatorImpedance::default();
    let mut impedance = |stiffness: &Optional<f64>, damping: &Optional<f64>, default: Impedance| {
        let stiffness = problems.not_negative(&stiffness.or(default.stiffness));
        let damping = problems.not_negative(&damping.or(default.damping));
        Some(Impedance { stiffness: stiffness?, damping: damping? })
    };
    let linear = impedance(&raw.stiffness_n_per_m, &raw.damping_ns_per_m, linear);
    let angular = impedance(&raw.stiffness_nm_per_rad, &raw.damping_nms_per_rad, angular);
    Some(OperatorImpedance { linear: linear?, angular: angular? })
}
