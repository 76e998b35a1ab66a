//! The cycle period, for laws that differentiate, ramp and integrate.

use thiserror::Error;

/// Time from one cycle to the next, in s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period(f64);

/// Period out of range, in s.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("the cycle period must be within 10 µs and 1 s, got {0} s")]
pub struct InvalidPeriod(pub f64);

impl Period {
    /// Creates a period.
    ///
    /// # Errors
    /// Returns an error for a period not within 10 µs and 1 s.
    pub fn new(seconds: f64) -> Result<Self, InvalidPeriod> {
        if (1e-5..=1.0).contains(&seconds) {
            Ok(Self(seconds))
        } else {
            Err(InvalidPeriod(seconds))
        }
    }

    /// Returns the period, in s.
    pub const fn seconds(self) -> f64 {
        self.0
    }

    /// Converts a time in s to cycles, rounded up.
    #[expect(
        clippy::as_conversions,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates at both ends of u32; NaN becomes 0"
    )]
    pub fn cycles(self, seconds: f64) -> u32 {
        (seconds / self.0).ceil() as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_is_one_of_a_control_loop() {
        for wrong in [0.0, -1e-3, 2.0, f64::NAN] {
            assert!(Period::new(wrong).is_err());
        }
    }

    #[test]
    fn a_time_takes_whole_cycles() {
        let period = Period::new(2e-3).unwrap();
        assert_eq!([0.0, 1e-3, 0.5, f64::NAN].map(|time| period.cycles(time)), [0, 1, 250, 0]);
    }
}
