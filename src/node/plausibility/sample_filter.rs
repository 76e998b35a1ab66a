//! Filter of the positions received from one joint: selects the sample of each SYNC and detects a second node.

use std::time::Duration;

use crate::cause::Cause;
use crate::plausibility::balance::{Arrival, ResponseBalance};
use crate::plausibility::jump::{Jump, Step, TravelLimit};
use units::drive::Counts;
use units::numbering::Joint;
use units::time::Instant;

/// Result for one position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FilterResult {
    /// The sample of this SYNC.
    Sample,
    /// Discarded and tolerated: late, surplus, or farther away than the joint can move.
    Ignored,
    /// Discarded, and a fault.
    Fault(Cause),
}

/// Filter of one joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SampleFilter {
    joint: Joint,
    period: Duration,
    max_missed: u32,
    limit: TravelLimit,
    balance: ResponseBalance,
    jump: Jump,
    /// Time of the last SYNC.
    sync_at: Instant,
    /// First position of this window, plausible or not.
    first: Option<Counts>,
}

impl SampleFilter {
    /// Returns a filter before the first SYNC. `max_missed` consecutive cycles without a sample stop the node.
    pub(super) const fn new(
        joint: Joint,
        period: Duration,
        max_missed: u32,
        limit: TravelLimit,
    ) -> Self {
        Self {
            joint,
            period,
            max_missed,
            limit,
            balance: ResponseBalance::new(max_missed),
            jump: Jump::new(limit),
            sync_at: Instant::ZERO,
            first: None,
        }
    }

    /// Clears the history, before the network boots.
    pub(crate) fn restart(&mut self) {
        self.balance = ResponseBalance::new(self.max_missed);
        self.jump = Jump::new(self.limit);
        self.first = None;
    }

    /// Accepts any next position: the drive has set its zero.
    pub(crate) const fn accept_step(&mut self) {
        self.jump = Jump::new(self.limit);
    }

    /// Starts a SYNC window at `now`.
    pub(crate) fn start_window(&mut self, now: Instant) {
        self.balance.start_window(now);
        self.sync_at = now;
        self.first = None;
    }

    /// Counts a stale position that was discarded unread: late, not lost.
    pub(crate) const fn discard(&mut self) {
        self.balance.discard();
    }

    /// Returns the cause to stop if too many samples are overdue.
    pub(crate) fn overdue(&self) -> Option<Cause> {
        let cycles = self.balance.overdue().excess()?;
        Some(Cause::SamplesOverdue { joint: self.joint, cycles })
    }

    /// Takes a received position.
    pub(crate) fn on_position(&mut self, position: Counts) -> FilterResult {
        let max_delay = self.period * self.balance.max_delay();
        let overdue = self.balance.overdue().total();
        match self.balance.on_frame(self.sync_at) {
            Arrival::First => {
                self.first = Some(position);
                self.first(position, max_delay)
            }
            Arrival::Late | Arrival::Surplus => {
                self.jump.allow_delay(self.period);
                self.further(position, overdue)
            }
            Arrival::Duplicate => self.surplus(overdue),
        }
    }

    /// Returns the first position of a window as its sample, unless it is implausible.
    fn first(&mut self, position: Counts, max_delay: Duration) -> FilterResult {
        match self.jump.check(self.sync_at, position, max_delay) {
            Step::Plausible => FilterResult::Sample,
            Step::Implausible => FilterResult::Ignored,
            Step::Jumped => FilterResult::Fault(Cause::PositionJumped { joint: self.joint }),
        }
    }

    /// Compares a further position of a window with the first. Both were sampled within the tolerated or overdue cycles,
    /// and the travel of the joint in these bounds their distance. `overdue` excludes this position.
    fn further(&self, position: Counts, overdue: u32) -> FilterResult {
        let span = self.period * self.max_missed.saturating_add(overdue);
        let is_within = |first| self.limit.allows(first, position, span);
        if self.first.is_none_or(is_within) { FilterResult::Ignored } else { self.surplus(overdue) }
    }

