//! Reading of the target torque (6071h) that a drive has taken, by SDO while the node runs.
//!
//! Drives without an RPDO timer are read in turn, one request per gap that the bus load assumes, unless they send their
//! torque demand (6074h) by TPDO. A drive whose torque actual (6077h) differs, or whose last reply did, comes first.
//! `plausibility::held_target` judges the replies. Other requests precede them.

use crate::Node;
use crate::cause::Cause;
use crate::record::Mode;
use bus::Bus;
use canopen::exchange::TpdoMap;
use canopen::master::event::Event;
use canopen::master::read_back::{ReadBack, Setting};
use canopen::object::Object;
use remote::Remote;
use units::drive::PerMille;
use units::numbering::Joint;
use units::time::Instant;

/// Target torque: two bytes.
const TARGET: Setting = Setting::unknown(Object::TARGET_TORQUE, 2);

/// Order of the drives.
#[derive(Clone, Copy, Debug)]
pub(super) struct TargetReadings {
    /// Drives that send their torque demand (6074h).
    sends_demand: [bool; 6],
    /// Index of the joint whose turn is next.
    next: usize,
    /// Drives whose last reading failed.
    is_unread: [bool; 6],
}

impl TargetReadings {
    /// Returns the turn of the drives that do not send their torque demand.
    pub(super) fn new(tpdos: &TpdoMap) -> Self {
        let sends_demand = Joint::ALL.map(|joint| tpdos.has_demand(joint.into()));
        Self { sends_demand, next: 0, is_unread: [false; 6] }
    }

    /// Returns the joints without a TPDO of their torque demand: `suspects` first, the others in turn.
    fn turn(&self, suspects: [bool; 6]) -> impl Iterator<Item = Joint> + use<> {
        let sends_demand = self.sends_demand;
        let all = || Joint::ALL.into_iter().cycle().skip(self.next).take(Joint::ALL.len());
        let first = all().filter(move |joint| *joint.entry(&suspects));
        let then = all().filter(move |joint| !joint.entry(&suspects));
        first.chain(then).filter(move |joint| !joint.entry(&sends_demand))
    }
}

impl<B: Bus, R: Remote> Node<B, R> {
    /// Requests the target torque of the next drive, if an SDO request may be sent now and none waits. Stops with the
    /// drives off, whose confirmation takes all requests.
    pub(super) fn read_target(&mut self, now: Instant) {
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
    pub(super) fn on_target_read(
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
            self.note(event);
        }
        let cause = self.plausibility.on_target_read(joint, taken);
        self.keep_off_unfollowing(cause);
        cause
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::silent_bus::node;

    #[test]
    fn drives_take_turns() {
        let mut targets = node().network.targets;
        let none = [false; 6];
        let order = |targets: &TargetReadings, suspects| {
            targets.turn(suspects).map(Joint::index).collect::<Vec<_>>()
        };
        assert_eq!(order(&targets, none), [0, 1, 2, 3, 4, 5]);
        targets.next = 5;
        assert_eq!(order(&targets, none), [5, 0, 1, 2, 3, 4]);
        assert_eq!(order(&targets, [false, false, true, false, false, false])[..2], [2, 5]);
        targets.sends_demand = [true, false, true, true, false, true];
        assert_eq!(order(&targets, none), [1, 4]);
    }

    #[test]
    fn unbooted_node_reads_nothing() {
        let mut node = node();
        node.read_target(Instant::ZERO);
        assert!(!node.network.master.has_queued());
    }
}
