//! Last limiter before the bus: clamps each target torque (6071h) to its maximum, and its rise to 10 % of that per
//! cycle. A fall is not limited.
//!
//! It does not rely on the limits and the slew of the controller, which are tighter in normal operation.

use controller::JointVector;
use units::drive::PerMille;
use units::numbering::Joint;

/// Maximum rise of a target per cycle: its maximum divided by this.
const MAX_RISE_DIVISOR: i16 = 10;

/// Target torques of the drives and their maxima, in ‰ of rated torque.
#[derive(Clone, Copy, Debug)]
pub(super) struct TargetLimiter {
    max: [i16; 6],
    sent: [i16; 6],
    /// Targets of the previous cycle.
    previous: [i16; 6],
    /// A target of this cycle was withdrawn.
    is_withdrawn: bool,
    /// Torque is not allowed in this cycle, or one was not finite.
    is_zeroed: bool,
}

impl TargetLimiter {
    /// Returns a limiter at zero torque. `max` is the lesser of the joint's capacity and the drive's max torque (6072h).
    pub(super) fn new(max: [PerMille; 6]) -> Self {
        let max = max.map(|PerMille(max)| max.saturating_abs());
        Self { max, sent: [0; 6], previous: [0; 6], is_withdrawn: false, is_zeroed: false }
    }

    /// Returns the limited `targets` of the torques `tau`. All six are zero if torque is not allowed, or if one of `tau`
    /// is not finite.
    pub(super) fn limit(
        &mut self,
        torque_allowed: bool,
        tau: &JointVector,
        targets: &[PerMille; 6],
    ) -> [PerMille; 6] {
        let is_valid = torque_allowed && tau.iter().all(|tau| tau.is_finite());
        self.previous = self.sent;
        self.is_withdrawn = false;
        self.is_zeroed = !is_valid;
        for ((sent, max), PerMille(target)) in self.sent.iter_mut().zip(self.max).zip(targets) {
            *sent = if is_valid { limited(*sent, *target, max) } else { 0 };
        }
        self.sent.map(PerMille)
    }

    /// Reverts targets that were not sent to those of the previous cycle, from which the next ones rise. Returns the
    /// targets that the drives hold. Where all torque ends it stays zero, because zero is repeated until it is sent.
    pub(super) fn revert_unsent(&mut self, was_sent: [bool; 6]) -> [PerMille; 6] {
        let joints = self.sent.iter_mut().zip(self.previous).zip(was_sent);
        for ((sent, before), _) in joints.filter(|(_, was_sent)| !was_sent && !self.is_zeroed) {
            *sent = before;
        }
        self.sent.map(PerMille)
    }

    /// Notes that the target of `joint` was replaced by zero after it was sent.
    pub(super) const fn withdraw(&mut self, joint: Joint) {
        *joint.entry_mut(&mut self.sent) = 0;
        *joint.entry_mut(&mut self.previous) = 0;
        self.is_withdrawn = true;
    }

    /// Returns whether targets of this cycle were withdrawn, and all six are zero.
    pub(super) fn is_withdrawn(&self) -> bool {
        self.is_withdrawn && self.sent == [0; 6]
    }
}

