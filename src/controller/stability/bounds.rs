//! The bounds on gains that have closed forms: quantisation, return to centre, reflection in rate mode,
//! accommodation, dampers.
//!
//! One axis each, in m and N or in rad and N·m; the symbols are those of the paper, with `b` the damping,
//! `M` the mass and `f_c` the dry friction felt at the grip, `k_e` the stiffness of what the object
//! touches, `T` the period and `n` whole cycles of delay.

use std::f64::consts::PI;

use units::math;

/// Contact felt through a rate command: the impedance at the hand is `Z(s) = G / (s (s + a))`. Its real part is
/// negative at every frequency, so some damping is always needed; without accommodation none is enough
/// (Parker, Salcudean and Lawrence 1993).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateReflection {
    /// `G = K_T K_V k_e`, in N/(m·s) or N·m/(rad·s).
    pub gain: f64,
    /// `a = K_FA k_e`, in 1/s.
    pub giving_way: f64,
}

impl RateReflection {
    /// The damping that makes reflection passive, sampled with `period` and `delay` cycles late:
    /// `b + K_D >= G/a (1/a + T/2 + n T)`, as long as `a T <= 1`. With a period of zero, the
    /// continuous `G/a²`. Infinite without accommodation.
    pub fn required_damping(&self, period: f64, delay: u32) -> f64 {
        let Self { gain, giving_way } = *self;
        gain / giving_way * (giving_way.recip() + period * (0.5 + f64::from(delay)))
    }
}

/// The stiffest spring, in N/m (N·m/rad), that neither its sampling nor the `quantum` of its position
/// makes active: `K <= min(2 b/T, 2 f_c/Δ)` (Abbott and Okamura 2005).
pub fn stiffest_spring(damping: f64, period: f64, friction: f64, quantum: f64) -> f64 {
    (2.0 * damping / period).min(2.0 * friction / quantum)
}

/// The steepest slope of the return to centre, `2 F0/DB` at the edge of its deadband, in N/m
/// (N·m/rad). A loop without delay is passive with it for `b >= F0 T/DB`.
pub fn steepest_centring(plateau: f64, deadband: f64) -> f64 {
    2.0 * plateau / deadband
}

/// Distance from the centre at which a released grip comes to rest, where the return force no longer
/// overcomes friction: `sqrt(f_c/a)`, with the paper's `a = F0/DB²`. In m (rad). Infinite where even
/// the plateau does not.
pub fn rest_offset(plateau: f64, deadband: f64, friction: f64) -> f64 {
    if friction < plateau { deadband * (friction / plateau).sqrt() } else { f64::INFINITY }
}

/// The fastest an object may give way to contact, `a = K_FA k_e` in 1/s, with the wrench `delay` cycles
/// late: `a T < 2 cos(n π/(2n + 1))`.
pub fn fastest_giving_way(period: f64, delay: u32) -> f64 {
    let n = f64::from(delay);
    2.0 * math::cos(n * PI / (2.0 * n + 1.0)) / period
}

/// Bound on accommodation of an object whose servo lags by `lag` s, the surface's damper `d_e` counted
/// in: `K_FA (k_e T/2 + d_e) < coth(T/2τ)`. By Jury's test of the sampled loop
///
/// ```text
///  v' = (1 - p) v - p K_FA (k_e x + d_e v),  x' = x + T v',  p = 1 - exp(-T/τ)
/// ```
pub fn most_given_way(period: f64, lag: f64) -> f64 {
    if lag > 0.0 { math::tanh(period / (2.0 * lag)).recip() } else { 1.0 }
}

/// Maximum `K_FA m`, in s, of an arm whose servo lags by `lag` s and that yields to the inertia of its payload `m`, too:
/// `(T/2) coth(T/2τ)`. By Jury's test of the sampled loop, with the mean acceleration of the last period. Differences of
/// positions do not see a motion of half the cycle rate: removing the inertia they show does not lower the bound.
///
/// ```text
///  v' = (1 - p) v + p u,  u = -K_FA m (v - v_before)/T,  p = 1 - exp(-T/τ)
/// ```
pub fn most_yielded_inertia(period: f64, lag: f64) -> f64 {
    period / 2.0 * most_given_way(period, lag)
}

