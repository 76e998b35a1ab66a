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
use crate::permit::Permit;
use bus::Bus;
use controller::Output;
use remote::Remote;
use units::drive::PerMille;
use units::numbering::NodeIndex;
use units::time::Instant;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Passes the controller's targets through the last gate and sends them; returns those that the drives now hold.
    pub(super) fn command_drives(
        &mut self,
        sync_at: Instant,
        permit: &Permit,
        output: &Output,
    ) -> [PerMille; 6] {
        let gate = &mut self.drives.gate;
        let targets = gate.pass(self.safety.may_push(), &output.tau, &output.targets);
        let was_sent = self.send_targets(sync_at, &targets, permit.drives_on);
        let targets = self.drives.gate.take_back(was_sent);
        self.plausibility.on_sent(&targets.map(|PerMille(target)| target));
        targets
    }

    /// Sends this cycle's targets and controlwords, made of the samples of the SYNC of `sync_at`, and returns which
    /// joints' targets were taken. A torque that is too late is dropped, and counts as an overrun.
    pub(super) fn send_targets(
        &mut self,
        sync_at: Instant,
        targets: &[PerMille; 6],
        drives_on: bool,
    ) -> [bool; 6] {
        self.drives.set(self.samples.latest(), targets, self.safety.mode(), drives_on);
        let mut was_sent = [true; 6];
        let mut out = std::mem::take(&mut self.wire.out);
        self.drives.rpdos.cyclic(&mut out);
        for telegram in out.drain(..) {
            let in_time = if self.is_late(sync_at) {
                self.drives.rpdos.late(&telegram)
            } else {
                Some(telegram)
            };
            if in_time.is_none() {
                self.timing.lateness.dropped();
            }
            if !in_time.is_some_and(|telegram| self.send(telegram)) {
                for joint in self.drives.rpdos.pushed_by(&telegram).filter_map(NodeIndex::joint) {
                    *joint.entry_mut(&mut was_sent) = false;
                }
            }
        }
        self.wire.out = out;
        let is_late = self.is_late(sync_at);
        self.drives.rpdos.changed(is_late, &mut self.wire.out);
        self.post();
        was_sent
    }

    /// Returns whether what was made of the samples of the SYNC of `sync_at` is too old to act on.
    pub(super) fn is_late(&self, sync_at: Instant) -> bool {
        self.timing.lateness.is_stale(sync_at, self.wire.now())
    }
}
