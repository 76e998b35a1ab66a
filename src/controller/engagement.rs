//! Ramp of task wrench and return to centre after reflection is switched on, optionally delayed until the wrench is
//! small.
//!
//! The [`switches`](crate::switches) decide whether reflection is permitted; this ramp prevents a step of force if the
//! object is in contact at that time. CHAI3D's tools wait for a small force in the same way.

use thiserror::Error;

use crate::period::Period;
use units::spatial::Wrench;

/// Consecutive cycles in which the wrench must be small before the ramp starts.
const SMALL_WRENCH_CYCLES: u32 = 3;

/// Maximum length of the ramp, in s.
const MAX_RAMP_S: f64 = 10.0;

/// Engagement ramp with its state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Engagement {
    /// Increase of the share per cycle.
    step: f64,
    /// Force and moment below which the ramp starts, in N and N·m; `None` starts it at once.
    wait_below: Option<[f64; 2]>,
    share: f64,
    cycles_below: u32,
    has_begun: bool,
}

/// Reason why a ramp is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidEngagement {
    /// Length of the ramp in s, not within 0 and 10.
    #[error("the engagement ramp must be within 0..={MAX_RAMP_S} s, got {0}")]
    Ramp(f64),
    /// Threshold in N or N·m, not positive and finite.
    #[error("the wrench to wait for must be positive and finite, got {0}")]
    Threshold(f64),
}

impl Engagement {
    /// Creates a ramp of `ramp` s. It starts at once, or after three cycles with the wrench below `wait_below` (N, N·m).
    ///
    /// # Errors
    /// Returns an error if the ramp is out of range, or a threshold not positive and finite.
    pub fn new(
        ramp: f64,
        wait_below: Option<[f64; 2]>,
        period: Period,
    ) -> Result<Self, InvalidEngagement> {
        if !(0.0..=MAX_RAMP_S).contains(&ramp) {
            return Err(InvalidEngagement::Ramp(ramp));
        }
        let impossible = |size: &&f64| !(size.is_finite() && **size > 0.0);
        if let Some(size) = wait_below.iter().flatten().find(impossible) {
            return Err(InvalidEngagement::Threshold(*size));
        }
        let step = if ramp > 0.0 { (period.seconds() / ramp).min(1.0) } else { 1.0 };
        Ok(Self { step, wait_below, share: 0.0, cycles_below: 0, has_begun: false })
    }

    /// Returns the reflected share of this cycle, 0 to 1. `f_g` is the wrench at a share of 1.
    pub fn share(&mut self, is_permitted: bool, f_g: &Wrench) -> f64 {
        if !is_permitted {
            (self.share, self.cycles_below, self.has_begun) = (0.0, 0, false);
            return 0.0;
        }
        let is_below = self
            .wait_below
            .is_none_or(|[force, moment]| f_g.force.norm() < force && f_g.moment.norm() < moment);
        self.cycles_below = if is_below { self.cycles_below.saturating_add(1) } else { 0 };
        self.has_begun |= self.wait_below.is_none() || self.cycles_below >= SMALL_WRENCH_CYCLES;
        if self.has_begun {
            self.share = (self.share + self.step).min(1.0);
        }
        self.share
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn engagement(
        ramp: f64,
        wait_below: Option<[f64; 2]>,
    ) -> Result<Engagement, InvalidEngagement> {
        Engagement::new(ramp, wait_below, Period::new(1e-3).unwrap())
    }

    fn push(force: f64) -> Wrench {
        Wrench::from_components([force, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    proptest! {
        #[test]
        fn nothing_begins_with_a_jump(
            ramp in 0.02..2.0_f64,
            steps in prop::collection::vec((any::<bool>(), 0.0..2.0_f64), 1..200),
        ) {
            let mut engagement = engagement(ramp, Some([0.2, 0.01])).unwrap();
            let mut before = 0.0;
            for (is_permitted, force) in steps {
                let share = engagement.share(is_permitted, &push(force));
                prop_assert!(share - before <= 1e-3 / ramp + 1e-12 && (0.0..=1.0).contains(&share));
                prop_assert!(is_permitted || share == 0.0);
                before = share;
            }
        }
    }

    #[test]
    fn a_wall_is_felt_only_after_it_has_been_left() {
        let mut engagement = engagement(0.01, Some([0.2, 0.01])).unwrap();
        for _ in 0..100 {
            assert!(engagement.share(true, &push(5.0)) == 0.0);
        }
        let shares: Vec<f64> = (0..12).map(|_| engagement.share(true, &push(0.1))).collect();
        assert!(shares[1] == 0.0 && shares[2] > 0.0 && shares[11] > 0.99, "{shares:?}");
        assert!(engagement.share(true, &push(5.0)) >= 1.0, "for as long as it is permitted");
    }

    #[test]
    fn without_waiting_it_rises_at_once() {
        let mut engagement = engagement(0.002, None).unwrap();
        let [first, second, _] = [0, 1, 2].map(|_| engagement.share(true, &push(5.0)));
        assert!((first - 0.5).abs() < 1e-12 && second >= 1.0);
    }

    #[test]
    fn each_engagement_waits_and_ramps_anew() {
        for (wait_below, first) in [(Some([0.2, 0.01]), 0.0), (None, 0.1)] {
            let mut engagement = engagement(0.01, wait_below).unwrap();
            (0..20).for_each(|_| _ = engagement.share(true, &push(0.1)));
            assert!(engagement.share(true, &push(5.0)) >= 1.0);
            assert!(engagement.share(false, &push(0.1)) == 0.0);
            // The second engagement is in contact.
            let share = engagement.share(true, &push(5.0));
            assert!((share - first).abs() < 1e-12, "{share}");
        }
    }

    #[test]
    fn a_beginning_ends() {
        for wrong in [-1.0, 11.0, f64::NAN] {
            assert!(engagement(wrong, None).is_err());
        }
        for wrong in [0.0, -1.0, f64::INFINITY, f64::NAN] {
            assert!(engagement(0.1, Some([wrong, 1.0])).is_err());
            assert!(engagement(0.1, Some([1.0, wrong])).is_err());
        }
    }
}
