//! Instability of the haptic loop: oscillation of the grip that does not decay, or excess power or energy into the hand.
//!
//! The passivity layer damps from the first millijoule on. This monitor stops the node if that does not suffice. A swing
//! is the motion of the grip along an axis between two reversals. Only swings over which the torques deliver energy to the
//! hand count as instability. In an oscillation that the operator drives, the torques absorb energy. A commanded side that
//! pushes the hand where it moves swings it slower than that: the energy shows it.
//!
//! Motions are between cycles with a sample of every joint ([`sampled_motion`](super::sampled_motion)). A lost sample in a
//! fast motion thus does not count as a reversal.

use std::time::Duration;

use crate::cause::Cause;
use crate::operator::sampled_motion::Motion;
use units::time::Instant;

/// Minimum peak speed of a swing that counts, in m/s.
const MIN_SWING_SPEED: f64 = 0.1;

/// Minimum speed at which the direction counts, in m/s. Encoder noise changes the sign of lower ones.
const MIN_REVERSAL_SPEED: f64 = 0.02;

/// Reversals within [`REVERSAL_WINDOW`] that are an oscillation.
const REVERSALS: usize = 4;

/// Maximum time of [`REVERSALS`] reversals.
const REVERSAL_WINDOW: Duration = Duration::from_millis(400);

/// Ratio of successive peak speeds below which an oscillation decays.
const DECAY_RATIO: f64 = 0.95;

/// Size of the grip in m: converts its angular velocity to a linear speed.
const GRIP_SIZE: f64 = 0.1;

/// Maximum power into the hand, in W.
const MAX_POWER: f64 = 20.0;

/// Time for which more power is tolerated: encoder samples are coarse.
const EXCESS_POWER_TIME: Duration = Duration::from_millis(10);

/// Maximum energy into the hand, in J: 40 N over 5 cm.
const MAX_ENERGY: f64 = 2.0;

/// Power into the hand that does not count as energy, in W. In contact and free motion the torques absorb energy.
const TOLERATED_POWER: f64 = 0.5;

/// Monitor of the grip's six axes, and of power and energy into the hand.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Instability {
    axes: [Oscillation; 6],
    /// Work of the torques since the last reset, in J.
    work: f64,
    excess_power_since: Option<Instant>,
    /// Energy into the hand beyond [`TOLERATED_POWER`], in J, at least zero: absorbed energy is no credit.
    energy: f64,
}

/// Oscillation along one axis.
#[derive(Clone, Copy, Debug, Default)]
struct Oscillation {
    /// Peak speed of the current swing, with its sign, in m/s.
    peak: f64,
    /// Magnitude of the previous swing's peak speed, in m/s.
    previous_peak: f64,
    /// Time of the last reversals, and the work until then; the newest last.
    reversals: [Option<(Instant, f64)>; REVERSALS],
}

impl Instability {
    /// Checks the motion of the grip since the last call.
    pub(super) fn check(&mut self, now: Instant, motion: &Motion) -> Option<Cause> {
        let Motion { dt, work, .. } = *motion;
        if !work.is_finite() {
            return None; // The controller reports invalid numbers itself.
        }
        self.work += work;
        let is_excess = work > MAX_POWER * dt.as_secs_f64();
        self.excess_power_since =
            if is_excess { self.excess_power_since.or(Some(now)) } else { None };
        let is_overpowered =
            self.excess_power_since.is_some_and(|since| now.since(since) >= EXCESS_POWER_TIME);
        self.energy = (self.energy + work - TOLERATED_POWER * dt.as_secs_f64()).max(0.0);
        let is_driven = self.energy > MAX_ENERGY;
        let speeds =
            motion.v_g().scaled(&[1.0, 1.0, 1.0, GRIP_SIZE, GRIP_SIZE, GRIP_SIZE]).components();
        let mut oscillates = false;
        for (axis, speed) in self.axes.iter_mut().zip(speeds) {
            oscillates |= axis.update(now, speed, self.work);
        }
        (is_overpowered || is_driven || oscillates).then_some(Cause::Unstable)
    }

    /// Clears the history while there is no reflection.
    pub(super) fn reset(&mut self) {
        *self = Self::default();
    }
}

