//! Credit of one unloading: energy that a contact returns once, without an oscillation.
//!
//! Delay lets a hand that presses and lets go receive more energy than it gave. In pose mode the cause is the lag of the
//! object. In rate mode the object retreats slower than the hand, and pressed on after the hand came to rest. Only
//! energy that is returned repeatedly makes the hand oscillate. Each contact therefore starts with a credit, which in
//! rate mode grows to the maximum that one unloading returns, `F_T · Δx` along the push.

/// Credit granted to the present contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Unloading {
    /// Maximum energy that an unloading could have returned in this contact, in J; `None` without contact.
    peak: Option<f64>,
}

impl Unloading {
    /// Returns the credit of this cycle, in J. It is `initial` at the start of a contact, and each rise of `returned`,
    /// the energy that an unloading would return now.
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