/// Returns the target, limited to `max` and to its rise after `sent`.
fn limited(sent: i16, target: i16, max: i16) -> i16 {
    let max_rise = (max / MAX_RISE_DIVISOR).max(1);
    let lowest = sent.min(0).saturating_sub(max_rise).max(-max);
    let highest = sent.max(0).saturating_add(max_rise).min(max);
    target.clamp(lowest, highest)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::*;

    use super::*;
    use config::Config;

    /// Any value, among them NaN, infinities, -0 and subnormals.
    fn any_torque() -> impl Strategy<Value = f64> {
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, f64::MIN_POSITIVE / 4.0];
        prop_oneof![any::<f64>(), -20.0..20.0_f64, prop::sample::select(odd.to_vec())]
    }

    proptest! {
        #[test]
        fn property_09_and_promise_05_cap_and_rise_hold_for_any_torque(
            path in prop::collection::vec(prop::array::uniform6(any_torque()), 1..40)
        ) {
            let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
            let calibration = config.controller.calibration;
            let max = config.joints.each_ref().map(|joint| joint.calibration.max_target());
            let mut limiter = TargetLimiter::new(max);
            let max = max.map(|PerMille(max)| max);
            let mut before = [0_i16; 6];
            for tau in path.into_iter().map(JointVector::from) {
                let sent = limiter.limit(true, &tau, &calibration.targets(&tau)).map(|PerMille(sent)| sent);
                for ((sent, before), max) in sent.into_iter().zip(before).zip(max) {
                    prop_assert!(sent.abs() <= max);
                    let rises = sent.signum() != before.signum() || sent.abs() > before.abs();
                    let from = if sent.signum() == before.signum() { before.abs() } else { 0 };
                    prop_assert!(!rises || sent.abs() - from <= max / 10, "{before} to {sent}");
                }
                if !tau.iter().all(|tau| tau.is_finite()) {
                    prop_assert_eq!(sent, [0; 6]);
                }
                before = sent;
            }
        }

        #[test]
        fn promise_05_targets_stay_within_any_maximum(
            path in prop::collection::vec(prop::array::uniform6(any::<i16>()), 1..60),
            max in prop::array::uniform6(any::<i16>())
        ) {
            let mut limiter = TargetLimiter::new(max.map(PerMille));
            for targets in path {
                let sent = limiter.limit(true, &JointVector::zeros(), &targets.map(PerMille));
                let is_within = |(PerMille(sent), max): (PerMille, i16)| sent.abs() <= max.saturating_abs();
                prop_assert!(sent.into_iter().zip(max).all(is_within));
            }
        }
    }

    #[test]
    fn constant_target_is_reached_after_ten_cycles_and_ends_at_once() {
        let mut limiter = TargetLimiter::new([PerMille(600); 6]);
        let targets = [600, -600, 599, 0, 61, 700].map(PerMille);
        let mut sent = [PerMille(0); 6];
        for _ in 0..10 {
            sent = limiter.limit(true, &JointVector::zeros(), &targets);
        }
        assert_eq!(sent, [600, -600, 599, 0, 61, 600].map(PerMille));
        assert_eq!(limiter.limit(true, &JointVector::zeros(), &[PerMille(0); 6]), [PerMille(0); 6]);
    }

    #[test]
    fn rise_is_limited_from_the_last_sent_target() {
        for sign in [1, -1] {
            let signed = |targets: [i16; 6]| targets.map(|target| PerMille(sign * target));
            let mut limiter = TargetLimiter::new([600, 600, 600, 600, 300, 1_000].map(PerMille));
            let full = signed([1_000; 6]);
            let none = JointVector::zeros();
            assert_eq!(limiter.limit(true, &none, &full), signed([60, 60, 60, 60, 30, 100]));
            assert_eq!(limiter.limit(true, &none, &full), signed([120, 120, 120, 120, 60, 200]));
            let was_sent = [true, false, true, false, false, false];
            let held = signed([120, 60, 120, 60, 30, 100]);
            assert_eq!(limiter.revert_unsent(was_sent), held);
            // Not sent again: the drives hold the same.
            let next = signed([180, 120, 180, 120, 60, 200]);
            assert_eq!(limiter.limit(true, &none, &full), next);
            assert_eq!(limiter.revert_unsent([false; 6]), held);
            assert_eq!(limiter.limit(true, &none, &full), next);
            assert_eq!(limiter.revert_unsent([true; 6]), next);
            limiter.withdraw(Joint::ALL[2]);
            // From zero after it was withdrawn, and in the opposite direction.
            let other_side = signed([-60, -60, -60, -60, -30, -100]);
            let mut from_zero = limiter;
            assert_eq!(from_zero.limit(true, &none, &full), signed([240, 180, 60, 180, 90, 300]));
            assert_eq!(limiter.limit(true, &none, &signed([-1_000; 6])), other_side);
        }
    }

    #[test]
    fn zero_target_without_permission_is_repeated_until_it_is_sent() {
        let mut limiter = TargetLimiter::new([PerMille(600); 6]);
        limiter.limit(true, &JointVector::zeros(), &[PerMille(50); 6]);
        limiter.limit(false, &JointVector::zeros(), &[PerMille(50); 6]);
        assert_eq!(limiter.revert_unsent([false; 6]), [PerMille(0); 6]);
    }

    #[test]
    fn unsent_zero_target_leaves_the_target_before_it() {
        let mut limiter = TargetLimiter::new([PerMille(600); 6]);
        let held = [50, -50, 50, 50, 50, 50].map(PerMille);
        limiter.limit(true, &JointVector::zeros(), &held);
        for _ in 0..2 {
            limiter.limit(true, &JointVector::zeros(), &[PerMille(0); 6]);
            assert_eq!(limiter.revert_unsent([false; 6]), held);
        }
        limiter.limit(true, &JointVector::zeros(), &[PerMille(0); 6]);
        let sent = [true, false, true, true, true, true];
        assert_eq!(limiter.revert_unsent(sent), [0, -50, 0, 0, 0, 0].map(PerMille));
        // Withdrawn: a zero was sent in its place.
        limiter.limit(true, &JointVector::zeros(), &held);
        limiter.withdraw(Joint::ALL[1]);
        assert_eq!(limiter.revert_unsent([false; 6]), [PerMille(0); 6]);
    }

    #[test]
    fn one_nan_torque_or_a_missing_permission_zeroes_all_targets() {
        let targets = [PerMille(50); 6];
        let mut limiter = TargetLimiter::new([PerMille(600); 6]);
        assert_eq!(limiter.limit(true, &JointVector::zeros(), &targets), [PerMille(50); 6]);
        let mut tau = JointVector::zeros();
        tau[4] = f64::NAN;
        assert_eq!(limiter.limit(true, &tau, &targets), [PerMille(0); 6]);
        assert_eq!(limiter.limit(false, &JointVector::zeros(), &targets), [PerMille(0); 6]);
    }
}
