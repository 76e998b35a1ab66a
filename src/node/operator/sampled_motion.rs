//! Motion of the grip between cycles with a sample of every joint.
//!
//! Without the sample of one joint, the pose of the grip mixes positions of two times. The speed of that cycle is wrong by
//! the share of that joint, and the speed of the next cycle by the opposite amount. Their mean is the speed of the grip.

use std::time::Duration;

use units::spatial::Twist;

/// Motion of the grip within a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Motion {
    /// Time since the last motion.
    pub(super) dt: Duration,
    /// Displacement of the grip, in {G}, in m and rad.
    displacement: Twist,
    /// Work of the torques that act on the hand, in J.
    pub(super) work: f64,
}

impl Motion {
    /// Returns the motion of `dt` with this twist of the grip in {G}, and this work in J.
    pub(super) fn new(dt: Duration, v_g: &Twist, work: f64) -> Self {
        Self { dt, displacement: *v_g * dt.as_secs_f64(), work }
    }

    /// Returns the mean twist of the grip, in {G}. NaN if no time has passed.
    pub(super) fn v_g(&self) -> Twist {
        self.displacement * self.dt.as_secs_f64().recip()
    }

    /// Returns this motion followed by `next`.
    fn then(&self, next: &Self) -> Self {
        Self {
            dt: self.dt + next.dt,
            displacement: self.displacement + next.displacement,
            work: self.work + next.work,
        }
    }
}

/// Motion since the last cycle with a sample of every joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SampledMotion {
    /// `None` before the first such cycle.
    since_complete: Option<Motion>,
}

impl SampledMotion {
    /// Adds the motion of a cycle. With a sample of every joint (`is_complete`), returns the motion since the last cycle
    /// that had one.
    pub(super) fn add(&mut self, motion: &Motion, is_complete: bool) -> Option<Motion> {
        let so_far = self.since_complete.map(|so_far| so_far.then(motion));
        if is_complete {
            self.restart(true);
            so_far
        } else {
            self.since_complete = so_far;
            None
        }
    }

    /// Drops all motion before a cycle.
    pub(super) fn restart(&mut self, is_complete: bool) {
        self.since_complete = is_complete.then(Motion::default);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const CYCLE: Duration = Duration::from_millis(2);

    fn along(speed: f64) -> Motion {
        Motion::new(CYCLE, &Twist::from_components([0.0, speed, 0.0, 0.0, 0.0, 0.0]), speed)
    }

    /// Returns length in cycles, speed and work of each motion. A cycle is its speed in m/s, and whether it is complete.
    fn motions(cycles: &[(f64, bool)]) -> Vec<(f64, f64, f64)> {
        let mut sampled = SampledMotion::default();
        sampled.restart(true);
        let add = |(speed, is_complete): &(f64, bool)| sampled.add(&along(*speed), *is_complete);
        let motions = cycles.iter().filter_map(add);
        let cycles = |dt: Duration| dt.as_secs_f64() / CYCLE.as_secs_f64();
        motions.map(|motion| (cycles(motion.dt), motion.v_g().linear.y, motion.work)).collect()
    }

    #[test]
    fn lost_sample_joins_two_cycles() {
        let found = motions(&[(0.01, true), (-0.283, false), (0.295, true), (0.012, true)]);
        let expected = [(1.0, 0.01, 0.01), (2.0, 0.006, 0.012), (1.0, 0.012, 0.012)];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found.0 - expected.0).abs() < 1e-9, "{found:?}");
            assert!((found.1 - expected.1).abs() < 1e-9, "{found:?}");
            assert!((found.2 - expected.2).abs() < 1e-9, "{found:?}");
        }
        assert_eq!(found.len(), 3);
    }

    #[test]
    fn motion_starts_at_a_complete_cycle() {
        let mut sampled = SampledMotion::default();
        let mut add = |is_complete| sampled.add(&along(0.1), is_complete).is_some();
        assert_eq!([add(false), add(true), add(true), add(false)], [false, false, true, false]);
        sampled.restart(false);
        let mut add = |is_complete| sampled.add(&along(0.1), is_complete).is_some();
        assert_eq!([add(true), add(true)], [false, true]);
    }

    proptest! {
        #[test]
        fn no_motion_or_work_is_lost(
            cycles in prop::collection::vec((-1.0..1.0_f64, any::<bool>()), 1..99)
        ) {
            let mut all = cycles.clone();
            all.push((0.5, true));
            let found = motions(&all);
            let expected: f64 = all.iter().map(|(speed, _)| speed).sum();
            let displacement: f64 = found.iter().map(|(cycles, speed, _)| cycles * speed).sum();
            let work: f64 = found.iter().map(|(.., work)| work).sum();
            prop_assert!((displacement - expected).abs() < 1e-9);
            prop_assert!((work - expected).abs() < 1e-9);
        }
    }
}
