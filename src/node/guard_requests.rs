//! Requests of node guarding (remote frames; CiA 301, 7.2.8.2.2.1), a few in each cycle, after its targets.
//!
//! All nodes are guarded from the same time on, so their requests become due together. Sent at once, they and their
//! answers would delay the targets of a cycle with a missing sample, and the next SYNC.

use std::collections::VecDeque;
use std::time::Duration;

use canopen::frame::{Channel, Telegram};
use canopen::plan::{ErrorControl, NodePlan};

/// Requests that are due, oldest first.
#[derive(Clone, Debug)]
pub(super) struct GuardRequests {
    due: VecDeque<Telegram>,
    /// Maximum number of requests in a cycle.
    per_cycle: usize,
}

impl GuardRequests {
    /// Returns no requests, for the guarded nodes of `plans` with a cycle every `period`.
    pub(super) fn new(plans: &[(Channel, NodePlan)], period: Duration) -> Self {
        let guard_time = |(_, plan): &(Channel, NodePlan)| match plan.error_control {
            ErrorControl::Guarding(guarding) => Some(guarding.guard_time()),
            ErrorControl::Heartbeat { .. } => None,
        };
        let guarded = plans.iter().filter_map(guard_time);
        let cycles =
            guarded.clone().min().unwrap_or(period).as_micros() / period.as_micros().max(1);
        let per_cycle = guarded.count().div_ceil(usize::try_from(cycles.max(1)).unwrap_or(1));
        Self { due: VecDeque::with_capacity(plans.len()), per_cycle }
    }

    /// Moves the remote frames out of `frames`. A request that is due already is dropped: while a stalled loop sends none,
    /// they do not accumulate.
    pub(super) fn take_from(&mut self, frames: &mut Vec<Telegram>) {
        let due = &mut self.due;
        frames.retain(|telegram| {
            let is_request = telegram.frame.is_remote();
            if is_request && !due.contains(telegram) {
                due.push_back(*telegram);
            }
            !is_request
        });
    }

    /// Returns the requests of one cycle.
    pub(super) fn of_cycle(&mut self) -> impl Iterator<Item = Telegram> + '_ {
        let count = self.per_cycle.min(self.due.len());
        self.due.drain(..count)
    }

    /// Drops all requests, because no node may be guarded any more.
    pub(super) fn clear(&mut self) {
        self.due.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::frame::Frame;
    use canopen::testing::plans::{elbow, guarded_elbow};

    const PERIOD: Duration = Duration::from_millis(2);

    fn requests() -> Vec<Telegram> {
        let frames = (1..=6).map(|node| Frame::remote(0x700 + node, 1));
        frames.map(|frame| Telegram { channel: Channel(0), frame }).collect()
    }

    #[test]
    fn burst_is_spread_over_the_guard_time() {
        // Six nodes every 10 ms, in cycles of 2 ms: two in a cycle.
        let plans: Vec<_> = (0..6).map(|_| (Channel(0), guarded_elbow())).collect();
        let mut guarding = GuardRequests::new(&plans, PERIOD);
        guarding.take_from(&mut requests());
        let cycles: Vec<_> = (0..5)
            .map(|_| guarding.of_cycle().map(|it| it.frame.cob_id).collect::<Vec<_>>())
            .collect();
        let expected: [&[u16]; 5] = [&[0x701, 0x702], &[0x703, 0x704], &[0x705, 0x706], &[], &[]];
        assert_eq!(cycles, expected);
    }

    #[test]
    fn requests_that_are_not_sent_do_not_accumulate() {
        let plans: Vec<_> = (0..6).map(|_| (Channel(0), guarded_elbow())).collect();
        let mut guarding = GuardRequests::new(&plans, PERIOD);
        (0..100).for_each(|_| guarding.take_from(&mut requests()));
        assert_eq!(guarding.due.len(), 6);
    }

    #[test]
    fn other_frames_stay() {
        let mut guarding = GuardRequests::new(&[(Channel(0), elbow())], PERIOD);
        let other = Telegram { channel: Channel(0), frame: Frame::new(0x603, [0x40; 8]) };
        let mut frames = [requests(), vec![other]].concat();
        guarding.take_from(&mut frames);
        assert_eq!(frames, [other]);
        guarding.clear();
        assert_eq!(guarding.of_cycle().count(), 0);
    }
}
