//! Current loop: torque follows the demand as a first-order lag.
//!
//! ```text
//!  T dp/dt = demand - p        p(t + h) = demand + (p(t) - demand) e^(-h/T)
//! ```
//!
//! Solved exactly, so the impulse of a torque does not depend on the step. Real drives have a bandwidth of 500 to
//! 1500 Hz, a time constant of 0.1 to 0.3 ms.

/// Difference at which torque and demand count as equal, in ‰ of rated torque.
const SETTLED: f64 = 1e-6;

/// Current loop of one drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct CurrentLoop {
    /// Time constant, in s.
    time_constant: f64,
    demand: f64,
    per_mille: f64,
}

impl CurrentLoop {
    /// Creates the loop at zero current.
    pub(super) const fn new(time_constant: f64) -> Self {
        Self { time_constant, demand: 0.0, per_mille: 0.0 }
    }

    /// Sets the demand, in ‰ of rated torque.
    pub(super) const fn set_demand(&mut self, per_mille: f64) {
        self.demand = per_mille;
    }

    /// Returns the demand, in ‰ of rated torque.
    pub(super) const fn demand(&self) -> f64 {
        self.demand
    }

    /// Returns the torque, in ‰ of rated torque.
    pub(super) const fn per_mille(&self) -> f64 {
        self.per_mille
    }

    /// Advances by `h` s and returns the mean torque.
    pub(super) fn advance(&mut self, h: f64) -> f64 {
        let missing = self.demand - self.per_mille;
        if missing.abs() <= SETTLED || h >= SETTLING_TIME_CONSTANTS * self.time_constant {
            let caught_up = missing * (self.time_constant / h).min(1.0);
            self.per_mille = self.demand;
            return self.demand - caught_up;
        }
        let share = -(-h / self.time_constant).exp_m1();
        self.per_mille += missing * share;
        self.demand - missing * share * self.time_constant / h
    }
}

/// Time constants after which the exponential is below the precision of an `f64`.
const SETTLING_TIME_CONSTANTS: f64 = 40.0;

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "what is not touched stays what it is, bit for bit")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const T: f64 = 0.2e-3;

    proptest! {
        #[test]
        fn impulse_does_not_depend_on_the_steps(
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
        fn torque_stays_between_start_and_demand(
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
    fn one_time_constant_reaches_63_percent() {
        let mut current = CurrentLoop::new(T);
        current.set_demand(1_000.0);
        current.advance(T);
        assert!((current.per_mille - 632.120_558_828_557_7).abs() < 1e-9);
        for _ in 0..30 {
            current.advance(T);
        }
        assert_eq!(current.per_mille, 1_000.0);
        assert_eq!(current.advance(T), 1_000.0);
    }

    #[test]
    fn zero_time_constant_follows_at_once() {
        let mut current = CurrentLoop::new(0.0);
        current.set_demand(-70.0);
        assert_eq!((current.advance(1e-3), current.per_mille), (-70.0, -70.0));
    }
}
