//! Adjustments by the operator while the arm runs (scales, locks, alignment), with their bounds and preconditions.

use serde::Serialize;
use thiserror::Error;

use crate::scaling::{Factors, Scale, Scaling};
use units::adjustment::{LockAxis, Quantity};
use units::spatial::Wrench;

/// Maximum force and moment at {MRF} without contact, in N and N·m.
pub const CONTACT: [f64; 2] = [1.0, 0.1];

/// Bounds of adjustments that the gain check covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Minimum and maximum scale.
    pub scale: [Scale; 2],
    /// Axes on which the object yields to force (K_FA > 0).
    pub yields: [bool; 6],
}

/// State of all adjustments in one cycle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AdjustmentState {
    /// Configured scale, which `factors` reach within 0.5 s.
    pub scale: Scale,
    /// Locked axes of {MRF}.
    pub locked: [bool; 6],
    /// Present factors on the gains.
    pub factors: Factors,
    /// Set while an alignment of the object to the grip is in progress.
    pub is_aligning: bool,
}

/// Reason why an adjustment is refused.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum AdjustmentError {
    /// Factor outside the bounds of the gain check.
    #[error(
        "scale of {quantity} must be within {low}..={high} (controller.scale.{quantity}), got {value}"
    )]
    OutOfBounds {
        /// Scaled quantity.
        quantity: Quantity,
        /// Minimum factor.
        low: f64,
        /// Maximum factor.
        high: f64,
        /// Requested factor.
        value: f64,
    },
    /// Lock of a yielding axis in contact: in rate mode the command along it maintains the contact force.
    #[error(
        "lock of {axis}: the rate along it holds the force of the contact, since the object yields; move off first"
    )]
    HoldsContact {
        /// Requested axis.
        axis: LockAxis,
    },
    /// Alignment in rate mode, in which the orientation of the grip commands a rate.
    #[error("align turns the object by pose: select pose mode first")]
    NotPose,
    /// Alignment while the operator does not command: the object moves by command only.
    #[error("align turns the object: hold the deadman until it commands")]
    NotCommanding,
    /// Alignment of an object in contact.
    #[error("align turns the object, which is in contact: move off first")]
    InContact,
    /// Alignment with a locked rotation.
    #[error("align turns the object about {axis}, which is locked")]
    Locked {
        /// First locked rotation.
        axis: LockAxis,
    },
}

impl Bounds {
    /// Scales fixed at 1, and an object that does not yield.
    pub const FIXED: Self = Self { scale: [Scale::ONE; 2], yields: [false; 6] };

    /// Checks a factor against the bounds of its quantity.
    ///
    /// # Errors
    /// Returns [`AdjustmentError::OutOfBounds`] for a factor outside, or NaN.
    pub fn check_scale(&self, quantity: Quantity, value: f64) -> Result<(), AdjustmentError> {
        let [low, high] = self.scale.map(|scale| scale.factor(quantity));
        if (low..=high).contains(&value) {
            Ok(())
        } else {
            Err(AdjustmentError::OutOfBounds { quantity, low, high, value })
        }
    }
}

impl AdjustmentState {
    /// Combines the state of a scaling with the state of the alignment.
    pub(crate) const fn new(scaling: &Scaling, is_aligning: bool) -> Self {
        Self {
            scale: *scaling.scale(),
            locked: *scaling.locked(),
            factors: *scaling.factors(),
            is_aligning,
        }
    }

    /// Returns the locked axes, translations first.
    pub fn locked_axes(&self) -> impl Iterator<Item = LockAxis> + '_ {
        LockAxis::ALL.into_iter().filter(|axis| axis.entry(&self.locked))
    }
}

/// Returns whether a wrench at {MRF} exceeds [`CONTACT`].
pub(crate) fn is_contact(f_m: &Wrench) -> bool {
    let [force, moment] = CONTACT;
    f_m.force.norm() > force || f_m.moment.norm() > moment
}

/// Returns whether a wrench at {MRF} exceeds [`CONTACT`] along or about `axis`.
pub(crate) fn is_contact_on(f_m: &Wrench, axis: LockAxis) -> bool {
    let [force, moment] = CONTACT;
    axis.entry(&f_m.components()).abs() > if axis.is_rotation() { moment } else { force }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_out_of_its_bounds_is_refused_with_them() {
        let low = Scale { motion: 0.1, ..Scale::ONE };
        let bounds = Bounds { scale: [low, Scale::ONE], ..Bounds::FIXED };
        assert_eq!(bounds.check_scale(Quantity::Motion, 0.1), Ok(()));
        for value in [0.09, 1.1, -1.0, f64::NAN, f64::INFINITY] {
            let error = bounds.check_scale(Quantity::Motion, value).unwrap_err().to_string();
            let expected = "scale of motion must be within 0.1..=1 (controller.scale.motion), got ";
            assert_eq!(error, format!("{expected}{value}"));
        }
        assert!(bounds.check_scale(Quantity::Force, 0.5).is_err(), "fixed");
    }

    #[test]
    fn contact_is_judged_by_axis() {
        let f_m = Wrench::from_components([0.0, -1.5, 0.5, 0.0, 0.05, 0.2]);
        let found = LockAxis::ALL.map(|axis| is_contact_on(&f_m, axis));
        assert_eq!(found, [false, true, false, false, false, true]);
        assert!(
            is_contact(&f_m)
                && !is_contact(&Wrench::from_components([0.5; 6].map(|part| part * 0.1)))
        );
    }
}
