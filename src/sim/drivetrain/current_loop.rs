//! A drive's current loop: its torque follows the demand as a first-order lag.
//!
//! ```text
//!  T dp/dt = demand - p        p(t + h) = demand + (p(t) - demand) e^(-h/T)
//! ```
//!
//! Solved exactly, so a torque's impulse does not depend on the step. Drives reach 500 to 1500 Hz, which
//! is 0.1 to 0.3 ms.

/// A demand whose torque is this near is reached, in ‰ of rated torque.
const REACHED: f64 = 1e-6;

/// What a motor's current does.
#[derive(Clone, Copy, Debug)]
pub(super) struct CurrentLoop {
    /// In s.
    time_constant: f64,
    demand: f64,
    per_mille: f64,
}

impl CurrentLoop {
    /// Without current.
    pub(super) const fn new(time_constant: f64) -> Self {
        Self { time_constant, demand: 0.0, per_mille: 0.0 }
    }

    /// Asks for `per_mille` of rated torque from now on.
    pub(super) const fn ask(&mut self, per_mille: f64) {
        self.demand = per_mille;
    }

    /// What is asked for, in ‰ of rated torque.
    pub(super) const fn demand(&self) -> f64 {
        self.demand
    }

    /// What it gives now, in ‰ of rated torque.
    pub(super) const fn per_mille(&self) -> f64 {
        self.per_mille
    }

    /// Lets `h` s pass, and returns what it gave in their mean.
    pub(super) fn advance(&mut self, h: f64) -> f64 {
        let missing = self.demand - self.per_mille;
        if missing.abs() <= REACHED || h >= LONG * self.time_constant {
            let caught_up = missing * (self.time_constant / h).min(1.0);
            self.per_mille = self.demand;
            return self.demand - caught_up;
        }
        let share = -(-h / self.time_constant).exp_m1();
        self.per_mille += missing * share;
        self.demand - missing * share * self.time_constant / h
    }
}

/// After so many time constants nothing is missing that an `f64` could tell.
const LONG: f64 = 40.0;

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "what is not touched stays what it is, bit for bit")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const T: f64 = 0.2e-3;

    proptest! {
        #[test]
        fn an_impulse_does_not_depend_on_the_steps(
            before in -1e3..1e3_f64, demand in -1e3..1e3_f64, parts in prop::collection::vec(1e-6..1e-3_f64, 1..9)
        ) {
            let current = |demand| CurrentLoop { time_constant: T, demand, per_mille: before };
            let (mut whole, mut steps) = (current(demand), current(demand));
            let impulse: f64 = parts.iter().map(|h| h * steps.advance(*h)).sum();
            let span: f64 = parts.iter().sum();
            prop_assert!((span * whole.advance(span) - impulse).abs() < 1e-9);
            prop_assert!((whole.per_mille - steps.per_mille).abs() < 1e-5);
        }

        #[test]
        fn it_never_gives_more_than_it_was_or_is_asked_for(
            before in -1e3..1e3_f64, demand in -1e3..1e3_f64, h in 1e-6..1e-1_f64
        ) {
            let mut current = CurrentLoop { time_constant: T, demand, per_mille: before };
            let mean = current.advance(h);
            for given in [mean, current.per_mille] {
                prop_assert!(given <= before.max(demand) + 1e-9 && given >= before.min(demand) - 1e-9);
            }
        }
    }

    #[test]
    fn after_one_time_constant_63_percent_are_there_and_soon_all_of_it() {
        let mut current = CurrentLoop::new(T);
        current.ask(1_000.0);
        current.advance(T);
        assert!((current.per_mille - 632.120_558_828_557_7).abs() < 1e-9);
        for _ in 0..30 {
            current.advance(T);
        }
        assert_eq!(current.per_mille, 1_000.0);
        assert_eq!(current.advance(T), 1_000.0);
    }

    #[test]
    fn without_a_lag_it_gives_what_it_is_asked_for() {
        let mut current = CurrentLoop::new(0.0);
        current.ask(-70.0);
        assert_eq!((current.advance(1e-3), current.per_mille), (-70.0, -70.0));
    }
}
