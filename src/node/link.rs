//! What of the commanded side is believed, and for how long.
//!
//! A sample is judged before the controller sees it. One that no sensor can have taken, that is from the
//! future, or that is older than what is known already has no effect at all: the last good one goes on
//! ageing. Only its own stamp tells how old it is, never when or how often it was delivered.

use std::time::Duration;

use nalgebra::Isometry3;

use crate::cause::Cause;
use remote::Sensed;
use units::spatial::Wrench;
use units::time::Instant;

/// A sample may be as old as this however fast samples come.
const LEAST: Duration = Duration::from_millis(20);

/// And never older than this, however slowly they come.
const MOST: Duration = Duration::from_millis(100);

/// Samples in a row that may be missing.
const MISSED: u32 = 3;

/// The newest good sample of the commanded side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link {
    /// How old it may become.
    patience: Duration,
    known: Option<Sensed>,
}

impl Link {
    /// Nothing known yet, of a commanded side that is sampled every `period`.
    pub(super) fn new(period: Duration) -> Self {
        Self { patience: (period * MISSED).clamp(LEAST, MOST), known: None }
    }

    /// Takes what an exchange brought, if anything.
    pub(super) fn take(&mut self, now: Instant, brought: Option<Sensed>) {
        let Some(sensed) = brought else { return };
        let is_newest = self.known.is_none_or(|known| known.at <= sensed.at);
        if is_newest && sensed.at <= now && sensed.is_possible() {
            self.known = Some(sensed);
        }
    }

    /// The cause to stop for, if there is nothing new enough to be felt.
    pub(super) fn lost(&self, now: Instant) -> Option<Cause> {
        let is_fresh = self.known.is_some_and(|known| now.since(known.at) <= self.patience);
        (!is_fresh).then_some(Cause::LinkLost)
    }

    /// The wrench of the environment on the object at {S}; none while nothing is known.
    pub(super) fn f_s(&self) -> Wrench {
        self.known.map_or(Wrench::ZERO, |known| known.f_s)
    }

    /// The object's pose in its base; the base itself while nothing is known.
    pub(super) fn x_b_m(&self) -> Isometry3<f64> {
        self.known.map_or_else(Isometry3::identity, |known| known.x_b_m)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Quaternion;
    use nalgebra::Unit;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    const PERIOD: Duration = Duration::from_millis(1);

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    fn sensed(at: Instant, force: f64) -> Sensed {
        let f_s = Wrench { force: Vector3::new(force, 0.0, 0.0), ..Wrench::ZERO };
        Sensed { at, f_s, x_b_m: Isometry3::translation(force, 0.0, 0.0) }
    }

    /// Anything but a number that a sensor can read.
    fn wild() -> impl Strategy<Value = f64> {
        prop_oneof![
            Just(f64::NAN),
            Just(f64::INFINITY),
            Just(f64::NEG_INFINITY),
            (1.1e5..f64::MAX),
            (f64::MIN..-1.1e5),
        ]
    }

    proptest! {
        #[test]
        fn hazard_33_what_no_sensor_can_have_taken_has_exactly_no_effect(
            part in 0..10_usize, wild in wild(), after in 0..20_000_u64,
        ) {
            let good = sensed(at(5_000), 3.0);
            let mut bad = Sensed { at: at(5_000 + after), ..good };
            let mut quaternion = *bad.x_b_m.rotation.quaternion();
            match part {
                0..3 => bad.f_s.force[part] = wild,
                3..6 => bad.f_s.moment[part - 3] = wild,
                6..9 => bad.x_b_m.translation.vector[part - 6] = wild,
                _ => quaternion = Quaternion::new(wild, 0.0, 0.0, 0.0),
            }
            bad.x_b_m.rotation = Unit::new_unchecked(quaternion);
            let now = at(5_000 + after);
            let mut link = Link::new(PERIOD);
            link.take(at(5_000), Some(good));
            link.take(now, Some(bad));
            prop_assert_eq!((link.f_s(), link.x_b_m()), (good.f_s, good.x_b_m));
            prop_assert_eq!(link.lost(at(25_001)), Some(Cause::LinkLost), "the good one ages on");
        }

        #[test]
        fn property_13_what_is_stale_stays_stale_until_a_newer_sample_comes(
            stamp in 0..1_000_000_u64, period in 250..100_000_u64,
            age in 0..300_000_u64, later in 0..300_000_u64,
        ) {
            let mut link = Link::new(Duration::from_micros(period));
            link.take(at(stamp), Some(sensed(at(stamp), 1.0)));
            let lost = |age: u64| link.lost(at(stamp + age)).is_some();
            prop_assert!(!lost(age) || lost(age + later));
            prop_assert_eq!(lost(age), age > (3 * period).clamp(20_000, 100_000));
        }

        #[test]
        fn hazard_36_whatever_the_order_the_newest_sample_is_known(
            stamps in prop::collection::vec(0..1_000_u64, 1..30),
        ) {
            let mut link = Link::new(PERIOD);
            let now = at(1_000);
            for stamp in &stamps {
                link.take(now, Some(sensed(at(*stamp), Duration::from_micros(*stamp).as_secs_f64())));
            }
            let newest = stamps.iter().max().unwrap();
            let force = Duration::from_micros(*newest).as_secs_f64();
            prop_assert_eq!(link.f_s(), sensed(at(*newest), force).f_s);
        }
    }

    #[test]
    fn before_the_first_sample_nothing_is_felt_and_the_link_is_down() {
        let mut link = Link::new(PERIOD);
        link.take(at(0), None);
        assert_eq!((link.f_s(), link.lost(at(0))), (Wrench::ZERO, Some(Cause::LinkLost)));
    }

    #[test]
    fn fault_that_the_controller_finds_stops_the_node() {
        let mut node = crate::silent::node();
        // What no sample may bring: as if this watch had failed.
        node.remote.link.known = Some(sensed(node.bus().now, f64::NAN));
        let record = node.cycle();
        let kind = record.cause.map(|cause| cause.kind());
        assert_eq!(kind, Some(crate::cause::Kind::ControllerFault));
        assert!(record.mode.is_stopped(), "{}", record.mode);
    }

    #[test]
    fn a_sample_from_the_future_would_never_age_and_is_not_taken() {
        let mut link = Link::new(PERIOD);
        link.take(at(10), Some(sensed(at(11), 1.0)));
        assert_eq!(link.f_s(), Wrench::ZERO);
    }

    #[test]
    fn hazard_35_the_same_sample_delivered_again_and_again_becomes_old() {
        let mut link = Link::new(PERIOD);
        let frozen = sensed(at(1_000), 1.0);
        let lost_at = (1..).map(|cycle| at(cycle * 1_000)).find(|now| {
            link.take(*now, Some(frozen));
            link.lost(*now).is_some()
        });
        assert_eq!(lost_at, Some(at(22_000)), "the first cycle after 20 ms");
    }
}
