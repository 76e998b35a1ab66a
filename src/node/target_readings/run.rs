//! Reading of the target torques as the node runs it in each cycle.

use crate::Node;
use crate::cause::Cause;
use crate::record::Mode;
use crate::target_readings::TARGET;
use bus::Bus;
use canopen::master::event::Event;
use canopen::master::read_back::ReadBack;
use remote::Remote;
use units::drive::PerMille;
use units::numbering::Joint;
use units::time::Instant;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Requests the target torque of the next drive, if an SDO request may be sent now and none waits. Stops with the
    /// drives off, whose confirmation takes all requests.
    pub(crate) fn read_target(&mut self, now: Instant) {
        let is_on = self.proof_test.is_done() && self.safety.mode() != Mode::DrivesOff;
        if !is_on || self.network.master.has_queued() || !self.network.sdo_pacer.may_send(now) {
            return;
        }
        let has_timer = self.proof_test.has_rpdo_timer();
        let turn = self.network.targets.turn(self.plausibility.suspects());
        for joint in turn.filter(|joint| !joint.entry(&has_timer)) {
            let out = &mut self.wire.out;
            if self.network.master.read_back(now, joint.into(), TARGET, out) {
                self.network.targets.next = joint.index() + 1;
                self.plausibility.on_target_requested(joint);
                self.send_queued();
                return;
            }
        }
    }

    /// Judges the target torque that a drive replied. Logs the first of its readings that fails.
    pub(crate) fn on_target_read(
        &mut self,
        joint: Joint,
        read: ReadBack,
        event: Event,
    ) -> Option<Cause> {
        let taken = match read {
            ReadBack::Value(raw) => {
                let [low, high, ..] = raw.to_le_bytes();
                Some(PerMille(i16::from_le_bytes([low, high])))
            }
            ReadBack::Unchanged | ReadBack::Changed { .. } | ReadBack::Unread(_) => None,
        };
        let is_unread = joint.entry_mut(&mut self.network.targets.is_unread);
        if !std::mem::replace(is_unread, taken.is_none()) && taken.is_none() {
            self.log_event(event);
        }
        let cause = self.plausibility.on_target_read(joint, taken);
        self.keep_off_unfollowing(cause);
        cause
    }
}
