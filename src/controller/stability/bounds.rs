//! The inequalities themselves, each from its source, in SI and for one axis.
//!
//! Passivity of a device of damping `b` with a sampled, held force (Colgate and Schenkel 1997):
//! `b > sup (T/2) / (1 - cos ωT) Re{(1 - e^{-jωT}) H(e^{jωT})}` over all frequencies up to half the
//! sample rate, H taking positions to forces.

use std::f64::consts::PI;

use nalgebra::Complex;

/// Angles ωT between which the supremum is looked for: from next to nothing to half the sample rate.
const LOWEST: f64 = 1e-4;

/// So many of them, each a fixed part larger than the last.
const ANGLES: u32 = 2_000;

/// Each narrowing leaves two thirds of the angles around the largest value.
const NARROWINGS: u32 = 60;

/// What a controller makes of positions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impedance {
    /// In N/m.
    pub stiffness: f64,
    /// In N·s/m, by backward differences.
    pub damping: f64,
    /// The time constant of a low pass on those, in s.
    pub filter: f64,
    /// So many whole cycles late, beyond the hold itself.
    pub late: u32,
}

/// A wrench that is reflected while displacement commands velocity (Eq. 5, 6 and NTRFC).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateReflection {
    /// K_V, in 1/s.
    pub rate_gain: f64,
    /// K_T.
    pub wrench_gain: f64,
    /// K_FA, in m/s per N.
    pub accommodation: f64,
    /// Of what the object meets, in N/m.
    pub stiffness: f64,
}

/// A hand and the device it holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// Of both, in kg.
    pub mass: f64,
    /// Of both, in N·s/m.
    pub damping: f64,
    /// Of the hand, in N/m.
    pub stiffness: f64,
}

impl Impedance {
    /// The damping in N·s/m that a device needs to be passive with it, in cycles of `period` s.
    pub fn required_damping(&self, period: f64) -> f64 {
        let Self { stiffness, damping, filter, late } = *self;
        required_damping(period, |z| {
            let rate = (z - 1.0) / (z * (period + filter) - filter);
            (rate * damping + stiffness) * z.powi(-i32::try_from(late).unwrap_or(i32::MAX))
        })
    }
}

impl RateReflection {
    /// The stiffness that is felt in the end, in N/m; infinite where nothing gives way.
    pub fn felt_stiffness(&self) -> f64 {
        self.wrench_gain * self.rate_gain / self.accommodation
    }

    /// The damping in N·s/m that a device needs to be passive with it, in cycles of `period` s:
    /// `k_felt (1 / (K_FA k_e) + T / 2)`. Infinite where nothing gives way: reflection in rate mode is
    /// never passive then.
    pub fn required_damping(&self, period: f64) -> f64 {
        if self.wrench_gain * self.rate_gain <= 0.0 {
            return 0.0;
        }
        let gives_way = self.accommodation * self.stiffness;
        self.felt_stiffness() * (gives_way.recip() + period / 2.0)
    }

    /// Both sides of Routh's condition for the hand that holds the device:
    /// `M (K_h a + K_T k_e K_V) < (b + M a)(K_h + b a)`, with `a = K_FA k_e`.
    pub fn routh(&self, held: &Held) -> [f64; 2] {
        let a = self.accommodation * self.stiffness;
        let driven = self.wrench_gain * self.stiffness * self.rate_gain;
        let Held { mass, damping, stiffness } = *held;
        [mass * (stiffness * a + driven), (damping + mass * a) * (stiffness + damping * a)]
    }
}

/// The largest `K_FA k_e T` with which accommodation is stable whose wrench is `late` cycles old.
pub fn accommodation_limit(late: u32) -> f64 {
    let n = f64::from(late);
    2.0 * (n * PI / (2.0 * n + 1.0)).cos()
}

