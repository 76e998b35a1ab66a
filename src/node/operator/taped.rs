//! A deadman that somebody has taped, or a hand that has fallen asleep on it: it is held for long, and
//! nothing moves. Who holds a grip always moves it a little.

use std::time::Duration;

use nalgebra::Isometry3;

use crate::cause::Cause;
use units::time::Instant;

/// Nobody holds a grip so still for so long.
const STILL_FOR: Duration = Duration::from_secs(60);

/// Less is no motion of the grip, in m.
const STILL: f64 = 1e-3;

/// Less is no turn of the grip, in rad.
const UNTURNED: f64 = 10e-3;

/// Where the grip was when it last moved, and when.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Taped {
    rest: Option<(Instant, Isometry3<f64>)>,
}

impl Taped {
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
        (now.since(since) >= STILL_FOR).then_some(Cause::DeadmanTaped)
    }
}

/// Whether the grip has not moved. A pose that is none has.
fn is_near(one: &Isometry3<f64>, other: &Isometry3<f64>) -> bool {
    let away = (one.translation.vector - other.translation.vector).norm();
    away < STILL && one.rotation.angle_to(&other.rotation) < UNTURNED
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
    fn hazard_39_a_deadman_held_for_a_minute_over_a_grip_that_stands_still_is_taped() {
        let mut taped = Taped::default();
        for second in 0..60 {
            assert_eq!(taped.watch(at(second), true, &along(0.5e-3)), None);
        }
        assert_eq!(taped.watch(at(60), true, &along(0.0)), Some(Cause::DeadmanTaped));
        assert_eq!(taped.watch(at(61), true, &along(0.0)), Some(Cause::DeadmanTaped), "still");
        assert_eq!(taped.watch(at(62), false, &along(0.0)), None, "released");
    }

    #[test]
    fn a_hand_that_moves_now_and_then_tapes_nothing() {
        let mut taped = Taped::default();
        for second in 0..600 {
            let place = if second % 50 == 0 { 2e-3 } else { 0.0 };
            assert_eq!(taped.watch(at(second), true, &along(place)), None);
        }
    }

    #[test]
    fn a_grip_that_is_nowhere_stands_still_nowhere() {
        let mut taped = Taped::default();
        for second in 0..100 {
            assert_eq!(taped.watch(at(second), true, &along(f64::NAN)), None);
        }
    }
}
