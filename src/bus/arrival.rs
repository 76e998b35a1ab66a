//! When a frame arrived, in time that no hand sets.
//!
//! The kernel stamps frames by the clock on the wall, and somebody may set that clock while frames wait to
//! be read. So a stamp is taken for the moment it would mean before such a step or after it, whichever
//! can be: not before the socket was last found empty, and not in the future. A stamp that can mean neither
//! is that of a frame as old as it can be, so that nothing old is ever taken for fresh.

use std::time::Duration;

use crate::clock::Reading;

/// Readings of two clocks agree within this: what adjusting them slowly makes of a millisecond, and what
/// passes between reading the one and the other.
const SLACK: Duration = Duration::from_micros(100);

/// What bounds the arrival of a frame that waits in a socket.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrivals {
    /// The clocks when nothing waited: whatever waits came later.
    empty: Reading,
}

impl Arrivals {
    /// Of a socket that was opened now.
    pub(super) const fn since(empty: Reading) -> Self {
        Self { empty }
    }

    /// The socket had nothing to read, now or later than `at`.
    pub(super) fn found_empty(&mut self, at: Reading) {
        self.empty = at;
    }

    /// The monotonic time at which a frame of this stamp arrived that is read `now`.
    pub(super) fn of(&self, stamp: Option<Duration>, now: Reading) -> Duration {
        let (earliest, latest) = (self.empty.monotonic, now.monotonic);
        let Some(stamp) = stamp else { return earliest };
        let meant = [self.empty, now].map(|clocks| clocks.monotonic_of(stamp));
        let can_be = |at: &Duration| *at + SLACK >= earliest && *at <= latest + SLACK;
        let arrived = meant.into_iter().flatten().filter(can_be).min();
        arrived.map_or(earliest, |at| at.clamp(earliest, latest))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The clocks at `micros`, the one on the wall ahead by `ahead`.
    fn clocks(micros: u64, ahead: Duration) -> Reading {
        let monotonic = Duration::from_micros(micros);
        Reading { monotonic, wall: monotonic + ahead }
    }

    const BEFORE: Duration = Duration::from_secs(1_800_000_000);

    #[test]
    fn hazard_31_a_frame_that_waits_while_the_clock_is_set_keeps_its_age() {
        let hour = Duration::from_secs(3_600);
        let step = Duration::from_millis(300);
        for after in [BEFORE, BEFORE + hour, BEFORE - hour, BEFORE + step, BEFORE - step] {
            let arrivals = Arrivals::since(clocks(1_000, BEFORE));
            let now = clocks(8_000, after);
            for (arrived, ahead) in [(2_500, BEFORE), (7_500, after)] {
                let stamp = clocks(arrived, ahead).wall;
                let found = arrivals.of(Some(stamp), now);
                assert_eq!(found, Duration::from_micros(arrived), "{after:?}");
            }
        }
    }

    #[test]
    fn a_stamp_that_means_nothing_is_as_old_as_can_be() {
        let arrivals = Arrivals::since(clocks(1_000, BEFORE));
        let now = clocks(8_000, BEFORE);
        for stamp in [None, Some(Duration::ZERO), Some(now.wall * 2), Some(BEFORE)] {
            assert_eq!(arrivals.of(stamp, now), Duration::from_micros(1_000), "{stamp:?}");
        }
    }

    #[test]
    fn what_is_found_empty_forgets_what_was_before() {
        let mut arrivals = Arrivals::since(clocks(1_000, BEFORE));
        let after = BEFORE + Duration::from_secs(60);
        arrivals.found_empty(clocks(5_000, after));
        let stamp = clocks(6_000, after).wall;
        assert_eq!(arrivals.of(Some(stamp), clocks(8_000, after)), Duration::from_micros(6_000));
    }

    proptest! {
        #[test]
        fn a_frame_is_never_taken_for_younger_than_it_is(
            waited in 0_u64..1_000_000,
            before in 0_u64..1_000_000,
            step_micros in -20_000_000_i64..20_000_000,
            stepped_first: bool,
        ) {
            let magnitude = Duration::from_micros(step_micros.unsigned_abs());
            let after = if step_micros < 0 { BEFORE - magnitude } else { BEFORE + magnitude };
            let arrivals = Arrivals::since(clocks(500, BEFORE));
            let arrived = 500 + before;
            let stamp = clocks(arrived, if stepped_first { after } else { BEFORE }).wall;
            let found = arrivals.of(Some(stamp), clocks(arrived + waited, after));
            prop_assert!(found <= Duration::from_micros(arrived) + SLACK);
        }
    }
}
