//! Sending of target torques and controlwords. Late ones are not sent.
//!
//! A target is as old as the SYNC of its samples. The process may stall between any two frames, so the clock is read
//! before each. A frame with torque is dropped once its SYNC is older than 1.5 periods, and on a bus without a SYNC in
//! this cycle. Zero targets and disable voltage are sent at any age.
//!
//! The drives of a dropped frame keep the previous target until the next cycle, or until their RPDO timers expire. In a
//! frame with the targets of several drives, this includes drives whose new target is zero.
//!
//! An accepted frame cannot be recalled. The clock is therefore read again after the last one. If that was too late, zero
//! targets follow in the same cycle, and act at the next SYNC in place of the late ones.

use crate::Node;
use crate::permit::Permit;
use bus::Bus;
use canopen::frame::Telegram;
use controller::{DriveTargets, Output};
use remote::Remote;
use units::drive::PerMille;
use units::numbering::NodeIndex;
use units::time::Instant;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Limits the controller's targets and sends them; returns the targets that the drives now hold. After a cause of this
    /// cycle the torques are zero in this cycle; controlwords follow the permit of the next one.
    pub(super) fn command_drives(
        &mut self,
        sync_at: Instant,
        permit: &Permit,
        output: &Output,
    ) -> [PerMille; 6] {
        let mut targets = output.targets;
        if let Some((joint, target)) = self.trials.target() {
            *joint.entry_mut(&mut targets) = target;
        }
        let limiter = &mut self.drives.limiter;
        let targets = limiter.limit(self.safety.allows_torque(), &output.tau, &targets);
        let was_sent = self.send_targets(sync_at, &targets, permit.drives_on);
        let targets = self.drives.limiter.revert_unsent(was_sent);
        let held = match self.drives.limiter.is_withdrawn() {
            true => DriveTargets::Withdrawn,
            false => DriveTargets::Sent(targets),
        };
        self.control.set_held(held);
        self.plausibility.on_sent(&targets.map(|PerMille(target)| target));
        targets
    }

    /// Sends targets and controlwords computed from the samples of the SYNC sent at `sync_at`. Returns the joints whose
    /// targets were sent. A torque that is too late is dropped, and makes the cycle a late one.
    pub(super) fn send_targets(
        &mut self,
        sync_at: Instant,
        targets: &[PerMille; 6],
        drives_on: bool,
    ) -> [bool; 6] {
        self.drives.set(self.samples.latest(), targets, self.safety.mode(), drives_on);
        let mut was_sent = [true; 6];
        let mut out = std::mem::take(&mut self.wire.out);
        self.drives.rpdos.append_synchronous(&mut out);
        for telegram in out.drain(..) {
            let is_late = self.is_late(sync_at);
            let in_time = if is_late || self.wire.lacks_sync(telegram.channel, sync_at) {
                self.drives.rpdos.without_stale_torque(&telegram)
            } else {
                Some(telegram)
            };
            if in_time.is_none() {
                self.timing.lateness.on_dropped_target();
            }
            if !in_time.is_some_and(|telegram| self.send(telegram)) {
                for joint in
                    self.drives.rpdos.nodes_with_torque(&telegram).filter_map(NodeIndex::joint)
                {
                    *joint.entry_mut(&mut was_sent) = false;
                }
            }
        }
        self.wire.out = out;
        let is_late = self.is_late(sync_at);
        if is_late {
            self.withdraw_targets(was_sent);
        }
        self.drives.rpdos.append_event_driven(is_late, &mut self.wire.out);
        self.send_queued();
        was_sent
    }

    /// Replaces all target torques by zero if any was sent, because the process has stalled before the last one or since.
    fn withdraw_targets(&mut self, was_sent: [bool; 6]) {
        let mut out = std::mem::take(&mut self.wire.out);
        self.drives.rpdos.append_synchronous(&mut out);
        out.retain(|telegram| self.drives.rpdos.has_torque(telegram));
        let is_sent = |telegram: &Telegram| {
            let mut joints = self.drives.rpdos.nodes_with_torque(telegram);
            joints.any(|node| node.joint().is_some_and(|joint| *joint.entry(&was_sent)))
        };
        if !out.iter().any(is_sent) {
            out.clear();
        } else {
            self.timing.lateness.on_dropped_target();
        }
        for telegram in out.drain(..) {
            let zero = self.drives.rpdos.zeroed(&telegram);
            if zero.is_some_and(|zero| self.send(zero)) {
                let nodes = self.drives.rpdos.nodes_with_torque(&telegram);
                nodes.filter_map(NodeIndex::joint).for_each(|it| self.drives.limiter.withdraw(it));
            }
        }
        self.wire.out = out;
    }

    /// Reads the clock, and returns whether targets from the samples of the SYNC sent at `sync_at` are too old.
    fn is_late(&mut self, sync_at: Instant) -> bool {
        let now = self.wire.read_clock();
        self.timing.readings.on_target(now);
        self.timing.lateness.is_stale(sync_at, now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::silent_bus::{NoRemote, SilentBus, node};
    use controller::JointVector;

    /// Limits and sends these targets `periods` tenths of a period after their SYNC; returns the targets that the drives
    /// then hold.
    fn sent(node: &mut Node<SilentBus, NoRemote>, targets: [i16; 6], tenths: u32) -> [i16; 6] {
        let sync_at = node.bus().now;
        node.bus_mut().now = sync_at + node.timing.period / 10 * tenths;
        let limiter = &mut node.drives.limiter;
        let targets = limiter.limit(true, &JointVector::zeros(), &targets.map(PerMille));
        let was_sent = node.send_targets(sync_at, &targets, true);
        node.drives.limiter.revert_unsent(was_sent).map(|PerMille(target)| target)
    }

    #[test]
    fn zero_in_a_late_frame_of_several_drives_is_not_taken_for_sent() {
        let mut node = node();
        assert_eq!(sent(&mut node, [9, 8, -7, 6, 0, 0], 5), [9, 8, -7, 6, 0, 0]);
        // The torque of joint 1 drops the frame of joints 1 to 3; that of joints 4 to 6 is all zero, and sent.
        assert_eq!(sent(&mut node, [10, 0, 0, 0, 0, 0], 16), [9, 8, -7, 0, 0, 0]);
        let frames: Vec<_> = node.bus().sent.iter().map(|(_, it)| it.frame.to_string()).collect();
        let targets: Vec<_> = frames.iter().filter(|it| it.starts_with('2')).collect();
        assert_eq!(targets, ["201#09000800F9FF", "204#060000000000", "204#000000000000"]);
        assert_eq!(sent(&mut node, [10, 0, 0, 0, 0, 0], 5), [10, 0, 0, 0, 0, 0]);
    }
}
