//! Shape of the passivity damper over time: rate-limited onset and exponential decay prevent chatter.
//!
//! The exact damper of each cycle, `α = -(E + E_f) / (dt vᵀ W v)`, divides microjoules by the square of a quantised
//! velocity. Near E = 0 it therefore chatters. This filter limits the rise to [`ATTACK`] and the decay to [`FADE`], and
//! smooths the velocity over [`SMOOTHING`]. The observer books the held torques, so late or excess damping is accounted
//! for.

use units::math;
use units::spatial::Twist;

/// Rise time from zero to the maximum damping, in s.
const ATTACK: f64 = 10e-3;

/// Maximum rise of the damper's force, in N/s: below it, the hand perceives a pull and not a knock.
const ONSET: f64 = 450.0;

/// Time constant of the decay, in s.
const FADE: f64 = 50e-3;

/// Time constant of the velocity low pass, in s.
const SMOOTHING: f64 = 3e-3;

/// Damping and smoothed velocity of the last cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Damper {
    damping: f64,
    v_g: Twist,
}

impl Damper {
    /// Advances by `dt` s towards the exact damping `wanted`, at most `most` N·s/m, at grip twist `v_g`. Without an engaged
    /// port the damping decays.
    pub(crate) fn next(&mut self, dt: f64, wanted: f64, most: f64, v_g: &Twist, is_engaged: bool) {
        let rise = (most / ATTACK).min(ONSET / v_g.linear.norm());
        let highest = self.damping + rise * dt;
        let lowest = self.damping * math::exp(-dt / FADE);
        let wanted = if is_engaged { wanted } else { 0.0 };
        let damping = wanted.min(highest).max(lowest).min(most);
        self.damping = damping;
        let part = dt / (dt + SMOOTHING);
        self.v_g = self.v_g * (1.0 - part) + *v_g * part;
    }

    /// Damping of this cycle, in N·s/m.
    pub(crate) const fn damping(&self) -> f64 {
        self.damping
    }

    /// Smoothed twist that the damping acts on, in {G}.
    pub(crate) const fn v_g(&self) -> &Twist {
        &self.v_g
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 1e-3;
    const MOST: f64 = 60.0;

    fn along(speed: f64) -> Twist {
        Twist::from_components([speed, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    /// Returns the dampings that follow this sequence of exact dampings.
    fn followed(wanted: impl IntoIterator<Item = f64>) -> Vec<f64> {
        let mut damper = Damper::default();
        let step = |wanted| {
            damper.next(DT, wanted, MOST, &along(0.01), true);
            damper.damping()
        };
        wanted.into_iter().map(step).collect()
    }

    #[test]
    fn damper_sets_in_within_its_attack() {
        let dampings = followed([f64::INFINITY; 12]);
        assert!((dampings[0] - 6.0).abs() < 1e-9 && (dampings[9] - MOST).abs() < 1e-9);
        assert!((dampings[11] - MOST).abs() < 1e-9, "never beyond its maximum");
    }

    #[test]
    fn onset_on_a_fast_hand_is_no_knock() {
        let mut damper = Damper::default();
        let mut before = 0.0;
        for _ in 0..100 {
            damper.next(DT, MOST, MOST, &along(0.3), true);
            let force = damper.damping() * 0.3;
            assert!(force - before <= 0.45 + 1e-9, "{before} to {force} N");
            before = force;
        }
        assert!((before - MOST * 0.3).abs() < 1e-9);
    }

    #[test]
    fn chatter_of_the_exact_damper_is_evened_out() {
        let dampings = followed((0..300).map(|cycle| if cycle % 3 == 0 { MOST } else { 0.0 }));
        for pair in dampings.windows(2) {
            assert!((pair[1] - pair[0]).abs() <= 6.0 + 1e-9);
        }
        let settled = &dampings[100..];
        let (low, high) = settled
            .iter()
            .fold((MOST, 0.0_f64), |(low, high), damping| (low.min(*damping), high.max(*damping)));
        assert!(high - low < 0.1 * MOST, "{low} to {high}");
    }

    #[test]
    fn damper_fades_after_the_contact() {
        let mut damper = Damper { damping: MOST, v_g: along(0.1) };
        damper.next(DT, MOST, MOST, &along(0.1), false);
        assert!((damper.damping() - MOST * math::exp(-DT / FADE)).abs() < 1e-9);
        (0..300).for_each(|_| damper.next(DT, MOST, MOST, &along(0.1), false));
        assert!(damper.damping() < 0.01 * MOST);
    }

    #[test]
    fn uneven_speed_is_smoothed_without_a_bias() {
        let mut damper = Damper::default();
        for cycle in 0..200 {
            damper.next(DT, 0.0, MOST, &along(if cycle % 2 == 0 { 0.12 } else { 0.08 }), true);
        }
        assert!((damper.v_g().linear.x - 0.1).abs() < 0.004, "{:?}", damper.v_g());
    }
}
