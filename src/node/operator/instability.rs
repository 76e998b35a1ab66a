//! A hand that is driven to and fro: swings that do not die away, or more power than a hand is given.
//!
//! Not the passivity layer, which adds damping from the first millijoule on; this stops what that cannot.
//! A swing lies between two reversals of the grip along an axis. A hand may swing as it likes: what it
//! takes from the torques, it does itself. Only when the torques have given it energy over the
//! swings they are the node's.

use std::time::Duration;

use crate::cause::Cause;
use units::spatial::Twist;
use units::time::Instant;

/// Slower swings are none, in m/s.
const FAST: f64 = 0.1;

/// A swing has begun when it is faster than this, in m/s: about zero an encoder's steps go to and fro.
const BEGUN: f64 = 0.02;

/// So many reversals within [`WITHIN`].
const REVERSALS: usize = 4;

/// See [`REVERSALS`].
const WITHIN: Duration = Duration::from_millis(400);

/// A swing of less than this of the one before it dies away.
const KEEPS: f64 = 0.95;

/// A turn of 1 rad/s is as fast as this many m/s: the grip's size, in m.
const LEVER: f64 = 0.1;

/// More power than that is never given to a hand on purpose, in W.
const POWER: f64 = 20.0;

/// For so long it may be: samples of an encoder are coarse.
const POWER_FOR: Duration = Duration::from_millis(10);

/// Work the torques did on the arm, and how the grip swings along its six axes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Instability {
    axes: [Swings; 6],
    work: f64,
    strong_since: Option<Instant>,
}

/// The swings along one axis.
#[derive(Clone, Copy, Debug, Default)]
struct Swings {
    /// The fastest of the swing that goes on, with its direction.
    peak: f64,
    /// The fastest of the one before.
    peak_before: f64,
    /// When its last reversals were, and the work that had been done by then; the newest last.
    reversals: [Option<(Instant, f64)>; REVERSALS],
}

impl Instability {
    /// Takes the grip's twist and the work in J that the felt torques did since the last call `dt` ago.
    pub(super) fn watch(
        &mut self,
        now: Instant,
        dt: Duration,
        v_g: &Twist,
        work: f64,
    ) -> Option<Cause> {
        if !work.is_finite() {
            return None; // The controller's own fault, and its cause.
        }
        self.work += work;
        let is_strong = work > POWER * dt.as_secs_f64();
        self.strong_since = if is_strong { self.strong_since.or(Some(now)) } else { None };
        let is_strong = self.strong_since.is_some_and(|since| now.since(since) >= POWER_FOR);
        let speeds = v_g.scaled(&[1.0, 1.0, 1.0, LEVER, LEVER, LEVER]).components();
        let mut swings = false;
        for (axis, speed) in self.axes.iter_mut().zip(speeds) {
            swings |= axis.keep_on(now, speed, self.work);
        }
        (is_strong || swings).then_some(Cause::Unstable)
    }

    /// Nothing is felt: what comes later is something else.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}

impl Swings {
    /// Whether the axis has swung to and fro often enough, with energy from the node.
    fn keep_on(&mut self, now: Instant, speed: f64, work: f64) -> bool {
        let reverses = speed * self.peak < 0.0 && speed.abs() > BEGUN;
        if reverses {
            let fades = self.peak.abs() < FAST || self.peak.abs() < KEEPS * self.peak_before;
            if fades {
                self.reversals = [None; REVERSALS];
            } else {
                self.reversals.rotate_left(1);
                if let Some(newest) = self.reversals.last_mut() {
                    *newest = Some((now, work));
                }
            }
            (self.peak_before, self.peak) = (self.peak.abs(), 0.0);
        }
        if speed.abs() > self.peak.abs() {
            self.peak = speed;
        }
        let [oldest, ..] = self.reversals;
        oldest.is_some_and(|(at, done)| now.since(at) <= WITHIN && work > done)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const CYCLE: Duration = Duration::from_millis(1);

    /// The cycle in which it trips, of a second of swings at `hertz` whose speed in m/s grows from `speed`
    /// by `growth` each half period, `power` W flowing into the hand.
    fn trips(axis: usize, hertz: f64, speed: f64, growth: f64, power: f64) -> Option<u64> {
        let mut instability = Instability::default();
        (0..1_000_u64).find(|ms| {
            let phase = f64::from(u32::try_from(*ms).unwrap()) * 1e-3 * hertz * 2.0;
            let mut v = [0.0; 6];
            v[axis] = speed * growth.powf(phase) * (phase * std::f64::consts::PI).sin();
            let now = Instant::from_micros(ms * 1_000);
            instability.watch(now, CYCLE, &Twist::from_components(v), power * 1e-3).is_some()
        })
    }

    proptest! {
        #[test]
        fn hazard_45_a_grip_driven_to_and_fro_trips_within_four_hundred_milliseconds(
            axis in 0..3_usize, hertz in 5.5..40.0_f64, speed in 0.15..0.5_f64, growth in 1.0..1.5_f64
        ) {
            let tripped = trips(axis, hertz, speed, growth, 0.5);
            prop_assert!(tripped.is_some_and(|ms| ms <= 400), "{tripped:?}");
            prop_assert_eq!(trips(axis, hertz, speed, growth, -0.5), None, "the hand does it");
            prop_assert_eq!(trips(axis, hertz, 0.09, 1.0, 0.5), None, "slow");
            prop_assert_eq!(trips(axis, hertz, speed, 0.9, 0.5), None, "dies away");
        }
    }

    #[test]
    fn a_wrist_that_is_turned_to_and_fro_is_seen_by_its_size() {
        assert!(trips(4, 10.0, 2.0, 1.0, 0.5).is_some());
        assert_eq!(trips(4, 10.0, 0.5, 1.0, 0.5), None);
    }

    #[test]
    fn a_hand_that_goes_to_and_fro_slowly_is_a_hand() {
        assert_eq!(trips(0, 3.0, 0.5, 1.0, 0.5), None);
    }

    #[test]
    fn hazard_45_more_than_twenty_watts_into_the_hand_trip() {
        let after = |power| trips(0, 0.1, 0.0, 1.0, power);
        assert_eq!((after(19.0), after(-50.0), after(21.0)), (None, None, Some(10)));
    }

    #[test]
    fn work_that_is_no_number_is_no_work() {
        let mut instability = Instability::default();
        let twist = Twist::from_components([f64::NAN; 6]);
        for ms in 0..100 {
            let now = Instant::from_micros(ms * 1_000);
            assert_eq!(instability.watch(now, CYCLE, &twist, f64::INFINITY), None);
        }
    }
}
