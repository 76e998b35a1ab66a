//! Six numbers, one per Cartesian axis, that cannot be wrong: the diagonal gain matrices of Fig. 3.
//!
//! Not the laws they are used in. Axes are numbered as in the paper: three translations, then three
//! rotations.

use thiserror::Error;

/// The six axes by name, in the order of every six-vector of the paper.
pub const AXES: [&str; 6] = ["x", "y", "z", "about x", "about y", "about z"];

/// Maximum gain, deadband or plateau: products of them stay finite.
pub const MAX_GAIN: f64 = 1e6;

/// Six numbers that are finite and not negative: a diagonal gain matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains([f64; 6]);

/// One of six gains is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("{quantity}, {axis}: {value} is not within 0 and {MAX_GAIN}")]
pub struct InvalidGain {
    /// Name of the gains, as the caller has it.
    pub quantity: &'static str,
    /// The first axis that is wrong.
    pub axis: &'static str,
    /// The value given.
    pub value: f64,
}

impl Gains {
    /// Zero on every axis.
    pub const ZERO: Self = Self([0.0; 6]);

    /// Checks six numbers; `quantity` names them in the error.
    ///
    /// # Errors
    /// The first that is negative, too large or not a number.
    pub fn new(values: [f64; 6], quantity: &'static str) -> Result<Self, InvalidGain> {
        for (value, axis) in values.into_iter().zip(AXES) {
            if !(0.0..=MAX_GAIN).contains(&value) {
                return Err(InvalidGain { quantity, axis, value });
            }
        }
        Ok(Self(values))
    }

    /// Returns them times a factor each, which must not be negative.
    #[must_use]
    pub fn scaled(&self, factors: &[f64; 6]) -> Self {
        let mut values = self.0;
        let pairs = values.iter_mut().zip(factors);
        pairs.for_each(|(value, factor)| *value = (*value * factor).min(MAX_GAIN));
        Self(values)
    }

    /// The six numbers.
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
