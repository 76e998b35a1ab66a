//! Anti-tie-down: a deadman that is held for long over a grip that does not move is taped, or its operator is
//! asleep. A hand on a grip always moves it a little.

use std::time::Duration;

use nalgebra::Isometry3;

use crate::cause::Cause;
use units::time::Instant;

/// Maximum time for which a hand holds a grip still.
const MAX_STANDSTILL: Duration = Duration::from_secs(60);

/// Smallest motion of the grip that counts, in m.
const MIN_MOTION: f64 = 1e-3;

/// Smallest turn of the grip that counts, in rad.
const MIN_TURN: f64 = 10e-3;

/// Where the grip was when it last moved, and when.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AntiTieDown {
    rest: Option<(Instant, Isometry3<f64>)>,
}

impl AntiTieDown {
    /// Takes where the grip is, and whether the deadman is held.
    pub(super) fn watch(
        &mut self,
        now: Instant,
        is_held: bool,
        x_0_g: &Isometry3<f64>,
    ) -> Option<Cause> {
        let at_rest = self.rest.filter(|(_, x_0_rest)| is_held && is_near(x_0_rest, x_0_g));
        let (since, x_0_rest) = at_rest.unwrap_or((now, *x_0_g));
        self.rest = Some((since, x_0_rest));
        (now.since(since) >= MAX_STANDSTILL).then_some(Cause::TieDown)
    }
}

/// Returns whether the pose changed by less than the thresholds. NaN counts as motion.
fn is_near(one: &Isometry3<f64>, other: &Isometry3<f64>) -> bool {
    let away = (one.translation.vector - other.translation.vector).norm();
    away < MIN_MOTION && one.rotation.angle_to(&other.rotation) < MIN_TURN
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
        let mut watch = AntiTieDown::default();
        for second in 0..60 {
            assert_eq!(watch.watch(at(second), true, &along(0.5e-3)), None);
        }
        assert_eq!(watch.watch(at(60), true, &along(0.0)), Some(Cause::TieDown));
        assert_eq!(watch.watch(at(61), true, &along(0.0)), Some(Cause::TieDown), "still");
        assert_eq!(watch.watch(at(62), false, &along(0.0)), None, "released");
    }

    #[test]
    fn hand_that_moves_now_and_then_does_not_stop() {
        let mut watch = AntiTieDown::default();
        for second in 0..600 {
            let place = if second % 50 == 0 { 2e-3 } else { 0.0 };
            assert_eq!(watch.watch(at(second), true, &along(place)), None);
        }
    }

    #[test]
    fn grip_pose_of_nan_counts_as_motion() {
        let mut watch = AntiTieDown::default();
        for second in 0..100 {
            assert_eq!(watch.watch(at(second), true, &along(f64::NAN)), None);
        }
    }
}
