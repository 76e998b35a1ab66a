//! What the drives are told in a cycle: in time, or not at all.
//!
//! A torque is as old as the SYNC whose samples it was made of. The clock is read before each frame, because a
//! process may stand still between any two of them: a frame that asks for torque is dropped once its SYNC is older
//! than a period and a half, and those behind it are later still. Their drives keep the torque of the cycle before
//! until the next one, or until their RPDO timers end it. Zero torques, and words that take power away, are sent
//! however late they are.
//!
//! Between the clock and the bus an instruction remains, and nothing can be taken back that a bus has taken: how old
//! a torque may then be is bounded by the drives' RPDO timers alone.

use crate::Node;
use bus::Bus;
use canopen::drive::Goal;
use canopen::pdo::PerMille;
use remote::Remote;
use units::time::Instant;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Sends this cycle's targets and controlwords, made of the samples of the SYNC of `sync_at`, and returns which
    /// joints' targets were taken. A torque that is too late is dropped, and counts as an overrun.
    pub(super) fn send_targets(
        &mut self,
        sync_at: Instant,
        targets: &[i16; 6],
        drives_on: bool,
    ) -> [bool; 6] {
        self.set_targets(targets, drives_on);
        let mut was_sent = [true; 6];
        let mut out = std::mem::take(&mut self.out);
        self.outbox.cyclic(&mut out);
        for telegram in out.drain(..) {
            let in_time =
                if self.is_late(sync_at) { self.outbox.late(&telegram) } else { Some(telegram) };
            if in_time.is_none() {
                self.timing.dropped();
            }
            if !in_time.is_some_and(|telegram| self.send(telegram)) {
                for joint in self.outbox.pushed_by(&telegram) {
                    was_sent.iter_mut().skip(joint).take(1).for_each(|was_sent| *was_sent = false);
                }
            }
        }
        self.out = out;
        let is_late = self.is_late(sync_at);
        self.outbox.changed(is_late, &mut self.out);
        self.post();
        was_sent
    }

    /// Returns whether what was made of the samples of the SYNC of `sync_at` is too old to act on.
    pub(super) fn is_late(&self, sync_at: Instant) -> bool {
        self.timing.is_stale(sync_at, self.bus.now())
    }

    /// Puts targets and controlwords into their frames.
    fn set_targets(&mut self, targets: &[i16; 6], drives_on: bool) {
        let mode = self.safety.mode();
        for (joint, (sample, target)) in self.samples.latest().iter().zip(targets).enumerate() {
            self.outbox.exert(joint, PerMille(*target));
            let state = sample.statusword.state();
            let goal = self.power.goal(joint, state, mode, drives_on);
            // A fault is reset by an edge, so no word is replaced before it is sent, unless by "off".
            if goal == Goal::VoltageDisabled || !self.outbox.is_waiting(joint) {
                let word = self.power.controlword(joint, state, goal);
                self.outbox.lead(joint, word, goal.is_reached(state));
            }
        }
    }
}