    /// Returns the fault of a surplus response: end of a delay if samples are overdue, otherwise a second node.
    fn surplus(&self, overdue: u32) -> FilterResult {
        let joint = self.joint;
        FilterResult::Fault(match overdue {
            0 => Cause::Duplicate { node: joint.into() },
            cycles => Cause::SamplesOverdue { joint, cycles },
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use units::numbering::NodeIndex;

    const ELBOW: Joint = Joint::of::<3>();

    /// Returns a filter with at most 1,000 counts in a cycle, after its first sample.
    fn filter() -> SampleFilter {
        let period = Duration::from_millis(1);
        let mut filter = SampleFilter::new(ELBOW, period, 3, TravelLimit::new(1_000_000, period));
        filter.start_window(Instant::from_micros(999_000));
        assert_eq!(filter.on_position(Counts(0)), FilterResult::Sample);
        filter
    }

    /// Returns the results for the positions of consecutive windows.
    fn filtered(windows: &[&[i32]]) -> Vec<Vec<FilterResult>> {
        let mut filter = filter();
        let window = |(cycle, positions): (u64, &&[i32])| {
            filter.start_window(Instant::from_micros(1_000 * cycle));
            positions.iter().map(|position| filter.on_position(Counts(*position))).collect()
        };
        (1_000..).zip(windows).map(window).collect()
    }

    const DUPLICATE: FilterResult = FilterResult::Fault(Cause::Duplicate { node: NodeIndex(2) });
    const JUMPED: FilterResult = FilterResult::Fault(Cause::PositionJumped { joint: ELBOW });

    #[test]
    fn hazard_06_positions_too_far_apart_in_a_window_are_two_nodes() {
        use FilterResult::{Ignored, Sample};
        assert_eq!(filtered(&[&[10, 500_000]]), [[Sample, DUPLICATE]]);
        assert_eq!(filtered(&[&[500_000, 10]]), [[Ignored, DUPLICATE]], "in either order");
    }

    #[test]
    fn hazard_06_two_equal_nodes_are_detected_in_the_second_window() {
        use FilterResult::{Ignored, Sample};
        assert_eq!(filtered(&[&[10, 10], &[10, 10]]), [[Sample, Ignored], [Sample, DUPLICATE]]);
    }

    #[test]
    fn hazard_12_implausible_position_is_dropped_and_a_second_stops() {
        use FilterResult::{Ignored, Sample};
        assert_eq!(filtered(&[&[1 << 20], &[20]]), [[Ignored], [Sample]]);
        assert_eq!(filtered(&[&[5_000], &[5_000]]), [[Ignored], [JUMPED]]);
    }

    #[test]
    fn hazard_04_end_of_a_delay_is_not_reported_as_a_second_node() {
        // The delay grows by a cycle every 50, then ends: two positions a window, as a queue drains.
        let mut windows: Vec<&[i32]> = Vec::new();
        for _ in 0..5 {
            windows.push(&[]);
            windows.extend([&[10][..]; 49]);
        }
        windows.extend([&[10, 10][..]; 5]);
        let results = filtered(&windows).concat();
        assert!(!results.contains(&DUPLICATE), "{results:?}");
        let delayed = |cycles| FilterResult::Fault(Cause::SamplesOverdue { joint: ELBOW, cycles });
        assert!((1..=5).any(|cycles| results.contains(&delayed(cycles))), "{results:?}");
    }

    #[test]
    fn any_position_is_accepted_after_a_restart() {
        let mut filter = filter();
        filter.restart();
        filter.start_window(Instant::from_micros(1_009_000));
        assert_eq!(filter.on_position(Counts(i32::MIN)), FilterResult::Sample);
    }

    proptest! {
        /// One node at full speed; its responses are lost, or late by up to two windows in any order.
        #[test]
        fn hazard_04_delayed_position_is_no_jump_and_no_second_node(
            speed in -1_000..=1_000_i32,
            late in prop::collection::vec(prop::option::weighted(0.99, 0..3_usize), 1..90),
        ) {
            let mut windows = vec![Vec::new(); late.len() + 2];
            for ((window, late), cycle) in late.iter().enumerate().zip(1..) {
                if let Some(late) = late {
                    windows[window + late].push(cycle * speed);
                }
            }
            let windows: Vec<&[i32]> = windows.iter().map(Vec::as_slice).collect();
            for result in filtered(&windows).concat() {
                prop_assert!(!matches!(result, FilterResult::Fault(_)), "{:?}", result);
            }
        }
    }
}
