//! Diagonal gain matrices of Fig. 3: one checked value per Cartesian axis, three translations, then three rotations.

use thiserror::Error;

/// Names of the six Cartesian axes, in the order of every six-vector of the paper.
pub const AXES: [&str; 6] = ["x", "y", "z", "about x", "about y", "about z"];

/// Maximum gain, deadband or plateau; their products stay finite.
pub const MAX_GAIN: f64 = 1e6;

/// Diagonal gain matrix: six values within 0 and [`MAX_GAIN`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains([f64; 6]);

/// Invalid entry of [`Gains`].
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("{quantity}, {axis}: {value} is not within 0 and {MAX_GAIN}")]
pub struct InvalidGain {
    /// Name of the gains, given by the caller.
    pub quantity: &'static str,
    /// First invalid axis.
    pub axis: &'static str,
    /// Rejected value.
    pub value: f64,
}

impl Gains {
    /// Zero on every axis.
    pub const ZERO: Self = Self([0.0; 6]);

    /// Creates gains from six values; `quantity` names them in the error.
    ///
    /// # Errors
    /// Returns the first value that is negative, above [`MAX_GAIN`] or NaN.
    pub fn new(values: [f64; 6], quantity: &'static str) -> Result<Self, InvalidGain> {
        for (value, axis) in values.into_iter().zip(AXES) {
            if !(0.0..=MAX_GAIN).contains(&value) {
                return Err(InvalidGain { quantity, axis, value });
            }
        }
        Ok(Self(values))
    }

    /// Multiplies each gain by its factor, which must not be negative; saturates at [`MAX_GAIN`].
    #[must_use]
    pub fn scaled(&self, factors: &[f64; 6]) -> Self {
        let mut values = self.0;
        let pairs = values.iter_mut().zip(factors);
        pairs.for_each(|(value, factor)| *value = (*value * factor).min(MAX_GAIN));
        Self(values)
    }

    /// Diagonal entries.
    pub const fn values(&self) -> &[f64; 6] {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_is_finite_and_not_negative() {
        assert!(Gains::new([0.0, 1.0, 2.0, 3.0, 4.0, 1e6], "K_V").is_ok());
        for wrong in [-1e-9, f64::NAN, f64::INFINITY, 2e6] {
            let error = Gains::new([1.0, 1.0, 1.0, 1.0, wrong, 1.0], "K_V").unwrap_err();
            assert_eq!((error.quantity, error.axis), ("K_V", "about y"));
            assert_eq!(error.value.to_bits(), wrong.to_bits());
        }
    }
}
