//! Which of the positions that come from one joint are its samples.

use std::time::Duration;

use crate::cause::Cause;
use crate::plausibility::credit::Arrival;
use crate::plausibility::credit::Credit;
use crate::plausibility::jump::Jump;
use crate::plausibility::jump::Reach;
use crate::plausibility::jump::Step;
use units::drive::Counts;
use units::numbering::Joint;
use units::time::Instant;

/// What is to be made of a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Offer {
    /// It is the sample of this SYNC.
    Sample,
    /// It is none, and that may be: late, one too many, or farther away than the joint can be.
    Ignored,
    /// It is none, and stops the node.
    Wrong(Cause),
}

/// One joint's positions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Intake {
    joint: Joint,
    period: Duration,
    patience: u32,
    reach: Reach,
    credit: Credit,
    jump: Jump,
    asked_at: Instant,
    /// The first position of this window, believed or not.
    first: Option<Counts>,
}

impl Intake {
    /// Of a `joint` that is asked every `period` and may miss `patience` cycles in a row.
    pub(super) const fn new(joint: Joint, period: Duration, patience: u32, reach: Reach) -> Self {
        Self {
            joint,
            period,
            patience,
            reach,
            credit: Credit::new(patience),
            jump: Jump::new(reach),
            asked_at: Instant::ZERO,
            first: None,
        }
    }

    /// The network starts anew.
    pub(crate) fn restart(&mut self) {
        self.credit = Credit::new(self.patience);
        self.jump = Jump::new(self.reach);
        self.first = None;
    }

    /// A SYNC goes out at `now`.
    pub(crate) fn begin(&mut self, now: Instant) {
        self.credit.begin(now);
        self.asked_at = now;
        self.first = None;
    }

    /// A position has come that waited too long to be read: it is none.
    pub(crate) const fn discard(&mut self) {
        self.credit.discard();
    }

    /// Returns the cause to stop if too many samples are overdue.
    pub(crate) fn overdue(&self) -> Option<Cause> {
        let cycles = self.credit.overdue().excess()?;
        Some(Cause::SamplesOverdue { joint: self.joint, cycles })
    }

    /// A position has come.
    pub(crate) fn offer(&mut self, position: Counts) -> Offer {
        let late = self.period * self.credit.lateness();
        let overdue = self.credit.overdue().remembered();
        match self.credit.on_frame(self.asked_at) {
            Arrival::First => {
                self.first = Some(position);
                self.follow(position, late)
            }
            Arrival::Late | Arrival::Surplus => {
                self.jump.doubt(self.period);
                self.compare(position, overdue)
            }
            Arrival::Duplicate => self.surplus(overdue),
        }
    }

    /// The first of a window: the sample, if the joint can be there.
    fn follow(&mut self, position: Counts, late: Duration) -> Offer {
        match self.jump.take(self.asked_at, position, late) {
            Step::Possible => Offer::Sample,
            Step::Impossible => Offer::Ignored,
            Step::Jumped => Offer::Wrong(Cause::PositionJumped { joint: self.joint }),
        }
    }

    /// Another of the same window: both were sampled within the cycles that a joint may miss or that are overdue, so
    /// they cannot be farther apart than it moves in those. `overdue` is how many were before it came.
    fn compare(&self, position: Counts, overdue: u32) -> Offer {
        let span = self.period * self.patience.saturating_add(overdue);
        let is_near = self.first.is_none_or(|first| self.reach.joins(first, position, span));
        if is_near { Offer::Ignored } else { self.surplus(overdue) }
    }

    /// One too many: of a delay that ends if any were overdue, of a second node otherwise.
    fn surplus(&self, overdue: u32) -> Offer {
        let joint = self.joint;
        Offer::Wrong(match overdue {
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

    /// At most 1,000 counts in a cycle.
    fn intake() -> Intake {
        let period = Duration::from_millis(1);
        let mut intake = Intake::new(ELBOW, period, 3, Reach::new(1_000_000, period));
        intake.begin(Instant::from_micros(999_000));
        assert_eq!(intake.offer(Counts(0)), Offer::Sample);
        intake
    }

    /// What becomes of the positions of windows that follow each other.
    fn offers(windows: &[&[i32]]) -> Vec<Vec<Offer>> {
        let mut intake = intake();
        let window = |(cycle, positions): (u64, &&[i32])| {
            intake.begin(Instant::from_micros(1_000 * cycle));
            positions.iter().map(|position| intake.offer(Counts(*position))).collect()
        };
        (1_000..).zip(windows).map(window).collect()
    }

    const DUPLICATE: Offer = Offer::Wrong(Cause::Duplicate { node: NodeIndex(2) });
    const JUMPED: Offer = Offer::Wrong(Cause::PositionJumped { joint: ELBOW });

    #[test]
    fn hazard_06_two_positions_in_one_window_too_far_apart_are_two_nodes_at_once() {
        use Offer::Ignored;
        use Offer::Sample;
        assert_eq!(offers(&[&[10, 500_000]]), [[Sample, DUPLICATE]]);
        assert_eq!(offers(&[&[500_000, 10]]), [[Ignored, DUPLICATE]], "whoever comes first");
    }

    #[test]
    fn hazard_06_two_nodes_that_say_the_same_are_seen_in_the_second_window() {
        use Offer::Ignored;
        use Offer::Sample;
        assert_eq!(offers(&[&[10, 10], &[10, 10]]), [[Sample, Ignored], [Sample, DUPLICATE]]);
    }

    #[test]
    fn hazard_12_a_position_that_cannot_be_is_no_sample_and_a_second_stops_the_node() {
        use Offer::Ignored;
        use Offer::Sample;
        assert_eq!(offers(&[&[1 << 20], &[20]]), [[Ignored], [Sample]]);
        assert_eq!(offers(&[&[5_000], &[5_000]]), [[Ignored], [JUMPED]]);
    }

    #[test]
    fn hazard_04_delay_that_ends_is_not_named_a_second_node() {
        // Grown by a cycle every 50, then over: two positions a window, as a queue drains.
        let mut windows: Vec<&[i32]> = Vec::new();
        for _ in 0..5 {
            windows.push(&[]);
            windows.extend([&[10][..]; 49]);
        }
        windows.extend([&[10, 10][..]; 5]);
        let offers = offers(&windows).concat();
        assert!(!offers.contains(&DUPLICATE), "{offers:?}");
        let delayed = |cycles| Offer::Wrong(Cause::SamplesOverdue { joint: ELBOW, cycles });
        assert!((1..=5).any(|cycles| offers.contains(&delayed(cycles))), "{offers:?}");
    }

    #[test]
    fn after_a_restart_a_joint_may_be_anywhere() {
        let mut intake = intake();
        intake.restart();
        intake.begin(Instant::from_micros(1_009_000));
        assert_eq!(intake.offer(Counts(i32::MIN)), Offer::Sample);
    }

    proptest! {
        /// One node at full speed, its answers lost or late by up to two windows, in any order.
        #[test]
        fn hazard_04_a_delayed_position_is_no_jump_and_no_second_node(
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
            for offer in offers(&windows).concat() {
                prop_assert!(!matches!(offer, Offer::Wrong(_)), "{:?}", offer);
            }
        }
    }
}
