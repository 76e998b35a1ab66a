//! Shared control: some axes of {MRF} follow the operator, the others an autonomous rate (Williams 1997, 4.3 and its
//! references). Force accommodation is added to both.
//!
//! ```text
//!  v_m = S v_operator + (I - S) v_auto + K_FA f_m        S diagonal, 0 to 1
//! ```

use thiserror::Error;

use units::spatial::Twist;

/// Share of the operator on each axis, and the autonomous rate for the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedControl {
    operator: [f64; 6],
    v_m_auto: Twist,
}

/// Reason why shared control is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidSharing {
    /// Share out of range.
    #[error("share of the operator must be within 0..=1, got {0}")]
    Share(f64),
    /// Autonomous rate that is infinite or NaN.
    #[error("autonomous rate must be finite, got {0}")]
    Rate(f64),
}

impl Default for SharedControl {
    /// All axes follow the operator.
    fn default() -> Self {
        Self { operator: [1.0; 6], v_m_auto: Twist::ZERO }
    }
}

impl SharedControl {
    /// Creates shared control from the operator's share per axis and the autonomous twist, in m/s and rad/s.
    ///
    /// # Errors
    /// Returns the first share outside 0 to 1, or rate that is not finite.
    pub fn new(operator: [f64; 6], v_m_auto: [f64; 6]) -> Result<Self, InvalidSharing> {
        if let Some(wrong) = operator.into_iter().find(|share| !(0.0..=1.0).contains(share)) {
            return Err(InvalidSharing::Share(wrong));
        }
        match v_m_auto.into_iter().find(|rate| !rate.is_finite()) {
            Some(wrong) => Err(InvalidSharing::Rate(wrong)),
            None => Ok(Self { operator, v_m_auto: Twist::from_components(v_m_auto) }),
        }
    }

    /// Combines the operator's rate with the autonomous rate.
    pub fn rate(&self, v_m_operator: &Twist) -> Twist {
        let rest = self.operator.map(|share| 1.0 - share);
        v_m_operator.scaled(&self.operator) + self.v_m_auto.scaled(&rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_axis_follows_its_share() {
        let shared = SharedControl::new([1.0, 0.0, 0.5, 1.0, 1.0, 0.0], [0.2; 6]).unwrap();
        let v_m = shared.rate(&Twist::from_components([0.1; 6]));
        let expected = Twist::from_components([0.1, 0.2, 0.15, 0.1, 0.1, 0.2]);
        let pairs = v_m.components().into_iter().zip(expected.components());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-15), "{v_m:?}");
    }

    #[test]
    fn default_leaves_everything_to_the_operator() {
        let v_m = Twist::from_components([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
        assert_eq!(SharedControl::default().rate(&v_m), v_m);
    }

    #[test]
    fn invalid_shares_and_rates_are_refused() {
        for wrong in [-0.1, 1.1, f64::NAN] {
            assert!(SharedControl::new([wrong; 6], [0.0; 6]).is_err());
        }
        assert!(SharedControl::new([1.0; 6], [f64::NAN; 6]).is_err());
    }
}