/// The fastest an object whose servo lags by `lag` s may give way without swinging: `a τ <= 1/4`.
pub fn fastest_without_swinging(lag: f64) -> f64 {
    (4.0 * lag).recip()
}

/// The strongest damper that a bare mass `M` bears: `2 tan(π/(4(n + 1))) M/T`. It is computed from the mean
/// speed of the last period and held for one; stronger, it swings the mass faster and faster.
pub fn strongest_damper(mass: f64, period: f64, delay: u32) -> f64 {
    2.0 * math::tan(PI / (4.0 * f64::from(delay + 1))) * mass / period
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn object_rests_on_damped_surface_within_its_bound_only(
            stiffness in 10.0..1e4_f64, damping in 0.0..100.0_f64, lag in 0.0..0.02_f64
        ) {
            let period = 1e-3;
            let part = if lag > 0.0 { 1.0 - math::exp(-period / lag) } else { 1.0 };
            let bound = most_given_way(period, lag) / (stiffness * period / 2.0 + damping);
            for (gain, rests) in [(0.95 * bound, true), (1.05 * bound, false)] {
                let (mut x, mut v) = (1e-3_f64, 0.0);
                for _ in 0..20_000 {
                    v = (1.0 - part) * v - part * gain * (stiffness * x + damping * v);
                    x = (x + period * v).clamp(-1e9, 1e9);
                }
                prop_assert_eq!(x.abs() < 1e-3, rests, "{} of {}", gain, bound);
            }
        }
    }

    proptest! {
        #[test]
        fn arm_that_yields_to_inertia_rests_within_its_bound_only(
            mass in 0.1..10.0_f64, lag in 0.0..0.05_f64
        ) {
            let period = 1e-3;
            let part = if lag > 0.0 { 1.0 - math::exp(-period / lag) } else { 1.0 };
            let bound = most_yielded_inertia(period, lag) / mass;
            for (gain, rests) in [(0.95 * bound, true), (1.05 * bound, false)] {
                let (mut v, mut before) = (1e-3_f64, 0.0);
                for _ in 0..20_000 {
                    let u = -gain * mass * (v - before) / period;
                    before = v;
                    v = ((1.0 - part) * v + part * u).clamp(-1e9, 1e9);
                }
                prop_assert_eq!(v.abs() < 1e-3, rests, "{} of {}", gain, bound);
            }
        }
    }

    #[test]
    fn bare_mass_bears_a_damper_up_to_its_bound() {
        let (mass, period) = (0.6, 1e-3);
        for delay in 0..5_u32 {
            let bound = strongest_damper(mass, period, delay);
            for (damping, rests) in [(0.9 * bound, true), (1.1 * bound, false)] {
                let (mut x, mut v) = (0.0_f64, 1.0_f64);
                let mut speeds =
                    std::collections::VecDeque::from(vec![0.0; usize::try_from(delay).unwrap()]);
                let mut before = 0.0;
                for _ in 0..5_000 {
                    speeds.push_back((x - std::mem::replace(&mut before, x)) / period);
                    let acceleration = -damping * speeds.pop_front().unwrap() / mass;
                    x += v * period + acceleration * period * period / 2.0;
                    v = (v + acceleration * period).clamp(-1e9, 1e9);
                }
                assert_eq!(v.abs() < 1.0, rests, "{delay} late: {v} m/s with {damping} N·s/m");
            }
        }
    }

    #[test]
    fn reflected_rate_needs_accommodation_to_be_passive() {
        let reflection = RateReflection { gain: 1.0, giving_way: 0.0 };
        assert!(reflection.required_damping(1e-3, 0).is_infinite());
    }

    #[test]
    fn friction_beyond_the_plateau_holds_the_hand_anywhere() {
        assert!(rest_offset(1.0, 0.01, 1.0).is_infinite());
        assert!(rest_offset(1.0, 0.01, 0.99) < 0.01);
    }
}
