//! Anti-tie-down: detects a deadman closed for long without motion of the grip, as if taped.
//!
//! A hand on the grip always moves it a little.

use std::time::Duration;

use nalgebra::Isometry3;

use crate::cause::Cause;
use units::time::Instant;

/// Time without motion of the grip after which a closed deadman counts as tied down.
const STANDSTILL_TIMEOUT: Duration = Duration::from_secs(60);

/// Minimum translation of the grip that counts as motion, in m.
const MIN_TRANSLATION: f64 = 1e-3;

/// Minimum rotation of the grip that counts as motion, in rad.
const MIN_ROTATION: f64 = 10e-3;

/// Monitor of the grip's motion.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AntiTieDown {
    /// Start and pose of the current standstill.
    rest: Option<(Instant, Isometry3<f64>)>,
}

impl AntiTieDown {
    /// Checks the pose of the grip while the deadman is held.
    pub(super) fn check(
        &mut self,
        now: Instant,
        is_held: bool,
        x_0_g: &Isometry3<f64>,
    ) -> Option<Cause> {
        let at_rest = self.rest.filter(|(_, x_0_rest)| is_held && is_near(x_0_rest, x_0_g));
        let (since, x_0_rest) = at_rest.unwrap_or((now, *x_0_g));
        self.rest = Some((since, x_0_rest));
        (now.since(since) >= STANDSTILL_TIMEOUT).then_some(Cause::TieDown)
    }
}

/// Returns whether the pose changed by less than the thresholds. NaN counts as motion.
fn is_near(one: &Isometry3<f64>, other: &Isometry3<f64>) -> bool {
    let distance = (one.translation.vector - other.translation.vector).norm();
    distance < MIN_TRANSLATION && one.rotation.angle_to(&other.rotation) < MIN_ROTATION
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: u64) -> Instant {
        Instant::from_micros(seconds * 1_000_000)
    }

    fn along(metres: f64) -> Isometry3<f64> {
        Isometry3::translation(metres, 0.0, 0.0)
    }

    #[test]
    fn hazard_39_deadman_held_for_a_minute_over_a_still_grip_stops() {
        let mut monitor = AntiTieDown::default();
        for second in 0..60 {
            assert_eq!(monitor.check(at(second), true, &along(0.5e-3)), None);
        }
        assert_eq!(monitor.check(at(60), true, &along(0.0)), Some(Cause::TieDown));
        assert_eq!(
            monitor.check(at(61), true, &along(0.0)),
            Some(Cause::TieDown),
            "standstill goes on"
        );
        assert_eq!(monitor.check(at(62), false, &along(0.0)), None, "released");
    }

    #[test]
    fn hand_that_moves_now_and_then_does_not_stop() {
        let mut monitor = AntiTieDown::default();
        for second in 0..600 {
            let place = if second % 50 == 0 { 2e-3 } else { 0.0 };
            assert_eq!(monitor.check(at(second), true, &along(place)), None);
        }
    }

    #[test]
    fn grip_pose_of_nan_counts_as_motion() {
        let mut monitor = AntiTieDown::default();
        for second in 0..100 {
            assert_eq!(monitor.check(at(second), true, &along(f64::NAN)), None);
        }
    }
}