impl Oscillation {
    /// Takes the speed of a cycle. Returns whether the axis oscillates without decay, with energy from the node.
    fn update(&mut self, now: Instant, speed: f64, work: f64) -> bool {
        let reverses = speed * self.peak < 0.0 && speed.abs() > MIN_REVERSAL_SPEED;
        if reverses {
            let decays = self.peak.abs() < MIN_SWING_SPEED
                || self.peak.abs() < DECAY_RATIO * self.previous_peak;
            if decays {
                self.reversals = [None; REVERSALS];
            } else {
                self.reversals.rotate_left(1);
                if let Some(newest) = self.reversals.last_mut() {
                    *newest = Some((now, work));
                }
            }
            (self.previous_peak, self.peak) = (self.peak.abs(), 0.0);
        }
        if speed.abs() > self.peak.abs() {
            self.peak = speed;
        }
        let [oldest, ..] = self.reversals;
        oldest.is_some_and(|(at, work_then)| now.since(at) <= REVERSAL_WINDOW && work > work_then)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use units::math;
    use units::spatial::Twist;

    const CYCLE: Duration = Duration::from_millis(1);

    /// Returns the time in ms of the trip within a second of oscillation at `hertz`. Its peak speed in m/s grows from
    /// `speed` by `growth` each half period, with `power` W into the hand.
    fn trips(axis: usize, hertz: f64, speed: f64, growth: f64, power: f64) -> Option<u64> {
        let mut instability = Instability::default();
        (0..1_000_u64).find(|ms| {
            let phase = f64::from(u32::try_from(*ms).unwrap()) * 1e-3 * hertz * 2.0;
            let mut v = [0.0; 6];
            v[axis] = speed * math::powf(growth, phase) * math::sin(phase * std::f64::consts::PI);
            let now = Instant::from_micros(ms * 1_000);
            let motion = Motion::new(CYCLE, &Twist::from_components(v), power * 1e-3);
            instability.check(now, &motion).is_some()
        })
    }

    proptest! {
        #[test]
        fn hazard_45_grip_driven_to_and_fro_trips_within_400_ms(
            axis in 0..3_usize, hertz in 5.5..40.0_f64, speed in 0.15..0.5_f64, growth in 1.0..1.5_f64
        ) {
            let tripped = trips(axis, hertz, speed, growth, 0.5);
            prop_assert!(tripped.is_some_and(|ms| ms <= 400), "{tripped:?}");
            prop_assert_eq!(trips(axis, hertz, speed, growth, -0.5), None, "energy of the hand");
            prop_assert_eq!(trips(axis, hertz, 0.09, 1.0, 0.5), None, "slow");
            prop_assert_eq!(trips(axis, hertz, speed, 0.9, 0.5), None, "decays");
        }
    }

    #[test]
    fn rotation_counts_by_the_size_of_the_grip() {
        assert!(trips(4, 10.0, 2.0, 1.0, 0.5).is_some());
        assert_eq!(trips(4, 10.0, 0.5, 1.0, 0.5), None);
    }

    #[test]
    fn slow_swings_of_a_hand_do_not_trip() {
        assert_eq!(trips(0, 3.0, 0.5, 1.0, 0.5), None);
    }

    #[test]
    fn hazard_45_more_than_20_w_into_the_hand_trip() {
        let after = |power| trips(0, 0.1, 0.0, 1.0, power);
        assert_eq!((after(19.0), after(-50.0), after(21.0)), (Some(108), None, Some(10)));
    }

    /// Returns the time in ms of the trip within 20 s of a power into the hand, in W, that alternates each 250 ms.
    fn trips_by(powers: [f64; 2]) -> Option<u64> {
        let mut instability = Instability::default();
        let twist = Twist::from_components([0.0; 6]);
        (0..20_000_u64).find(|ms| {
            let power = powers[usize::from(ms / 250 % 2 == 1)];
            let motion = Motion::new(CYCLE, &twist, power * 1e-3);
            instability.check(Instant::from_micros(ms * 1_000), &motion).is_some()
        })
    }

    #[test]
    fn hazard_45_more_than_2_j_into_the_hand_trip() {
        assert!(trips_by([2.5, 2.5]).is_some_and(|ms| (998..1_002).contains(&ms)), "2 W too many");
        assert!(trips_by([6.0, -2.0]).is_some_and(|ms| ms < 2_500), "a slow pump");
        // A tap returns what it took; free motion absorbs.
        assert_eq!(
            (trips_by([-7.0, 7.0]), trips_by([0.5, 0.5]), trips_by([-9.0, 3.0])),
            (None, None, None)
        );
    }

    #[test]
    fn infinite_work_does_not_trip() {
        let mut instability = Instability::default();
        let twist = Twist::from_components([f64::NAN; 6]);
        let motion = Motion::new(CYCLE, &twist, f64::INFINITY);
        for ms in 0..100 {
            let now = Instant::from_micros(ms * 1_000);
            assert_eq!(instability.check(now, &motion), None);
        }
    }
}
