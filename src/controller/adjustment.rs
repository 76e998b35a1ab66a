//! Changes that the operator makes while running: scales, locks, alignment. What may be changed when, and by how much.

use serde::Serialize;
use thiserror::Error;

use crate::scaling::{Factors, Scale, Scaling};
use units::adjustment::{LockAxis, Quantity};
use units::spatial::Wrench;

/// Maximum force and moment at {MRF} that are not yet a contact, in N and N·m.
pub const CONTACT: [f64; 2] = [1.0, 0.1];

/// Bounds of adjustments, as the gains were judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest and greatest scale.
    pub scale: [Scale; 2],
    /// Axes along or about which the object yields to force (K_FA).
    pub yields: [bool; 6],
}

/// State of all adjustments in one cycle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Adjusted {
    /// Scale that was set.
    pub scale: Scale,
    /// Locked axes.
    pub locked: [bool; 6],
    /// Factors on the gains, which reach scale and locks within half a second.
    pub factors: Factors,
    /// The object is being turned to the orientation of the grip.
    pub is_aligning: bool,
}

/// Reason why an adjustment is refused.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum AdjustmentRefused {
    /// A factor beyond what the gains were judged with.
    #[error(
        "scale of {quantity} must be within {low}..={high} (controller.scale.{quantity}), got {value}"
    )]
    OutOfBounds {
        /// Quantity.
        quantity: Quantity,
        /// Smallest factor.
        low: f64,
        /// Greatest factor.
        high: f64,
        /// Requested factor.
        value: f64,
    },
    /// In rate mode the command along an axis that yields is what holds the contact's force.
    #[error(
        "lock of {axis}: the rate along it holds the force of the contact, since the object yields; move off first"
    )]
    HoldsContact {
        /// Axis.
        axis: LockAxis,
    },
    /// In rate mode the orientation of the grip commands a rate.
    #[error("align turns the object by pose: select pose mode first")]
    NotPose,
    /// The object moves by the operator's command only.
    #[error("align turns the object: hold the deadman until it commands")]
    NotCommanding,
    /// The object touches something.
    #[error("align turns the object, which is in contact: move off first")]
    InContact,
    /// A rotation is locked.
    #[error("align turns the object about {axis}, which is locked")]
    Locked {
        /// Locked axis.
        axis: LockAxis,
    },
}

impl Bounds {
    /// Fixed scales, and an object that does not yield.
    pub const FIXED: Self = Self { scale: [Scale::ONE; 2], yields: [false; 6] };

    /// Checks a scale.
    ///
    /// # Errors
    /// A value out of the bounds, or NaN.
    pub fn check_scale(&self, quantity: Quantity, value: f64) -> Result<(), AdjustmentRefused> {
        let [low, high] = self.scale.map(|scale| scale.of(quantity));
        if (low..=high).contains(&value) {
            Ok(())
        } else {
            Err(AdjustmentRefused::OutOfBounds { quantity, low, high, value })
        }
    }
}

impl Adjusted {
    /// Returns the state of a scaling, and whether an alignment is under way.
    pub(crate) const fn new(scaling: &Scaling, is_aligning: bool) -> Self {
        Self {
            scale: *scaling.scale(),
            locked: *scaling.locked(),
            factors: *scaling.factors(),
            is_aligning,
        }
    }

    /// Returns the locked axes, in order.
    pub fn locked_axes(&self) -> impl Iterator<Item = LockAxis> + '_ {
        LockAxis::ALL.into_iter().filter(|axis| axis.entry(&self.locked))
    }
}

/// Returns whether a wrench at {MRF} is that of a contact.
pub(crate) fn is_contact(f_m: &Wrench) -> bool {
    let [force, moment] = CONTACT;
    f_m.force.norm() > force || f_m.moment.norm() > moment
}

/// Returns whether a contact resists along or about an axis of {MRF}.
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
