//! An arm that is driven away while its weight is taken up: a wrong mass, a wrong sign, a wrong zero.
//!
//! Gravity compensation that is right drives nothing: it takes the weight off the hand or the stop that
//! carries it, or slows an arm that falls. So it is only watched for joints that move the way they are
//! pushed, and only while the share of gravity grows and nobody holds the deadman; later the operator may
//! move the arm as they like. Who lifts the arm within this second looks the same, and has to arm again.

use std::time::Duration;

use crate::controller::JointVector;
use crate::telemetry::cause::Cause;
use crate::time::Instant;

/// Faster is a motion, in rad/s (m/s).
const MOVES: f64 = 0.1;

/// A motion lasts so long: one difference of two samples is none.
const LASTS: Duration = Duration::from_millis(10);

/// Since when a joint has been driven.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Unheld {
    since: Option<Instant>,
}

impl Unheld {
    /// Takes the joint rates in rad/s (m/s) and the torques that led to them. `is_watched` while the
    /// weight is taken up and nobody holds the deadman.
    pub(super) fn watch(
        &mut self,
        now: Instant,
        is_watched: bool,
        tau: &JointVector,
        qd: &JointVector,
    ) -> Option<Cause> {
        let is_driven = |(tau, qd): (&f64, &f64)| qd.abs() > MOVES && tau * qd > 0.0;
        let moves = is_watched && tau.iter().zip(qd.iter()).any(is_driven);
        self.since = if moves { self.since.or(Some(now)) } else { None };
        let lasts = self.since.is_some_and(|since| now.since(since) >= LASTS);
        lasts.then_some(Cause::MovesUnheld)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    fn joints(second: f64) -> JointVector {
        JointVector::from([0.0, second, 0.0, 0.0, 0.0, 0.0])
    }

    /// Whether a motion that lasts 20 ms trips.
    fn trips(is_watched: bool, tau: f64, qd: f64) -> bool {
        let mut unheld = Unheld::default();
        (0..=20).any(|ms| unheld.watch(at(ms), is_watched, &joints(tau), &joints(qd)).is_some())
    }

    #[test]
    fn hazard_41_an_arm_that_is_driven_while_it_is_taken_up_trips() {
        assert!(trips(true, 2.0, 0.11) && trips(true, -2.0, -0.11));
        assert!(!trips(true, 2.0, 0.09), "too slow");
        assert!(!trips(true, 2.0, -0.5), "it falls and is caught");
        assert!(!trips(true, 0.0, 0.5), "not by the node");
        assert!(!trips(false, 2.0, 0.5), "somebody moves it");
        assert!(!trips(true, f64::NAN, f64::NAN));
    }

    #[test]
    fn one_difference_is_no_motion() {
        let mut unheld = Unheld::default();
        for ms in 0..100 {
            let qd = if ms % 10 == 9 { 0.0 } else { 0.5 };
            assert_eq!(unheld.watch(at(ms), true, &joints(1.0), &joints(qd)), None);
        }
    }
}
