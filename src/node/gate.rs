//! The last gate before the bus: whatever was computed, no drive is told more than it may be, nor is a
//! torque told that grows by more than a tenth of that in a cycle. It may shrink as fast as it likes.
//!
//! It trusts nobody: not the controller's limits, not its slew, which asks for less under normal
//! conditions.

use controller::JointVector;
use units::drive::PerMille;

/// A torque grows by at most this part of the most, each cycle.
const GROWTH: i16 = 10;

/// What each drive was told last, and the most it may be told, in ‰ of its rated torque.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gate {
    most: [i16; 6],
    told: [i16; 6],
    /// In the cycle before.
    before: [i16; 6],
}

impl Gate {
    /// Nothing told yet. `most` is the lesser of the joint's capacity and what its drive is limited to
    /// (6072h), which bring-up sets to that.
    pub(super) fn new(most: [PerMille; 6]) -> Self {
        Self {
            most: most.map(|PerMille(most)| most.saturating_abs()),
            told: [0; 6],
            before: [0; 6],
        }
    }

    /// What may be told of `targets`, made of `tau`. None of it unless there `may_be_torque`, or if one
    /// torque is no number: all six end together.
    pub(super) fn pass(
        &mut self,
        may_be_torque: bool,
        tau: &JointVector,
        targets: &[PerMille; 6],
    ) -> [PerMille; 6] {
        let passes = may_be_torque && tau.iter().all(|tau| tau.is_finite());
        self.before = self.told;
        for ((told, most), PerMille(target)) in self.told.iter_mut().zip(self.most).zip(targets) {
            *told = if passes { nearest(*told, *target, most) } else { 0 };
        }
        self.told.map(PerMille)
    }

    /// Takes back the torques that were not sent, and returns what the drives hold: those drives keep the
    /// torque of the cycle before, from which the next one grows. A zero is never taken back.
    pub(super) fn take_back(&mut self, was_sent: [bool; 6]) -> [PerMille; 6] {
        let joints = self.told.iter_mut().zip(self.before).zip(was_sent);
        for ((told, before), _) in joints.filter(|((told, _), was_sent)| !was_sent && **told != 0) {
            *told = before;
        }
        self.told.map(PerMille)
    }
}

/// The target, or as near to it as may be told after `told`.
fn nearest(told: i16, target: i16, most: i16) -> i16 {
    let growth = (most / GROWTH).max(1);
    let lowest = told.min(0).saturating_sub(growth).max(-most);
    let highest = told.max(0).saturating_add(growth).min(most);
    target.clamp(lowest, highest)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::*;

    use super::*;
    use config::Config;

    /// Any number: zeros of both signs, subnormals, infinities and those that are none among them.
    fn anything() -> impl Strategy<Value = f64> {
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, f64::MIN_POSITIVE / 4.0];
        prop_oneof![any::<f64>(), -20.0..20.0_f64, prop::sample::select(odd.to_vec())]
    }

    proptest! {
        #[test]
        fn property_09_and_promise_05_cap_and_growth_hold_for_any_torques_at_the_last_gate(
            path in prop::collection::vec(prop::array::uniform6(anything()), 1..40)
        ) {
            let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
            let calibration = config.controller.calibration;
            let most = config.joints.each_ref().map(|joint| joint.calibration.max_target());
            let mut gate = Gate::new(most);
            let most = most.map(|PerMille(most)| most);
            let mut before = [0_i16; 6];
            for tau in path.into_iter().map(JointVector::from) {
                let told = gate.pass(true, &tau, &calibration.targets(&tau)).map(|PerMille(told)| told);
                for ((told, before), most) in told.into_iter().zip(before).zip(most) {
                    prop_assert!(told.abs() <= most);
                    let grows = told.signum() != before.signum() || told.abs() > before.abs();
                    let from = if told.signum() == before.signum() { before.abs() } else { 0 };
                    prop_assert!(!grows || told.abs() - from <= most / 10, "{before} to {told}");
                }
                if !tau.iter().all(|tau| tau.is_finite()) {
                    prop_assert_eq!(told, [0; 6]);
                }
                before = told;
            }
        }

        #[test]
        fn promise_05_whatever_is_asked_of_the_last_gate_it_tells_what_it_may(
            asked in prop::collection::vec(prop::array::uniform6(any::<i16>()), 1..60),
            most in prop::array::uniform6(any::<i16>())
        ) {
            let mut gate = Gate::new(most.map(PerMille));
            for targets in asked {
                let told = gate.pass(true, &JointVector::zeros(), &targets.map(PerMille));
                let is_within = |(PerMille(told), most): (PerMille, i16)| told.abs() <= most.saturating_abs();
                prop_assert!(told.into_iter().zip(most).all(is_within));
            }
        }
    }

    #[test]
    fn what_is_asked_for_steadily_is_told_after_ten_cycles_and_ends_at_once() {
        let mut gate = Gate::new([PerMille(600); 6]);
        let asked = [600, -600, 599, 0, 61, 700].map(PerMille);
        let mut told = [PerMille(0); 6];
        for _ in 0..10 {
            told = gate.pass(true, &JointVector::zeros(), &asked);
        }
        assert_eq!(told, [600, -600, 599, 0, 61, 600].map(PerMille));
        assert_eq!(gate.pass(true, &JointVector::zeros(), &[PerMille(0); 6]), [PerMille(0); 6]);
    }

    #[test]
    fn growth_counts_from_the_torque_that_was_sent() {
        let mut gate = Gate::new([PerMille(600); 6]);
        let mut pass = |target| gate.pass(true, &JointVector::zeros(), &[PerMille(target); 6]);
        assert_eq!(pass(600), [PerMille(60); 6]);
        assert_eq!(pass(600), [PerMille(120); 6]);
        let was_sent = [true, true, true, false, false, false];
        assert_eq!(gate.take_back(was_sent), [120, 120, 120, 60, 60, 60].map(PerMille));
        let told = gate.pass(true, &JointVector::zeros(), &[PerMille(600); 6]);
        assert_eq!(told, [180, 180, 180, 120, 120, 120].map(PerMille));
        gate.pass(true, &JointVector::zeros(), &[PerMille(0); 6]);
        assert_eq!(
            gate.take_back([false; 6]),
            [PerMille(0); 6],
            "zero is repeated until it is sent"
        );
    }

    #[test]
    fn one_torque_that_is_no_number_or_no_permission_is_no_torque_at_all() {
        let asked = [PerMille(50); 6];
        let mut gate = Gate::new([PerMille(600); 6]);
        assert_eq!(gate.pass(true, &JointVector::zeros(), &asked), [PerMille(50); 6]);
        let mut tau = JointVector::zeros();
        tau[4] = f64::NAN;
        assert_eq!(gate.pass(true, &tau, &asked), [PerMille(0); 6]);
        assert_eq!(gate.pass(false, &JointVector::zeros(), &asked), [PerMille(0); 6]);
    }
}
