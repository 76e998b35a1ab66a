//! Counts per newton and newton metre, from the sensor's configuration.

use thiserror::Error;

use units::spatial::Wrench;

/// Counts per unit that are not a finite number above zero.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("counts per unit must be finite and above zero, got {0} per N and {1} per N·m")]
pub struct InvalidScale(f64, f64);

/// Counts per unit of force and of moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    counts_per_n: f64,
    counts_per_nm: f64,
}

impl Scale {
    /// Creates a scale.
    ///
    /// # Errors
    /// Returns an error if a number is not finite, or not above zero.
    pub fn new(counts_per_n: f64, counts_per_nm: f64) -> Result<Self, InvalidScale> {
        let is_valid = |counts: f64| counts.is_finite() && counts > 0.0;
        if is_valid(counts_per_n) && is_valid(counts_per_nm) {
            Ok(Self { counts_per_n, counts_per_nm })
        } else {
            Err(InvalidScale(counts_per_n, counts_per_nm))
        }
    }

    /// Returns the wrench of the counts of a record, in the sensor's own frame.
    pub fn wrench(&self, counts: [i32; 6]) -> Wrench {
        let [fx, fy, fz, mx, my, mz] = counts.map(f64::from);
        let force = [fx, fy, fz].map(|counts| counts / self.counts_per_n);
        let moment = [mx, my, mz].map(|counts| counts / self.counts_per_nm);
        let ([fx, fy, fz], [mx, my, mz]) = (force, moment);
        Wrench::from_components([fx, fy, fz, mx, my, mz])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_become_newton_and_newton_metre() {
        let scale = Scale::new(1e6, 2e6).unwrap();
        let wrench = scale.wrench([1_500_000, -2_000_000, 0, 1_000_000, -500_000, i32::MIN]);
        let expected = [1.5, -2.0, 0.0, 0.5, -0.25, -1_073.741_824];
        assert_eq!(wrench, Wrench::from_components(expected));
    }

    #[test]
    fn scale_that_is_not_above_zero_is_refused() {
        for counts in [0.0, -1e6, f64::NAN, f64::INFINITY] {
            assert!(
                Scale::new(counts, 1e6).is_err() && Scale::new(1e6, counts).is_err(),
                "{counts}"
            );
        }
        let refused = Scale::new(0.0, 1e6).unwrap_err().to_string();
        assert!(refused.contains("got 0 per N and 1000000 per N·m"), "{refused}");
    }
}
