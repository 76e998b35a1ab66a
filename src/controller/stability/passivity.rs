//! Device damping that makes a sampled law passive: the condition of Colgate and Schenkel (1997), evaluated numerically
//! for a linear law.
//!
//! The law holds a force of `H(z)` times the sampled displacement for one period `T`. With a device of damping `b` it is
//! passive if and only if, for all `0 < ω <= π/T`,
//!
//! ```text
//!  b > T/2 · Re{(1 - z⁻¹) H(z)} / (1 - cos ωT),  z = exp(jωT)
//!    = T/2 · (Re H - cot(ωT/2) Im H)
//! ```
//!
//! Closed forms are in [`bounds`](crate::stability::bounds).

use std::f64::consts::PI;

use nalgebra::Complex;

use units::math;

/// Minimum angle ωT evaluated, in rad: far below any pole of a law in use.
const LOWEST: f64 = 1e-9;

/// Number of logarithmically spaced angles, which resolve poles near `z = 1`.
const RATIOS: u32 = 512;

/// Number of linearly spaced angles, which resolve the ripple of delays; more for each cycle of delay.
const DISTANCES: u32 = 128;
const DISTANCES_PER_CYCLE: u32 = 32;

/// Maximum delay considered, in cycles.
const MAX_DELAY_CYCLES: u32 = 1_000;

/// Golden-section steps around the worst angle: each leaves 62 % of the interval.
const SHRINKINGS: u32 = 60;

/// Transfer function of a law from the grip's displacement to its force, without delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Spring and damper: `K + B (z - 1) / ((T + τ) z - τ)`.
    Impedance {
        /// K, in N/m or N·m/rad.
        stiffness: f64,
        /// B, in N·s/m or N·m·s/rad.
        damping: f64,
        /// τ of the first-order velocity filter, in s; zero without a filter.
        filter: f64,
    },
    /// Reflection in rate mode with an object that yields: `G T / (z - 1 + a T)`. The servo lag, [`SampledLaw::lag`], is
    /// inside the loop.
    Rate {
        /// `G = K_T k_e K_V`, in N/(m·s) or N·m/(rad·s).
        gain: f64,
        /// `a = K_FA k_e`, rate at which the object yields, in 1/s.
        yield_rate: f64,
    },
}

/// Law in a sampled loop with servo and delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledLaw {
    /// Transfer function without delay.
    pub law: Law,
    /// T, in s.
    pub period: f64,
    /// Time constant of the servo that the displacement passes, in s; zero without a servo.
    pub lag: f64,
    /// Delay from the sample to the force, in cycles; zero for a force held from its sample on.
    pub delay: u32,
}

impl SampledLaw {
    /// Creates a spring and a damper without velocity filter, servo or delay.
    pub const fn impedance(stiffness: f64, damping: f64, period: f64) -> Self {
        let law = Law::Impedance { stiffness, damping, filter: 0.0 };
        Self { law, period, lag: 0.0, delay: 0 }
    }

    /// Returns the device damping above which this law is passive, in N·s/m or N·m·s/rad. Negative for a law that
    /// dissipates at every frequency; infinite if no damping suffices.
    pub fn required_damping(&self) -> f64 {
        if !self.settles() {
            return f64::INFINITY;
        }
        let condition = |angle: f64| self.condition(angle);
        let angles = angles(self.delay);
        let found = angles.iter().map(|&angle| (condition(angle), angle));
        let Some((most, worst)) = found.max_by(|(a, _), (b, _)| a.total_cmp(b)) else {
            return f64::INFINITY;
        };
        let below = angles.iter().copied().filter(|angle| *angle < worst).fold(LOWEST, f64::max);
        let above = angles.iter().copied().filter(|angle| *angle > worst).fold(PI, f64::min);
        highest(condition, below, above).max(most)
    }

    /// Returns whether the law comes to rest with the hand. In rate mode it does not if the object does not yield, or yields
    /// too fast for the period.
    fn settles(&self) -> bool {
        match self.law {
            Law::Impedance { .. } => true,
            Law::Rate { gain, .. } if gain <= 0.0 => true,
            Law::Rate { yield_rate, .. } => {
                // Jury's test of (z - 1)(z - 1 + p) + a T p z, with p the servo's part.
                let part = self.part();
                yield_rate > 0.0 && yield_rate * self.period * part < 2.0 * (2.0 - part)
            }
        }
    }

    /// Returns `T/2 (Re H - cot(ωT/2) Im H)` at the angle ωT.
    fn condition(&self, angle: f64) -> f64 {
        let h = self.response(angle);
        self.period / 2.0 * (h.re - h.im / math::tan(angle / 2.0))
    }

