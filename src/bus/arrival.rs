//! Receive times on the clock of the bus, from the kernel's wall-clock stamps.
//!
//! The wall clock may step while frames wait in a socket. A stamp is converted with the clocks before and after such a
//! step. A valid result is after the time at which the socket was last empty, and not in the future. Without a valid
//! result the frame counts as old as possible, so that a stale frame never counts as fresh.

use crate::clock::Reading;

/// Tolerance between readings of the two clocks in ns: their drift, and the time between the two readings.
const SLACK: u64 = 100_000;

/// Bounds of the receive time of a frame that waits in a socket.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrivals {
    /// Clocks when the socket was last empty. Waiting frames were received later.
    empty: Reading,
}

impl Arrivals {
    /// Starts with a socket opened now.
    pub(super) const fn since(empty: Reading) -> Self {
        Self { empty }
    }

    /// Records that the socket was empty at `at` or later.
    pub(super) fn found_empty(&mut self, at: Reading) {
        self.empty = at;
    }

    /// Returns whether a clock was set since the socket was last empty.
    pub(super) fn are_before_a_step(&self, now: Reading) -> bool {
        !self.empty.agrees(now)
    }

    /// Returns the receive time since boot, in ns, of a frame read `now` with this stamp.
    pub(super) fn time_of(&self, stamp: Option<u64>, now: Reading) -> u64 {
        let (earliest, latest) = (self.empty.boot, now.boot);
        let Some(stamp) = stamp else { return earliest };
        let candidates = [self.empty, now].map(|clocks| clocks.boot_of(stamp));
        let is_possible = |at: &u64| *at + SLACK >= earliest && *at <= latest + SLACK;
        let arrived = candidates.into_iter().flatten().filter(is_possible).min();
        arrived.map_or(earliest, |at| at.clamp(earliest, latest))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use std::time::Duration;

    use super::*;

    /// Returns the clocks at `micros`, with the wall clock `ahead`.
    fn clocks(micros: u64, ahead: Duration) -> Reading {
        let boot = 1_000 * micros;
        Reading { boot, wall: boot + u64::try_from(ahead.as_nanos()).unwrap() }
    }

    const BEFORE: Duration = Duration::from_secs(1_800_000_000);

    #[test]
    fn hazard_31_clock_step_keeps_the_age_of_waiting_frames() {
        let hour = Duration::from_secs(3_600);
        let step = Duration::from_millis(300);
        for after in [BEFORE, BEFORE + hour, BEFORE - hour, BEFORE + step, BEFORE - step] {
            let arrivals = Arrivals::since(clocks(1_000, BEFORE));
            let now = clocks(8_000, after);
            for (arrived, ahead) in [(2_500, BEFORE), (7_500, after)] {
                let stamp = clocks(arrived, ahead).wall;
                let found = arrivals.time_of(Some(stamp), now);
                assert_eq!(found, 1_000 * arrived, "{after:?}");
            }
        }
    }

    #[test]
    fn impossible_stamp_gives_the_oldest_time() {
        let arrivals = Arrivals::since(clocks(1_000, BEFORE));
        let now = clocks(8_000, BEFORE);
        for stamp in [None, Some(0), Some(now.wall * 2), Some(clocks(0, BEFORE).wall)] {
            assert_eq!(arrivals.time_of(stamp, now), 1_000_000, "{stamp:?}");
        }
    }

    #[test]
    fn empty_socket_moves_the_lower_bound() {
        let mut arrivals = Arrivals::since(clocks(1_000, BEFORE));
        let after = BEFORE + Duration::from_secs(60);
        arrivals.found_empty(clocks(5_000, after));
        let stamp = clocks(6_000, after).wall;
        assert_eq!(arrivals.time_of(Some(stamp), clocks(8_000, after)), 6_000_000);
    }

    proptest! {
        #[test]
        fn frame_never_appears_younger_than_it_is(
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
            let found = arrivals.time_of(Some(stamp), clocks(arrived + waited, after));
            prop_assert!(found <= 1_000 * arrived + SLACK);
        }
    }
}
