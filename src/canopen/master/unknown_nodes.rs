//! Nodes that send on a bus but are in no plan. Each is reported once.
//!
//! Detected by a boot-up message, a heartbeat or an emergency at its COB-ID of the predefined connection set
//! (CiA 301, 7.3.5).

use canopen_rs::nmt::HEARTBEAT_COB_BASE;

use crate::frame::{Channel, FUNCTION_CODE, Frame};
use crate::plan::NodePlan;

/// Known nodes on each bus; bit n is set for node-id n.
#[derive(Clone, Debug)]
pub(super) struct UnknownNodes {
    known: Vec<(Channel, u128)>,
}

impl UnknownNodes {
    /// Knows the nodes of `plans`, on their buses.
    pub(super) fn except(plans: &[(Channel, NodePlan)]) -> Self {
        let mut unknown_nodes = Self { known: Vec::new() };
        for (channel, plan) in plans {
            let bit = 1 << plan.node.raw();
            match unknown_nodes.known.iter_mut().find(|(bus, _)| bus == channel) {
                Some((_, known)) => *known |= bit,
                None => unknown_nodes.known.push((*channel, bit)),
            }
        }
        unknown_nodes
    }

    /// Returns the node-id of a node that sends for the first time and is in no plan.
    pub(super) fn on_frame(&mut self, channel: Channel, frame: &Frame) -> Option<u8> {
        let node_id = sender(frame)?;
        let (_, known) = self.known.iter_mut().find(|(bus, _)| *bus == channel)?;
        let bit = 1_u128 << node_id;
        let is_new = *known & bit == 0;
        *known |= bit;
        is_new.then_some(node_id)
    }
}

/// Returns the node-id that sent a heartbeat or an emergency, 1 to 127.
fn sender(frame: &Frame) -> Option<u8> {
    let is_heartbeat =
        frame.cob_id & FUNCTION_CODE == HEARTBEAT_COB_BASE && frame.data().len() == 1;
    let is_emergency = frame.cob_id & FUNCTION_CODE == EMCY_COB_BASE && frame.data().len() == 8;
    let node_id = u8::try_from(frame.cob_id & !FUNCTION_CODE).ok()?;
    ((is_heartbeat || is_emergency) && node_id != 0).then_some(node_id)
}

/// Function code of emergencies; with node-id 0 it is SYNC.
const EMCY_COB_BASE: u16 = 0x080;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::plans::elbow;

    const BUS: Channel = Channel(1);

    #[test]
    fn each_unknown_node_is_reported_once() {
        let mut unknown_nodes = UnknownNodes::except(&[(BUS, elbow())]);
        let received = [
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
        for (frame, expected) in received {
            assert_eq!(unknown_nodes.on_frame(BUS, &frame), expected, "{frame}");
        }
        assert_eq!(
            unknown_nodes.on_frame(Channel(0), &Frame::new(0x704, [5])),
            None,
            "no bus of ours"
        );
    }
}