    /// Returns `H(exp(j angle))`, delay included.
    fn response(&self, angle: f64) -> Complex<f64> {
        let (sin, cos) = math::sin_cos(angle / 2.0);
        let z_less_one = Complex::new(-2.0 * sin * sin, 2.0 * sin * cos); // exact at small angles
        let z = z_less_one + 1.0;
        let part = self.part();
        let lag = z * part / (z_less_one + part);
        let undelayed = match self.law {
            Law::Impedance { stiffness, damping, filter } => {
                let velocity = z_less_one / (z_less_one * (self.period + filter) + self.period);
                (velocity * damping + stiffness) * lag
            }
            Law::Rate { gain, yield_rate } => {
                let moved = lag * self.period;
                moved * gain / (z_less_one + moved * yield_rate)
            }
        };
        undelayed * math::cis(-angle * f64::from(self.delay))
    }

    /// Returns the step response of the servo after one period, `1 - exp(-T/τ)`.
    fn part(&self) -> f64 {
        if self.lag > 0.0 { -math::exp_m1(-self.period / self.lag) } else { 1.0 }
    }
}

/// Returns the angles to evaluate, in `(0, π]`.
fn angles(delay: u32) -> Vec<f64> {
    let ratio = math::powf(PI / LOWEST, f64::from(RATIOS).recip());
    let mut angle = LOWEST;
    let mut angles = Vec::new();
    for _ in 0..RATIOS {
        angles.push(angle);
        angle *= ratio;
    }
    let steps = DISTANCES + DISTANCES_PER_CYCLE * delay.min(MAX_DELAY_CYCLES);
    angles.extend((1..=steps).map(|step| PI * f64::from(step) / f64::from(steps)));
    angles
}

