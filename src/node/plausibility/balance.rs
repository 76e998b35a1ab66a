//! SYNC–response balance of one joint: SYNCs sent, less responses received.
//!
//! A TPDO carries no SYNC number. Its position counts as a response to the SYNC in whose window, up to the next SYNC, it
//! is received. The *first* of a window is its sample. Another one may be older (delayed) or newer, so it never replaces
//! the first. The maximum number of missed cycles bounds the age of a sample, because as many empty windows stop the node.
//!
//! Each empty window adds an outstanding response, and each further response of a window settles one. If none is
//! outstanding, the response is surplus. Surplus responses of one window count once: delayed responses arrive together.
//! A second such window soon after comes from a second node. Outstanding responses expire soon after the last empty
//! window; otherwise losses would hide a second node.

use std::time::Duration;

use crate::plausibility::overdue::Overdue;
use crate::plausibility::repeat_detector::RepeatDetector;
use units::time::Instant;

/// Time within which a second window with a surplus response proves a second node. A single one does not: a receiver
/// that misses the last bit of a frame causes its retransmission (ISO 11898-1, 10.6).
const SURPLUS_WINDOW: Duration = Duration::from_millis(100);

/// Time after the last empty window in which outstanding responses expire.
const OUTSTANDING_LIFETIME: Duration = SURPLUS_WINDOW;

/// Role of a response within its SYNC window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// Sample of the window.
    First,
    /// Settles the empty window of an earlier SYNC.
    Late,
    /// One more response than SYNCs: tolerated.
    Surplus,
    /// More responses than SYNCs again: two nodes respond.
    Duplicate,
}

/// Balance of one joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct ResponseBalance {
    /// Outstanding responses of earlier windows.
    outstanding: u32,
    /// Maximum outstanding responses, and maximum delay of a response in cycles.
    max_outstanding: u32,
    /// End of the last empty window.
    last_empty_at: Instant,
    has_response: bool,
    surplus_windows: RepeatDetector,
    /// Role of surplus responses of this window, from the first on.
    surplus: Option<Arrival>,
    overdue: Overdue,
}

impl ResponseBalance {
    /// Returns the balance before the first SYNC, when every response counts as late. `max_missed` consecutive cycles
    /// without a sample stop the node.
    pub(super) const fn new(max_missed: u32) -> Self {
        let max_outstanding = max_missed.saturating_sub(1);
        Self {
            outstanding: max_outstanding,
            max_outstanding,
            last_empty_at: Instant::ZERO,
            has_response: true,
            surplus_windows: RepeatDetector::new(SURPLUS_WINDOW),
            surplus: None,
            overdue: Overdue::new(),
        }
    }

    /// Ends the SYNC window and starts the next one at `now`.
    pub(super) fn start_window(&mut self, now: Instant) {
        self.overdue.end_window(now, self.has_response);
        if !self.has_response {
            self.outstanding = self.max_outstanding.min(self.outstanding + 1);
            self.last_empty_at = now;
        } else if now.since(self.last_empty_at) > OUTSTANDING_LIFETIME {
            self.outstanding = 0;
        }
        self.has_response = false;
        self.surplus = None;
    }

    /// Returns the maximum delay of the next response, in cycles.
    pub(super) const fn max_delay(&self) -> u32 {
        let overdue = self.overdue.count();
        if self.outstanding > 0 && self.max_outstanding > overdue {
            self.max_outstanding
        } else {
            overdue
        }
    }

    /// Returns the overdue samples.
    pub(super) const fn overdue(&self) -> &Overdue {
        &self.overdue
    }

    /// Counts a stale response that was discarded unread: late, not lost.
    pub(super) const fn discard(&mut self) {
        self.overdue.on_further_response();
    }

    /// Takes a response to the SYNC sent at `now`.
    pub(super) fn on_frame(&mut self, now: Instant) -> Arrival {
        if !self.has_response {
            self.has_response = true;
            return Arrival::First;
        }
        self.overdue.on_further_response();
        if self.outstanding > 0 {
            self.outstanding -= 1;
            Arrival::Late
        } else {
            *self.surplus.get_or_insert_with(|| match self.surplus_windows.on_event(now) {
                true => Arrival::Duplicate,
                false => Arrival::Surplus,
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Returns the roles of the responses of each window of 1 ms, of given counts.
    fn arrivals(windows: &[u32]) -> Vec<Vec<Arrival>> {
        let mut balance = ResponseBalance::new(3);
        let window = |(cycle, responses): (u64, &u32)| {
            let now = Instant::from_micros(1_000 * cycle);
            balance.start_window(now);
            (0..*responses).map(|_| balance.on_frame(now)).collect()
        };
        (1_000..).zip(windows).map(window).collect()
    }

    /// Returns the responses of each window. `late` is the delay of each in windows.
    fn windows(late: &[usize]) -> Vec<u32> {
        let mut windows = vec![0_u32; late.len() + 2];
        for (window, late) in late.iter().enumerate() {
            windows[window + late] += 1;
        }
        windows
    }

    fn has_duplicate(windows: &[u32]) -> bool {
        arrivals(windows).concat().contains(&Arrival::Duplicate)
    }

    #[test]
    fn hazard_04_late_frame_never_replaces_the_first() {
        use Arrival::{First, Late};
        let late = arrivals(&[0, 2, 1, 0, 0, 3, 1]);
        let expected = [
            vec![],
            vec![First, Late],
            vec![First],
            vec![],
            vec![],
            vec![First, Late, Late],
            vec![First],
        ];
        assert_eq!(late, expected);
    }

    #[test]
    fn hazard_06_surplus_responses_in_two_windows_are_two_nodes() {
        use Arrival::{Duplicate, First, Surplus};
        let twice = arrivals(&[2, 1, 2]);
        assert_eq!(twice, [vec![First, Surplus], vec![First], vec![First, Duplicate]]);
        let later: Vec<u32> = [2].into_iter().chain([1; 100]).chain([2]).collect();
        assert!(!has_duplicate(&later));
    }

    #[test]
    fn hazard_06_losses_hide_a_second_node_for_two_windows() {
        let first = |windows: &[u32]| (1..=windows.len()).find(|n| has_duplicate(&windows[..*n]));
        assert_eq!(first(&[0, 0, 1, 0, 2, 2, 2, 2, 2]), Some(8), "the fourth of them");
        let later: Vec<u32> = [0, 0].into_iter().chain([1; 101]).chain([2; 5]).collect();
        assert_eq!(first(&later), Some(105), "the second");
    }

    #[test]
    fn hazard_04_end_of_a_long_delay_is_no_second_node() {
        // In order: delayed responses arrive all at once.
        for late in [1, 2] {
            let all = [vec![0; late], vec![1; 300], vec![1 + u32::try_from(late).unwrap()]];
            assert!(!has_duplicate(&[all.concat(), vec![1; 5]].concat()));
        }
    }

    proptest! {
        #[test]
        fn hazard_04_node_late_by_a_cycle_for_long_is_no_second_node(
            runs in prop::collection::vec((0..2_usize, 1..150_usize), 1..20)
        ) {
            let late: Vec<_> = runs.iter().flat_map(|(late, n)| vec![*late; *n]).collect();
            prop_assert!(!has_duplicate(&windows(&late)));
        }
    }
}
