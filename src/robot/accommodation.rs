//! Force accommodation: the object yields to contact. A rate command in free space thereby becomes a force command in
//! contact (NTRFC, 4.3), without a change of mode or gain.
//!
//! At a constant rate command the object stops where `K_FA F` cancels it, with the force `K_FA⁻¹ K_V ΔX`.
//! `controller::stability` checks the gain before any motion.

use thiserror::Error;

use units::spatial::{Twist, Wrench};

/// Maximum gain and deadband, in m/s per N or rad/s per N·m, and in N or N·m.
const MAX_VALUE: f64 = 1e3;

/// Accommodation gain K_FA per axis of {MRF}, and the deadband of the wrench.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accommodation {
    gain: [f64; 6],
    deadband: [f64; 6],
}

/// Gain or deadband out of range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("accommodation {quantity} must be within 0..={MAX_VALUE}, got {value}")]
pub struct InvalidAccommodation {
    /// `gain` or `deadband`.
    pub quantity: &'static str,
    /// Rejected value.
    pub value: f64,
}

impl Accommodation {
    /// Creates an accommodation from gains in m/s per N and rad/s per N·m, and a deadband in N and N·m. The deadband
    /// must exceed the sensor's bias, or the object drifts.
    ///
    /// # Errors
    /// Returns the first value that is negative, above 1000 or NaN.
    pub fn new(gain: [f64; 6], deadband: [f64; 6]) -> Result<Self, InvalidAccommodation> {
        for (quantity, values) in [("gain", gain), ("deadband", deadband)] {
            let wrong = values.into_iter().find(|value| !(0.0..=MAX_VALUE).contains(value));
            if let Some(value) = wrong {
                return Err(InvalidAccommodation { quantity, value });
            }
        }
        Ok(Self { gain, deadband })
    }

    /// Returns K_FA, in m/s per N and rad/s per N·m.
    pub const fn gain(&self) -> &[f64; 6] {
        &self.gain
    }

    /// Returns the deadband, in N and N·m.
    pub const fn deadband(&self) -> &[f64; 6] {
        &self.deadband
    }

    /// Computes the rate of the object from the commanded rate and the wrench `f_m` on the object, both at {MRF}.
    pub fn rate(&self, v_m_commanded: &Twist, f_m: &Wrench) -> Twist {
        let mut effective = f_m.components();
        for (part, deadband) in effective.iter_mut().zip(self.deadband) {
            *part = (part.abs() - deadband).max(0.0).copysign(*part);
        }
        *v_m_commanded + Twist::from_components(effective).scaled(&self.gain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrench_within_the_deadband_changes_nothing() {
        let law = Accommodation::new([0.01; 6], [0.5; 6]).unwrap();
        let v_m = Twist::from_components([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
        assert_eq!(law.rate(&v_m, &Wrench::ZERO), v_m);
        let bias = Wrench::from_components([0.5, -0.5, 0.5, -0.5, 0.5, -0.5]);
        assert_eq!(law.rate(&v_m, &bias), v_m);
    }

    #[test]
    fn object_yields_along_the_wrench() {
        let law = Accommodation::new([0.01; 6], [1.0; 6]).unwrap();
        let f_m = Wrench::from_components([3.0, -3.0, 0.0, 0.0, 2.0, 0.0]);
        let v_m = law.rate(&Twist::ZERO, &f_m);
        assert_eq!(v_m, Twist::from_components([0.02, -0.02, 0.0, 0.0, 0.01, 0.0]));
        assert!(f_m.power(&v_m) > 0.0);
    }

    #[test]
    fn invalid_gains_and_deadbands_are_refused() {
        for wrong in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(Accommodation::new([wrong; 6], [0.0; 6]).is_err());
            assert!(Accommodation::new([0.0; 6], [wrong; 6]).is_err());
        }
    }
}
