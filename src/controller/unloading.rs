//! Credit of one unloading: energy that a contact returns once, without being driven.
//!
//! The law answers late, so a hand that presses and lets go gets more energy back than it gave: in pose mode by the lag of
//! the object, in rate mode because the object backs off slower than the hand, and pressed long after the hand came to
//! rest. Only what returns again and again swings the hand. So each contact starts with a credit, and in rate mode it
//! grows by what one unloading from the present deflection returns at most, `F_T · Δx` along the push.

/// The credit of a contact so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Unloading {
    /// Largest energy in J that an unloading could have returned in this contact; `None` without contact.
    peak: Option<f64>,
}

impl Unloading {
    /// Returns the credit in J that this cycle adds: `initial` at the start of a contact, and each rise of `returned`, the
    /// energy that an unloading would return now.
    pub(crate) fn grant(&mut self, is_contact: bool, initial: f64, returned: f64) -> f64 {
        let returned = if returned.is_finite() { returned.max(0.0) } else { 0.0 };
        match (is_contact, self.peak) {
            (false, _) => {
                self.peak = None;
                0.0
            }
            (true, None) => {
                self.peak = Some(returned);
                initial + returned
            }
            (true, Some(peak)) => {
                self.peak = Some(peak.max(returned));
                (returned - peak).max(0.0)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn granted(returned: &[f64]) -> f64 {
        let mut unloading = Unloading::default();
        returned.iter().map(|one| unloading.grant(true, 0.02, *one)).sum()
    }

    #[test]
    fn swinging_contact_has_one_credit() {
        let swings = [0.01, 0.05, 0.0, 0.05, 0.0, 0.05, 0.0];
        assert!((granted(&swings) - 0.07).abs() < 1e-12);
    }

    #[test]
    fn next_contact_starts_with_a_credit_again() {
        let mut unloading = Unloading::default();
        assert!((unloading.grant(true, 0.02, 0.0) - 0.02).abs() < 1e-12);
        assert!(unloading.grant(false, 0.02, 0.0).abs() <= 0.0);
        assert!((unloading.grant(true, 0.02, 0.01) - 0.03).abs() < 1e-12);
    }

    #[test]
    fn energy_that_is_not_finite_is_no_credit() {
        assert!((granted(&[f64::NAN, f64::INFINITY, -1.0]) - 0.02).abs() < 1e-12);
    }
}
