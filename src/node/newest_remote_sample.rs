//! Validation and age of the samples from the commanded side.
//!
//! Samples are validated before the controller uses them. A sample that is out of a sensor's range, from the future, or
//! older than the newest one is dropped, and the newest one continues to age. Of a sample whose gripper is out of range
//! only the gripper is dropped. The age counts from the time stamp of the sample, not from its reception.

use std::time::Duration;

use nalgebra::Isometry3;

use crate::cause::Cause;
use remote::{Gripper, RemoteSample};
use units::spatial::Wrench;
use units::time::Instant;

/// Newest valid sample of the commanded side.
#[derive(Clone, Copy, Debug)]
pub(super) struct NewestRemoteSample {
    /// Maximum age of a sample.
    timeout: Duration,
    sample: Option<RemoteSample>,
}

impl NewestRemoteSample {
    /// Returns the age watch before the first sample. `timeout` is the maximum age of a sample.
    pub(super) const fn new(timeout: Duration) -> Self {
        Self { timeout, sample: None }
    }

    /// Keeps the sample if it is valid and not older than the newest one.
    pub(super) fn update(&mut self, now: Instant, sensed: Option<RemoteSample>) {
        let Some(sensed) = sensed else { return };
        let is_newest = self.sample.is_none_or(|newest| newest.at <= sensed.at);
        if is_newest && sensed.at <= now && sensed.is_possible() {
            let gripper = sensed.gripper.filter(Gripper::is_possible);
            self.sample = Some(RemoteSample { gripper, ..sensed });
        }
    }

    /// Returns the newest valid sample.
    pub(super) const fn sample(&self) -> Option<&RemoteSample> {
        self.sample.as_ref()
    }

    /// Returns a cause if the newest sample is absent or too old.
    pub(super) fn lost(&self, now: Instant) -> Option<Cause> {
        let is_fresh = self.sample.is_some_and(|newest| now.since(newest.at) <= self.timeout);
        (!is_fresh).then_some(Cause::LinkLost)
    }

    /// Returns the age of the newest sample; `None` before the first.
    pub(super) fn age(&self, now: Instant) -> Option<Duration> {
        self.sample.map(|newest| now.since(newest.at))
    }

    /// Returns the wrench of the environment on the object at {S}; zero before the first sample.
    pub(super) fn f_s(&self) -> Wrench {
        self.sample.map_or(Wrench::ZERO, |newest| newest.f_s)
    }

    /// Returns the object's pose in its base; the identity before the first sample.
    pub(super) fn x_b_m(&self) -> Isometry3<f64> {
        self.sample.map_or_else(Isometry3::identity, |newest| newest.x_b_m)
    }

    /// Returns opening and force of the gripper; `None` if the newest sample has no gripper.
    pub(super) fn gripper(&self) -> Option<Gripper> {
        self.sample.and_then(|newest| newest.gripper)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Quaternion, Unit, Vector3};
    use proptest::prelude::*;

    use super::*;

    const TIMEOUT: Duration = Duration::from_millis(20);

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    fn sensed(at: Instant, force: f64) -> RemoteSample {
        let f_s = Wrench { force: Vector3::new(force, 0.0, 0.0), ..Wrench::ZERO };
        let gripper = Some(Gripper { position: 0.03, force });
        RemoteSample { at, f_s, x_b_m: Isometry3::translation(force, 0.0, 0.0), gripper }
    }

    /// Values that no sensor can read.
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
        fn hazard_33_invalid_samples_have_no_effect(
            part in 0..10_usize, wild in wild(), after in 0..20_000_u64,
        ) {
            let good = sensed(at(5_000), 3.0);
            let mut bad = RemoteSample { at: at(5_000 + after), ..good };
            let mut quaternion = *bad.x_b_m.rotation.quaternion();
            match part {
                0..3 => bad.f_s.force[part] = wild,
                3..6 => bad.f_s.moment[part - 3] = wild,
                6..9 => bad.x_b_m.translation.vector[part - 6] = wild,
                _ => quaternion = Quaternion::new(wild, 0.0, 0.0, 0.0),
            }
            bad.x_b_m.rotation = Unit::new_unchecked(quaternion);
            let now = at(5_000 + after);
            let mut newest = NewestRemoteSample::new(TIMEOUT);
            newest.update(at(5_000), Some(good));
            newest.update(now, Some(bad));
            prop_assert_eq!((newest.f_s(), newest.x_b_m()), (good.f_s, good.x_b_m));
            prop_assert_eq!(newest.lost(at(25_001)), Some(Cause::LinkLost), "the good one ages on");
        }

        #[test]
        fn property_13_stale_samples_stay_stale_until_a_newer_one(
            stamp in 0..1_000_000_u64, timeout in 5_000..100_000_u64,
            age in 0..300_000_u64, later in 0..300_000_u64,
        ) {
            let mut newest = NewestRemoteSample::new(Duration::from_micros(timeout));
            newest.update(at(stamp), Some(sensed(at(stamp), 1.0)));
            let lost = |age: u64| newest.lost(at(stamp + age)).is_some();
            prop_assert!(!lost(age) || lost(age + later));
            prop_assert_eq!(lost(age), age > timeout);
        }
    }

    #[test]
    fn gripper_out_of_range_is_dropped_alone() {
        for position in [f64::NAN, f64::INFINITY, -1.1e3] {
            let mut newest = NewestRemoteSample::new(TIMEOUT);
            let good = sensed(at(1_000), 3.0);
            let gripper = Some(Gripper { position, force: 1.0 });
            newest.update(at(1_000), Some(RemoteSample { gripper, ..good }));
            assert_eq!((newest.f_s(), newest.gripper()), (good.f_s, None), "{position}");
            newest.update(at(1_000), Some(good));
            assert_eq!(newest.gripper(), good.gripper);
        }
    }

    #[test]
    fn wrench_is_zero_and_the_link_lost_before_the_first_sample() {
        let mut newest = NewestRemoteSample::new(TIMEOUT);
        newest.update(at(0), None);
        assert_eq!((newest.f_s(), newest.lost(at(0))), (Wrench::ZERO, Some(Cause::LinkLost)));
    }

    #[test]
    fn controller_fault_stops_the_node() {
        let mut node = crate::silent_bus::node();
        // A wrench that the validation would drop.
        node.remote_side.newest.sample = Some(sensed(node.bus().now, f64::NAN));
        let record = node.cycle();
        let kind = record.cause.map(|cause| cause.kind());
        assert_eq!(kind, Some(crate::cause::CauseKind::ControllerFault));
        assert!(record.mode.is_stopped(), "{}", record.mode);
    }

    #[test]
    fn sample_from_the_future_is_dropped() {
        let mut newest = NewestRemoteSample::new(TIMEOUT);
        newest.update(at(10), Some(sensed(at(11), 1.0)));
        assert_eq!(newest.f_s(), Wrench::ZERO);
    }

    #[test]
    fn hazard_35_repeated_sample_becomes_stale() {
        let mut newest = NewestRemoteSample::new(TIMEOUT);
        let frozen = sensed(at(1_000), 1.0);
        let lost_at = (1..).map(|cycle| at(cycle * 1_000)).find(|now| {
            newest.update(*now, Some(frozen));
            newest.lost(*now).is_some()
        });
        assert_eq!(lost_at, Some(at(22_000)), "the first cycle after 20 ms");
    }
}
