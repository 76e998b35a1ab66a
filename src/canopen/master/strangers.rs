//! Nodes that are heard and in no plan: each is told of once.
//!
//! They give themselves away by a boot-up message, a heartbeat or an emergency where the predefined
//! connection set has it (CiA 301, 7.3.5).

use canopen_rs::nmt::HEARTBEAT_COB_BASE;

use crate::frame::Channel;
use crate::frame::Frame;
use crate::plan::NodePlan;

/// Who is known on each bus: bit n stands for node n.
#[derive(Clone, Debug)]
pub(super) struct Strangers {
    known: Vec<(Channel, u128)>,
}

impl Strangers {
    /// Everybody but the nodes of `plans`, on their buses.
    pub(super) fn to(plans: &[(Channel, NodePlan)]) -> Self {
        let mut strangers = Self { known: Vec::new() };
        for (channel, plan) in plans {
            let bit = 1 << plan.node.raw();
            match strangers.known.iter_mut().find(|(bus, _)| bus == channel) {
                Some((_, known)) => *known |= bit,
                None => strangers.known.push((*channel, bit)),
            }
        }
        strangers
    }

    /// The node-id of a node that is heard for the first time and in no plan.
    pub(super) fn heard(&mut self, channel: Channel, frame: &Frame) -> Option<u8> {
        let node_id = speaker(frame)?;
        let (_, known) = self.known.iter_mut().find(|(bus, _)| *bus == channel)?;
        let bit = 1_u128 << node_id;
        let is_new = *known & bit == 0;
        *known |= bit;
        is_new.then_some(node_id)
    }
}

/// Who sends a heartbeat or an emergency, 1 to 127.
fn speaker(frame: &Frame) -> Option<u8> {
    let is_heartbeat = frame.cob_id & FUNCTION == HEARTBEAT_COB_BASE && frame.data().len() == 1;
    let is_emergency = frame.cob_id & FUNCTION == EMCY_COB_BASE && frame.data().len() == 8;
    let node_id = u8::try_from(frame.cob_id & !FUNCTION).ok()?;
    ((is_heartbeat || is_emergency) && node_id != 0).then_some(node_id)
}

/// The bits of a COB-ID that say what it is for; the others are the node-id.
const FUNCTION: u16 = 0x780;
/// Emergencies of the predefined connection set; node 0's would be SYNC.
const EMCY_COB_BASE: u16 = 0x080;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::plans::elbow;

    const BUS: Channel = Channel(1);

    #[test]
    fn each_stranger_is_told_of_once() {
        let mut strangers = Strangers::to(&[(BUS, elbow())]);
        let heard = [
            (Frame::new(0x703, [5]), None),
            (Frame::new(0x709, [5]), Some(9)),
            (Frame::new(0x709, [5]), None),
            (Frame::new(0x089, [0; 8]), None),
            (Frame::new(0x0FF, [0; 8]), Some(127)),
            (Frame::new(0x080, []), None),
            (Frame::new(0x080, [0; 8]), None),
            (Frame::new(0x700, [5]), None),
            (Frame::new(0x585, [0; 8]), None),
            (Frame::remote(0x704, 1), None),
        ];
        for (frame, stranger) in heard {
            assert_eq!(strangers.heard(BUS, &frame), stranger, "{frame}");
        }
        assert_eq!(strangers.heard(Channel(0), &Frame::new(0x704, [5])), None, "no bus of ours");
    }
}
