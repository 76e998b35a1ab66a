//! Reflection in rate mode over a link with delay: the largest gain that the hand holds stable.
//!
//! With a delay of `d` s from command to wrench the loop is `(M s² + b s + K_h)(s + a) + G exp(-s d)`. By Nyquist's criterion
//! it can swing at `ω` if `G = |P(jω)|` with `P(s) = (M s² + b s + K_h)(s + a)`, and the delay makes its argument π.
//! A delay of up to `d` does so between the frequency at which `arg P + ω d` is π and the one at which `arg P` is. Beyond,
//! the modulus only rises. Without delay the two are one, and the bound is Routh's.

use std::f64::consts::PI;

use crate::stability::bounds::{Held, RateReflection};

/// Frequencies at which the modulus is looked at.
const STEPS: u32 = 256;

/// Halvings that find a frequency, and doublings that find one above it.
const HALVINGS: u32 = 60;

impl RateReflection {
    /// The gain G below which reflection is stable in the hand that holds the grip, with any delay of up to `delay` s.
    pub fn largest_late_gain(&self, held: &Held, delay: f64) -> f64 {
        let most = self.largest_gain(held);
        if delay <= 0.0 {
            return most;
        }
        let (low, high) = (self.frequency(held, delay), self.frequency(held, 0.0));
        let between =
            (0..=STEPS).map(|step| low + (high - low) * f64::from(step) / f64::from(STEPS));
        between.map(|omega| self.modulus(held, omega)).fold(most, f64::min)
    }

    /// The frequency in rad/s at which the argument of the loop with this delay is π.
    fn frequency(&self, held: &Held, delay: f64) -> f64 {
        let Held { mass, damping, stiffness } = *held;
        let argument = |omega: f64| {
            (damping * omega).atan2(stiffness - mass * omega * omega)
                + omega.atan2(self.giving_way)
                + omega * delay
        };
        let above = std::iter::successors(Some(1.0), |omega| Some(2.0 * omega));
        let mut above = above.take(HALVINGS.try_into().unwrap_or(usize::MAX));
        let (mut low, mut high) =
            (0.0, above.find(|omega| argument(*omega) >= PI).unwrap_or(f64::MAX));
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            if argument(middle) < PI {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }

    fn modulus(&self, held: &Held, omega: f64) -> f64 {
        let Held { mass, damping, stiffness } = *held;
        (stiffness - mass * omega * omega).hypot(damping * omega) * omega.hypot(self.giving_way)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use proptest::prelude::*;

    use super::*;

    fn held() -> impl Strategy<Value = Held> {
        (0.3..3.0_f64, 5.0..20.0_f64, 50.0..500.0_f64).prop_map(|(mass, damping, stiffness)| Held {
            mass,
            damping,
            stiffness,
        })
    }

    /// Returns the largest deflections after a push, of the second and of the last of four parts of the time.
    fn swings(held: &Held, reflection: &RateReflection, steps: usize) -> [f64; 2] {
        let (dt, parts) = (2e-4, 400_000);
        let (mut x, mut v, mut force) = (0.0_f64, 0.1, 0.0_f64);
        let mut under_way = VecDeque::from(vec![0.0; steps]);
        let mut most = [0.0_f64; 4];
        for step in 0..parts {
            under_way.push_back(force);
            let late = under_way.pop_front().unwrap();
            force += dt * (reflection.gain * x - reflection.giving_way * force);
            v += dt * (-held.stiffness * x - held.damping * v - late) / held.mass;
            x = (x + dt * v).clamp(-1e6, 1e6);
            let part = &mut most[4 * step / parts];
            *part = part.max(x.abs());
        }
        [most[1], most[3]]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        #[test]
        fn late_reflection_decays_within_its_bound_and_not_beyond(
            held in held(), giving_way in 0.5..20.0_f64, steps in 25..400_usize
        ) {
            let delay = 2e-4 * f64::from(u32::try_from(steps).unwrap());
            let bound = RateReflection { gain: 0.0, giving_way }.largest_late_gain(&held, delay);
            let dies_out = |gain: f64, steps: usize| {
                let [early, late] = swings(&held, &RateReflection { gain, giving_way }, steps);
                late < early.max(1e-12)
            };
            let mut delays = (0..=10).map(|share| steps * share / 10);
            prop_assert!(delays.clone().all(|steps| dies_out(0.8 * bound, steps)), "{bound}");
            prop_assert!(delays.any(|steps| !dies_out(1.25 * bound, steps)), "{bound}");
        }
    }

    proptest! {
        #[test]
        fn short_delay_has_the_bound_of_routh(held in held(), giving_way in 0.0..20.0_f64) {
            let reflection = RateReflection { gain: 0.0, giving_way };
            let (late, none) =
                (reflection.largest_late_gain(&held, 1e-7), reflection.largest_gain(&held));
            prop_assert!((late / none - 1.0).abs() < 1e-3, "{late} {none}");
        }

        #[test]
        fn longer_delay_never_allows_more(held in held(), giving_way in 0.0..20.0_f64) {
            let reflection = RateReflection { gain: 0.0, giving_way };
            let delays = [0.0, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2];
            let bounds = delays.map(|delay| reflection.largest_late_gain(&held, delay));
            prop_assert!(bounds.is_sorted_by(|a, b| *a * 1.001 >= *b), "{bounds:?}");
        }
    }
}