/// Returns the maximum of a unimodal function between `low` and `high`, by golden section.
fn highest(function: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let part = (5.0_f64.sqrt() - 1.0) / 2.0;
    for _ in 0..SHRINKINGS {
        let reach = part * (high - low);
        if function(high - reach) > function(low + reach) {
            high = low + reach;
        } else {
            low = high - reach;
        }
    }
    function(f64::midpoint(low, high))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-6 * b.abs().max(1e-9)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn wall_needs_half_a_period_of_spring_and_all_of_damper(
            k in 1.0..1e4_f64, b in -20.0..20.0_f64, period in 1e-4..1e-2_f64
        ) {
            let required = SampledLaw::impedance(k, b, period).required_damping();
            prop_assert!(near(required, k * period / 2.0 + b.abs()), "{required}");
        }

        #[test]
        fn every_cycle_of_delay_costs_a_period_of_the_spring(
            k in 1.0..1e4_f64, period in 1e-4..1e-2_f64, delay in 0..20_u32
        ) {
            let law = SampledLaw { delay, ..SampledLaw::impedance(k, 0.0, period) };
            let expected = k * period * (0.5 + f64::from(delay));
            prop_assert!(near(law.required_damping(), expected));
        }

        #[test]
        fn a_servo_costs_its_lag(k in 1.0..1e4_f64, lag in 1e-3..1e-1_f64) {
            let period = 1e-3;
            let law = SampledLaw { lag, ..SampledLaw::impedance(k, 0.0, period) };
            let late = period / math::exp_m1(period / lag);
            prop_assert!(near(law.required_damping(), k * (period / 2.0 + late)));
        }

        #[test]
        fn filter_takes_from_a_damper_what_it_asks_for(
            b in 0.1..20.0_f64, period in 1e-4..1e-2_f64, filter in 0.0..0.1_f64
        ) {
            // Its condition rises with the frequency, up to that of ωT = π: z = -1.
            let law = Law::Impedance { stiffness: 0.0, damping: b, filter };
            let law = SampledLaw { law, ..SampledLaw::impedance(0.0, 0.0, period) };
            let expected = b * period / (period + 2.0 * filter);
            prop_assert!(near(law.required_damping(), expected));
        }

        #[test]
        fn required_damping_is_found_between_the_angles_looked_at(
            stiffness in 0.0..200.0_f64, damping in 5.0..20.0_f64, delay in 1..3_u32
        ) {
            // These have one maximum, well within 0 and π.
            let law = Law::Impedance { stiffness, damping, filter: 2e-3 };
            let law = SampledLaw { law, period: 1e-3, lag: 0.0, delay };
            let finely = (1..20_000).map(|step| law.condition(PI * f64::from(step) / 20_000.0));
            let summit = finely.fold(f64::NEG_INFINITY, f64::max);
            let required = law.required_damping();
            // Rounding at the maximum.
            prop_assert!(required >= summit * (1.0 - 1e-12), "{required} for {summit}");
            prop_assert!(required <= summit * (1.0 + 1e-6), "{required} for {summit}");
        }

        #[test]
        fn heavy_hand_swings_below_required_damping_and_not_above(
            k in 10.0..1e4_f64, period in 5e-4..5e-3_f64, delay in 0..5_u32
        ) {
            let law = SampledLaw { delay, ..SampledLaw::impedance(k, 0.0, period) };
            let required = law.required_damping();
            prop_assert!(growth(k, period, delay, 0.8 * required) > 1.0);
            prop_assert!(growth(k, period, delay, 1.2 * required) < 1.0);
        }

        #[test]
        fn jurys_test_agrees_with_the_roots_of_its_polynomial(
            ratio in 0.0..2.0_f64, period in 1e-4..1e-2_f64, lag in 0.0..2e-2_f64, is_direct in any::<bool>()
        ) {
            let lag = if is_direct { 0.0 } else { lag };
            let part = if is_direct { 1.0 } else { 1.0 - math::exp(-period / lag) };
            // The bound of Jury's test is at a ratio of 1.
            let yield_rate = ratio * 2.0 * (2.0 - part) / (part * period);
            let law = Law::Rate { gain: 50.0, yield_rate };
            let law = SampledLaw { law, period, lag, delay: 0 };
            // (z - 1)(z - 1 + p) + a T p z = z² - 2 b z + c
            let (b, c) = (1.0 - part / 2.0 - yield_rate * period * part / 2.0, 1.0 - part);
            let spread = b * b - c;
            let largest = if spread < 0.0 { c.sqrt() } else { b.abs() + spread.sqrt() };
            prop_assume!((largest - 1.0).abs() > 1e-9);
            prop_assert_eq!(law.settles(), largest < 1.0, "{} at {}", largest, ratio);
            prop_assert_eq!(law.required_damping().is_finite(), largest < 1.0);
        }

        #[test]
        fn no_law_needs_less_than_it_does_at_some_angle(
            k in 0.0..1e3_f64, damping in 0.0..20.0_f64, filter in 0.0..0.02_f64,
            lag in 0.0..0.02_f64, delay in 0..4_u32, angle in 1e-6..PI
        ) {
            let law = Law::Impedance { stiffness: k, damping, filter };
            let law = SampledLaw { law, period: 1e-3, lag, delay };
            let required = law.required_damping();
            prop_assert!(law.condition(angle) <= required + 1e-6 * (1.0 + required.abs()));
        }
    }

    /// Returns the growth of an oscillation of 63 periods T after many of them, with sampled spring `k` and damping `b`,
    /// exact between the samples.
    fn growth(k: f64, period: f64, delay: u32, b: f64) -> f64 {
        let mass = k * math::powf(period / 0.1, 2.0);
        let decay = -math::exp_m1(-period * b / mass);
        let (mut x, mut v) = (1.0_f64, 0.0);
        let mut late = std::collections::VecDeque::from(vec![1.0; usize::try_from(delay).unwrap()]);
        let mut largest = [0.0_f64; 2];
        for largest in &mut largest {
            for _ in 0..5_000 {
                late.push_back(x);
                let terminal = -k * late.pop_front().unwrap() / b;
                x += terminal * period + (v - terminal) * decay * mass / b;
                v += (terminal - v) * decay;
                *largest = largest.max(x.abs());
            }
        }
        largest[1] / largest[0]
    }

    #[test]
    fn jurys_bound_is_sharp_with_and_without_a_servo() {
        for lag in [0.0, 1e-3, 20e-3] {
            let settles = |yield_rate| {
                let law = Law::Rate { gain: 1.0, yield_rate };
                SampledLaw { law, period: 1e-3, lag, delay: 0 }.settles()
            };
            let part = if lag > 0.0 { 1.0 - math::exp(-1e-3 / lag) } else { 1.0 };
            let bound = 2.0 * (2.0 - part) / (part * 1e-3);
            assert!(settles(bound * (1.0 - 1e-9)), "{lag} s");
            assert!(!settles(bound * (1.0 + 1e-9)), "{lag} s");
            assert!(settles(1e-9) && !settles(0.0) && !settles(-1e-9), "{lag} s");
        }
        let still = Law::Rate { gain: 0.0, yield_rate: 0.0 };
        assert!(SampledLaw { law: still, period: 1e-3, lag: 0.0, delay: 0 }.settles());
    }

    #[test]
    fn a_rate_that_nothing_gives_way_to_is_never_passive() {
        let law = |yield_rate| SampledLaw {
            law: Law::Rate { gain: 100.0, yield_rate },
            period: 1e-3,
            lag: 0.0,
            delay: 0,
        };
        assert!(law(0.0).required_damping().is_infinite());
        assert!(law(2_000.0).required_damping().is_infinite());
        assert!(law(1e-3).required_damping().is_finite());
    }
}
