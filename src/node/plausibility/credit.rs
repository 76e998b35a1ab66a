//! The credit count of one joint: SYNCs sent, less answers heard.
//!
//! A position in a TPDO carries no number of its SYNC. It is taken to belong to the SYNC in whose window,
//! from there to the next SYNC, it comes. The *first* of a window is its sample; of any other it cannot be
//! told whether it is an older one that was late or a newer one behind it, and so it never replaces the
//! first. In order, the first may then be older than the newest; out of order, it is the newest. Either way
//! the sample does not go back in time within a window, and none is late by as many cycles as a joint may
//! miss, because so many empty windows stop the node.
//!
//! Each empty window is owed an answer, and a frame behind the first fills that credit. If nothing is owed it
//! is one too many. All of one window count once, because answers that were held up come together when they
//! come; a second such window soon after is another node's. Credit is forgotten some time after the last empty
//! window, or losses would pay for a second node.

use std::time::Duration;

use crate::plausibility::overdue::Overdue;
use crate::plausibility::repeated::Repeated;
use units::time::Instant;

/// A second window with more answers than SYNCs within this is another node's. A single one is not: a
/// receiver that misses the last bit of a frame lets it be sent again (ISO 11898-1, 10.6).
const SOON: Duration = Duration::from_millis(100);

/// What a frame of a joint is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// The window's sample.
    First,
    /// One more, for which a window before has had none.
    Late,
    /// One more than there were SYNCs, which may be.
    Surplus,
    /// One more than there were SYNCs, again: two nodes answer.
    Duplicate,
}

/// The count.
#[derive(Clone, Copy, Debug)]
pub(super) struct Credit {
    /// Answers that windows before this one are owed.
    owed: u32,
    /// The most there can be, and by how many cycles an answer can be late.
    most: u32,
    emptied_at: Instant,
    is_answered: bool,
    crowded: Repeated,
    /// What a frame too many in this window is, once there was one.
    surplus: Option<Arrival>,
    overdue: Overdue,
}

impl Credit {
    /// Of a joint that may miss `patience` cycles in a row. Nothing was asked yet; what comes all the same
    /// is late.
    pub(super) const fn new(patience: u32) -> Self {
        let most = patience.saturating_sub(1);
        Self {
            owed: most,
            most,
            emptied_at: Instant::ZERO,
            is_answered: true,
            crowded: Repeated::new(SOON),
            surplus: None,
            overdue: Overdue::new(),
        }
    }

    /// A SYNC goes out.
    pub(super) fn begin(&mut self, now: Instant) {
        self.overdue.end_window(now, self.is_answered);
        if !self.is_answered {
            self.owed = self.most.min(self.owed + 1);
            self.emptied_at = now;
        } else if now.since(self.emptied_at) > SOON {
            self.owed = 0;
        }
        self.is_answered = false;
        self.surplus = None;
    }

    /// By how many cycles what comes may be late.
    pub(super) const fn lateness(&self) -> u32 {
        let overdue = self.overdue.count();
        if self.owed > 0 && self.most > overdue { self.most } else { overdue }
    }

    /// Returns the samples that are overdue.
    pub(super) const fn overdue(&self) -> &Overdue {
        &self.overdue
    }

    /// An answer was thrown away because it waited too long to be read.
    pub(super) const fn discard(&mut self) {
        self.overdue.make_good();
    }

    /// An answer comes in the window of the SYNC of `now`.
    pub(super) fn on_frame(&mut self, now: Instant) -> Arrival {
        if !self.is_answered {
            self.is_answered = true;
            return Arrival::First;
        }
        self.overdue.make_good();
        if self.owed > 0 {
            self.owed -= 1;
            Arrival::Late
        } else {
            *self.surplus.get_or_insert_with(|| match self.crowded.happens(now) {
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

    /// What comes of so many answers in each window, a millisecond each.
    fn arrivals(windows: &[u32]) -> Vec<Vec<Arrival>> {
        let mut credit = Credit::new(3);
        let window = |(cycle, answers): (u64, &u32)| {
            let now = Instant::from_micros(1_000 * cycle);
            credit.begin(now);
            (0..*answers).map(|_| credit.on_frame(now)).collect()
        };
        (1_000..).zip(windows).map(window).collect()
    }

    /// How many answers each window gets, if they are late by so many windows; `None` is lost.
    fn windows(late: &[Option<usize>]) -> Vec<u32> {
        let mut windows = vec![0_u32; late.len() + 2];
        for (window, late) in late.iter().enumerate() {
            if let Some(late) = late {
                windows[window + late] += 1;
            }
        }
        windows
    }

    fn has_duplicate(windows: &[u32]) -> bool {
        arrivals(windows).concat().contains(&Arrival::Duplicate)
    }

    #[test]
    fn hazard_04_a_late_frame_fills_its_credit_and_never_replaces_the_first() {
        use Arrival::First;
        use Arrival::Late;
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
    fn hazard_06_more_answers_than_syncs_in_two_windows_are_two_nodes() {
        use Arrival::Duplicate;
        use Arrival::First;
        use Arrival::Surplus;
        let twice = arrivals(&[2, 1, 2]);
        assert_eq!(twice, [vec![First, Surplus], vec![First], vec![First, Duplicate]]);
        let much_later: Vec<u32> = [2].into_iter().chain([1; 100]).chain([2]).collect();
        assert!(!has_duplicate(&much_later));
    }

    #[test]
    fn hazard_06_losses_hide_a_second_node_for_two_windows_and_not_for_long() {
        let first = |windows: &[u32]| (1..=windows.len()).find(|n| has_duplicate(&windows[..*n]));
        assert_eq!(first(&[0, 0, 1, 0, 2, 2, 2, 2, 2]), Some(8), "the fourth of them");
        let later: Vec<u32> = [0, 0].into_iter().chain([1; 101]).chain([2; 5]).collect();
        assert_eq!(first(&later), Some(105), "the second");
    }

    #[test]
    fn hazard_04_a_lateness_that_ends_is_no_second_node_however_long_it_was() {
        // In order: what was held up comes all at once.
        for late in [1, 2] {
            let all = [vec![0; late], vec![1; 300], vec![1 + u32::try_from(late).unwrap()]];
            assert!(!has_duplicate(&[all.concat(), vec![1; 5]].concat()));
        }
    }

    proptest! {
        #[test]
        fn hazard_04_one_node_late_now_and_then_is_never_taken_for_two(
            late in prop::collection::vec(prop::option::weighted(0.99, 0..3_usize), 1..90)
        ) {
            prop_assert!(!has_duplicate(&windows(&late)));
        }

        #[test]
        fn hazard_04_one_node_late_by_a_cycle_for_long_is_never_taken_for_two(
            runs in prop::collection::vec((0..2_usize, 1..150_usize), 1..20)
        ) {
            let late: Vec<_> = runs.iter().flat_map(|(late, n)| vec![Some(*late); *n]).collect();
            prop_assert!(!has_duplicate(&windows(&late)));
        }
    }
}
