//! `[operator]`: the hand that the gains are judged with.

use crate::problem::Problems;
use crate::raw;
use crate::value::Optional;
use controller::stability::axis::Impedance;

/// The impedance of the hand the gains are judged with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Operator {
    /// Along an axis, in N/m and N·s/m.
    pub linear: Impedance,
    /// About an axis, in N·m/rad and N·m·s/rad.
    pub angular: Impedance,
}

/// A hand that holds firmly but not stiffly, as the simulated one.
impl Default for Operator {
    fn default() -> Self {
        Self {
            linear: Impedance { stiffness: 500.0, damping: 15.0 },
            angular: Impedance { stiffness: 6.0, damping: 0.12 },
        }
    }
}

/// The hand of `[operator]`; the default one where the file says nothing; `None` where a problem
/// has been noted.
pub(super) fn read(raw: &raw::Operator, problems: &mut Problems<'_>) -> Option<Operator> {
    let Operator { linear, angular } = Operator::default();
    let mut impedance = |stiffness: &Optional<f64>, damping: &Optional<f64>, usual: Impedance| {
        let stiffness = problems.not_negative(&stiffness.or(usual.stiffness));
        let damping = problems.not_negative(&damping.or(usual.damping));
        Some(Impedance { stiffness: stiffness?, damping: damping? })
    };
    let linear = impedance(&raw.stiffness_n_per_m, &raw.damping_ns_per_m, linear);
    let angular = impedance(&raw.stiffness_nm_per_rad, &raw.damping_nms_per_rad, angular);
    Some(Operator { linear: linear?, angular: angular? })
}
