//! Reading of the target torque (6071h) that a drive has taken, by SDO while the node runs.
//!
//! Drives without an RPDO timer are read one after the other, unless they send their torque demand (6074h) by TPDO. The
//! interval is the SDO gap assumed for the bus load. A drive whose actual torque (6077h) or last reply differs comes first.
//! `plausibility::held_target` judges the replies. Other requests precede them.

mod run;

use canopen::exchange::TpdoMap;
use canopen::master::read_back::ObjectRead;
use canopen::object::Object;
use units::numbering::Joint;

/// Target torque: two bytes.
const TARGET: ObjectRead = ObjectRead::unknown(Object::TARGET_TORQUE, 2);

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

    /// Returns the joints without a TPDO of their torque demand: `suspects` first, then the others in rotation.
    fn turn(&self, suspects: [bool; 6]) -> impl Iterator<Item = Joint> + use<> {
        let sends_demand = self.sends_demand;
        let all = || Joint::ALL.into_iter().cycle().skip(self.next).take(Joint::ALL.len());
        let first = all().filter(move |joint| *joint.entry(&suspects));
        let then = all().filter(move |joint| !joint.entry(&suspects));
        first.chain(then).filter(move |joint| !joint.entry(&sends_demand))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::silent_bus::node;
    use units::time::Instant;

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
