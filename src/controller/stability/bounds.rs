//! Closed-form bounds on gains of one axis: quantisation, return to centre, reflection in rate mode, accommodation,
//! dampers.
//!
//! Units are m and N, or rad and N·m. Symbols are those of [`axis`](crate::stability::axis); `n` is a delay in whole
//! cycles.

use std::f64::consts::PI;

use units::math;

/// Reflection in rate mode: impedance at the hand `Z(s) = G / (s (s + a))` (Parker, Salcudean and Lawrence 1993).
///
/// Its real part is negative at every frequency, so passivity always requires damping. Without accommodation, a = 0, no
/// damping suffices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateReflection {
    /// `G = K_T K_V k_e`, in N/(m·s) or N·m/(rad·s).
    pub gain: f64,
    /// `a = K_FA k_e`, the rate at which the object yields, in 1/s.
    pub yield_rate: f64,
}

impl RateReflection {
    /// Returns the damping that makes reflection passive, in N·s/m or N·m·s/rad, sampled with `period` and `delay`
    /// cycles late. For `a T <= 1` it is `b + K_D >= G/a (1/a + T/2 + n T)`. A period of zero gives the continuous
    /// `G/a²`. Infinite without accommodation.
    pub fn required_damping(&self, period: f64, delay: u32) -> f64 {
        let Self { gain, yield_rate } = *self;
        gain / yield_rate * (yield_rate.recip() + period * (0.5 + f64::from(delay)))
    }
}

/// Maximum stiffness that is passive despite sampling and the position `quantum`, in N/m or N·m/rad:
/// `K <= min(2 b/T, 2 f_c/Δ)` (Abbott and Okamura 2005).
pub fn max_passive_stiffness(damping: f64, period: f64, friction: f64, quantum: f64) -> f64 {
    (2.0 * damping / period).min(2.0 * friction / quantum)
}

/// Maximum stiffness of the return to centre, `2 F0/DB` at the edge of its deadband, in N/m or N·m/rad. A loop without
/// delay is passive with it for `b >= F0 T/DB`.
pub fn max_centring_stiffness(plateau: f64, deadband: f64) -> f64 {
    2.0 * plateau / deadband
}

/// Maximum distance from the centre at which a released grip rests by friction, in m or rad: `sqrt(f_c/a)` with the
/// paper's `a = F0/DB²`. Infinite if friction exceeds the plateau.
pub fn rest_offset(plateau: f64, deadband: f64, friction: f64) -> f64 {
    if friction < plateau { deadband * (friction / plateau).sqrt() } else { f64::INFINITY }
}

/// Maximum rate `a = K_FA k_e` at which an object may yield to contact, in 1/s: `a T < 2 cos(n π/(2n + 1))`. The
/// wrench is `delay` = n cycles late.
pub fn max_yield_rate(period: f64, delay: u32) -> f64 {
    let n = f64::from(delay);
    2.0 * math::cos(n * PI / (2.0 * n + 1.0)) / period
}

/// Bound `coth(T/2τ)` on accommodation of an object whose servo lags by `lag` s, on a surface with damper `d_e`. It is
/// `K_FA (k_e T/2 + d_e) < coth(T/2τ)`, and follows from Jury's test of the sampled loop
///
/// ```text
///  v' = (1 - p) v - p K_FA (k_e x + d_e v),  x' = x + T v',  p = 1 - exp(-T/τ)
/// ```
pub fn max_accommodation(period: f64, lag: f64) -> f64 {
    if lag > 0.0 { math::tanh(period / (2.0 * lag)).recip() } else { 1.0 }
}

/// Maximum `K_FA m`, in s, of an arm with servo lag `lag` in s that also yields to the inertia of its payload `m`. It
/// is `(T/2) coth(T/2τ)`.
///
/// It follows from Jury's test of the sampled loop below, with the mean acceleration of the last period. Position
/// differences do not show a motion at half the cycle rate, so subtracting their inertia does not change the bound.
///
/// ```text
///  v' = (1 - p) v + p u,  u = -K_FA m (v - v_before)/T,  p = 1 - exp(-T/τ)
/// ```
pub fn max_yielded_inertia(period: f64, lag: f64) -> f64 {
    period / 2.0 * max_accommodation(period, lag)
}

/// Maximum rate in 1/s at which an object with servo lag `lag` in s yields without oscillation: `a τ <= 1/4`.
pub fn max_yield_rate_without_oscillation(lag: f64) -> f64 {
    (4.0 * lag).recip()
}

/// Maximum stable sampled damping of a free mass `M`, in N·s/m or N·m·s/rad: `2 tan(π/(4(n + 1))) M/T`. The damper uses
/// the mean speed of the last period, and its force is held for one.
pub fn max_sampled_damping(mass: f64, period: f64, delay: u32) -> f64 {
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
            let bound = max_accommodation(period, lag) / (stiffness * period / 2.0 + damping);
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
            let bound = max_yielded_inertia(period, lag) / mass;
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
            let bound = max_sampled_damping(mass, period, delay);
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
        let reflection = RateReflection { gain: 1.0, yield_rate: 0.0 };
        assert!(reflection.required_damping(1e-3, 0).is_infinite());
    }

    #[test]
    fn friction_beyond_the_plateau_holds_the_hand_anywhere() {
        assert!(rest_offset(1.0, 0.01, 1.0).is_infinite());
        assert!(rest_offset(1.0, 0.01, 0.99) < 0.01);
    }
}