/// The stiffest spring in N/m that stays quiet on an encoder whose steps are `quantum` m, against
/// damping and dry friction in N (Abbott and Okamura 2005): `min(2 b / T, 2 f_c / Δ)`.
pub fn quantised_stiffness(damping: f64, period: f64, friction: f64, quantum: f64) -> f64 {
    (2.0 * damping / period).min(2.0 * friction / quantum)
}

/// The stiffest spring in N/m that a device of `damping` renders passively beside a damper, `late`
/// cycles late: one side of its Z-width. Zero where not even the damper is.
pub fn stiffest(device: f64, beside: &Impedance, period: f64) -> f64 {
    let fits =
        |stiffness: f64| Impedance { stiffness, ..*beside }.required_damping(period) <= device;
    if !fits(0.0) {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, 2.0 * device / period + 1.0);
    for _ in 0..NARROWINGS {
        let middle = f64::midpoint(low, high);
        if fits(middle) { low = middle } else { high = middle }
    }
    low
}

/// The condition above: with `θ = ωT`, `(T/2) (Re H - cot(θ/2) Im H)` at its largest.
fn required_damping(period: f64, h: impl Fn(Complex<f64>) -> Complex<f64>) -> f64 {
    let at = |angle: f64| {
        let h = h(Complex::from_polar(1.0, angle));
        period / 2.0 * (h.re - h.im / (angle / 2.0).tan())
    };
    let step = (PI / LOWEST).ln() / f64::from(ANGLES);
    let angles = (0..=ANGLES).map(|place| (LOWEST.ln() + step * f64::from(place)).exp().min(PI));
    let worst = angles.max_by(|a, b| at(*a).total_cmp(&at(*b))).unwrap_or(PI);
    let (mut low, mut high) = ((worst * (-step).exp()).max(LOWEST), (worst * step.exp()).min(PI));
    for _ in 0..NARROWINGS {
        let third = (high - low) / 3.0;
        if at(low + third) < at(high - third) { low += third } else { high -= third }
    }
    at(f64::midpoint(low, high)).max(at(worst))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_spring_needs_half_of_itself_times_the_cycle_and_more_when_late(
            stiffness in 1.0..1e5_f64, period in 1e-4..1e-2_f64, late in 0..6_u32
        ) {
            let spring = Impedance { stiffness, late, ..Impedance::default() };
            let expected = stiffness * period * (0.5 + f64::from(late));
            prop_assert!((spring.required_damping(period) / expected - 1.0).abs() < 1e-5);
        }

        #[test]
        fn a_filter_helps_and_never_hurts(damping in 0.1..50.0_f64, filter in 1e-4..0.1_f64) {
            let plain = Impedance { damping, ..Impedance::default() }.required_damping(1e-3);
            let filtered =
                Impedance { damping, filter, ..Impedance::default() }.required_damping(1e-3);
            prop_assert!((plain - damping).abs() < 1e-6 * damping);
            prop_assert!(filtered < plain);
        }

        #[test]
        fn what_is_rendered_is_as_stiff_as_can_be(device in 0.1..20.0_f64, late in 0..4_u32) {
            let beside = Impedance { damping: 0.05, filter: 0.01, late, ..Impedance::default() };
            let stiffness = stiffest(device, &beside, 1e-3);
            let needs = |stiffness| Impedance { stiffness, ..beside }.required_damping(1e-3);
            prop_assert!(needs(stiffness) <= device && needs(stiffness * 1.01 + 1.0) > device);
        }
    }

    #[test]
    fn where_nothing_gives_way_rate_reflection_is_never_passive() {
        let rigid =
            RateReflection { rate_gain: 2.0, wrench_gain: 0.5, accommodation: 0.0, stiffness: 1e5 };
        assert!(rigid.required_damping(1e-3).is_infinite());
        let unfelt = RateReflection { wrench_gain: 0.0, ..rigid };
        assert!(unfelt.required_damping(1e-3) == 0.0);
    }
}
