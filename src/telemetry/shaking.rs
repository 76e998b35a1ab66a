//! Detection of a robot that shakes in free motion: the sensed force alternates from cycle to cycle.
//!
//! From K_FA m = T/2 coth(T/2τ_s), accommodation yields to the inertia of the payload m faster than the servo follows.
//! The arm then shakes at half its cycle rate (docs/adr/0025). Unlike contact, this force has zero mean.

use derive_more::Display;
use nalgebra::Vector3;
use serde::Serialize;

use units::spatial::Wrench;

/// Cycles over which the force is averaged.
const CYCLES: f64 = 50.0;

/// Minimum amplitude of an alternating force that counts as shaking, in N.
const SHAKING_FORCE: f64 = 0.2;

/// Minimum time of shaking that is reported, in s; longer than an impact.
const REPORTED_FROM: f64 = 0.1;

/// Time and amplitude of shaking.
#[derive(Clone, Copy, Debug, Display, Default, PartialEq, Serialize)]
#[display(
    "shakes in free motion, {peak_n:.1} N at half the cycle rate for {seconds:.1} s: lower K_FA or the payload"
)]
pub struct Shaking {
    /// Time of shaking, in s.
    pub seconds: f64,
    /// Largest amplitude of the force, in N.
    pub peak_n: f64,
    #[serde(skip)]
    mean: Vector3<f64>,
    #[serde(skip)]
    alternating: Vector3<f64>,
    #[serde(skip)]
    is_odd: bool,
}

impl Shaking {
    /// Adds the wrench sensed in the next cycle, which lasts `dt` s. A wrench that is not finite is ignored.
    pub fn add(&mut self, f_s: &Wrench, dt: f64) {
        let force = f_s.force;
        self.is_odd = !self.is_odd;
        if !force.iter().all(|part| part.is_finite()) {
            return;
        }
        let turned = if self.is_odd { -force } else { force };
        self.mean += (force - self.mean) / CYCLES;
        self.alternating += (turned - self.alternating) / CYCLES;
        let amplitude = self.alternating.norm();
        if amplitude > SHAKING_FORCE && amplitude > 2.0 * self.mean.norm() {
            self.seconds += dt;
            self.peak_n = self.peak_n.max(amplitude);
        }
    }

    /// Returns whether the shaking is long enough to be reported.
    pub fn is_reported(&self) -> bool {
        self.seconds > REPORTED_FROM
    }

    /// Returns `Some` if the shaking is long enough to be reported.
    pub fn reported(self) -> Option<Self> {
        self.is_reported().then_some(self)
    }

    /// Returns the strongest of several.
    pub fn strongest(all: impl Iterator<Item = Self>) -> Option<Self> {
        all.max_by(|a, b| a.peak_n.total_cmp(&b.peak_n))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::math;

    /// Returns the shaking of `force` of each of 2,000 cycles of 1 ms.
    fn shaking(force: impl Fn(u32) -> f64) -> Shaking {
        let mut shaking = Shaking::default();
        for cycle in 0..2_000 {
            let f_s = Wrench::from_components([force(cycle), 0.0, 0.0, 0.0, 0.0, 0.0]);
            shaking.add(&f_s, 1e-3);
        }
        shaking
    }

    fn alternating(cycle: u32) -> f64 {
        if cycle.is_multiple_of(2) { 0.6 } else { -0.6 }
    }

    #[test]
    fn alternating_force_is_reported_with_its_amplitude() {
        let found = shaking(alternating);
        assert!(found.is_reported() && (found.peak_n - 0.6).abs() < 0.01, "{found:?}");
        assert!(found.to_string().starts_with("shakes in free motion, 0.6 N at half"), "{found}");
    }

    #[test]
    fn contact_slow_swings_and_impacts_are_not_reported() {
        let forces: [fn(u32) -> f64; 5] = [
            |_| 5.0,
            |cycle| 5.0 + alternating(cycle),
            |cycle| 3.0 * math::sin(f64::from(cycle) * 0.05),
            |cycle| if cycle.is_multiple_of(200) { 100.0 } else { 0.0 },
            |_| f64::NAN,
        ];
        for force in forces {
            assert!(!shaking(force).is_reported(), "{:?}", shaking(force));
        }
    }
}
