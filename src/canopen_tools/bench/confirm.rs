//! An NMT command, and the nodes that are heard to have obeyed it.
//!
//! NMT is never answered. What confirms it is the next heartbeat in the state that was commanded, or the
//! boot-up a reset ends with; a node without a heartbeat (1017h is 0) confirms resets only.

use std::time::Duration;

use canopen_rs::NmtCommand;
use canopen_rs::NmtState;
use canopen_rs::NodeId;
use canopen_rs::nmt::decode_heartbeat;
use canopen_rs::nmt::heartbeat_cob_id;

use canopen::frame::Frame;
use canopen::nmt::Order;
use canopen::procedure::Procedure;
use units::time::Instant;

/// What was heard of one node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// Which.
    pub node: NodeId,
    /// What it said last since the command; a boot-up is [`NmtState::Initialising`].
    pub state: Option<NmtState>,
    /// Whether it was heard to obey.
    pub has_obeyed: bool,
}

/// A command under way.
#[derive(Clone, Debug)]
pub struct Confirmation {
    wanted: NmtState,
    nodes: Vec<Heard>,
    /// Whoever is heard must obey, and not only who was named.
    is_open: bool,
    sent: Instant,
    closes: Instant,
}

impl Confirmation {
    /// Gives an order and waits until all `nodes` are heard to obey, for `timeout` at most. No nodes: whoever is
    /// heard, for all of `timeout`.
    pub fn begin(
        order: Order,
        nodes: &[NodeId],
        timeout: Duration,
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Self {
        out.push(order.frame());
        Self {
            wanted: confirming(order.command),
            nodes: nodes.iter().map(|node| Heard::nothing(*node)).collect(),
            is_open: nodes.is_empty(),
            sent: now,
            closes: now + timeout,
        }
    }
}

impl Heard {
    const fn nothing(node: NodeId) -> Self {
        Self { node, state: None, has_obeyed: false }
    }
}

/// What a node says when it has obeyed.
const fn confirming(command: NmtCommand) -> NmtState {
    match command {
        NmtCommand::StartRemoteNode => NmtState::Operational,
        NmtCommand::StopRemoteNode => NmtState::Stopped,
        NmtCommand::EnterPreOperational => NmtState::PreOperational,
        NmtCommand::ResetNode | NmtCommand::ResetCommunication => NmtState::Initialising,
    }
}

impl Procedure for Confirmation {
    /// Every node that was named, or heard.
    type Outcome = Vec<Heard>;

    fn on_frame(&mut self, now: Instant, frame: &Frame, _: &mut Vec<Frame>) -> Option<Vec<Heard>> {
        let state = frame.data().try_into().ok().and_then(|data| decode_heartbeat(data).ok())?;
        let of = |node: NodeId| frame.cob_id == heartbeat_cob_id(node);
        let [_, low] = frame.cob_id.to_be_bytes();
        let speaker = NodeId::new(low & 0x7F).ok().filter(|node| of(*node))?;
        // What was on its way before the order says nothing about it.
        if now < self.sent {
            return None;
        }
        if self.is_open && !self.nodes.iter().any(|heard| heard.node == speaker) {
            self.nodes.push(Heard::nothing(speaker));
        }
        let heard = self.nodes.iter_mut().find(|heard| heard.node == speaker)?;
        heard.state = Some(state);
        heard.has_obeyed |= state == self.wanted;
        let is_done = !self.is_open && self.nodes.iter().all(|heard| heard.has_obeyed);
        is_done.then(|| std::mem::take(&mut self.nodes))
    }

    fn on_time(&mut self, now: Instant, _: &mut Vec<Frame>) -> Option<Vec<Heard>> {
        (now >= self.closes).then(|| std::mem::take(&mut self.nodes))
    }

    fn deadline(&self) -> Option<Instant> {
        Some(self.closes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMEOUT: Duration = Duration::from_millis(500);

    fn node(raw: u8) -> NodeId {
        NodeId::new(raw).unwrap()
    }

    fn begin(command: NmtCommand, nodes: &[u8]) -> (Confirmation, Vec<Frame>) {
        let nodes: Vec<NodeId> = nodes.iter().map(|raw| node(*raw)).collect();
        let mut out = Vec::new();
        let order = Order::to_all(command);
        (Confirmation::begin(order, &nodes, TIMEOUT, Instant::from_micros(9), &mut out), out)
    }

    /// What comes of heartbeats heard after the order.
    fn hear(confirmation: &mut Confirmation, beats: &[(u16, u8)]) -> Option<Vec<Heard>> {
        let now = Instant::from_micros(10);
        let mut frames = beats.iter().map(|(node, state)| Frame::new(0x700 + node, [*state]));
        frames.find_map(|frame| confirmation.on_frame(now, &frame, &mut Vec::new()))
    }

    #[test]
    fn each_command_is_confirmed_by_its_own_state() {
        for (command, state) in [
            (NmtCommand::StartRemoteNode, 0x05),
            (NmtCommand::StopRemoteNode, 0x04),
            (NmtCommand::EnterPreOperational, 0x7F),
            (NmtCommand::ResetNode, 0x00),
            (NmtCommand::ResetCommunication, 0x00),
        ] {
            for heard in [0x00, 0x04, 0x05, 0x7F] {
                let (mut confirmation, out) = begin(command, &[3]);
                assert_eq!(out, [Order::to_all(command).frame()]);
                let outcome = hear(&mut confirmation, &[(3, heard)]);
                assert_eq!(outcome.is_some(), heard == state, "{command:?} {heard:02X}h");
            }
        }
    }

    #[test]
    fn all_who_were_named_must_be_heard_and_nobody_else() {
        let (mut confirmation, _) = begin(NmtCommand::StartRemoteNode, &[3, 4]);
        assert_eq!(hear(&mut confirmation, &[(3, 5), (5, 5), (4, 0x7F)]), None);
        let heard = confirmation.on_time(Instant::from_micros(500_009), &mut Vec::new()).unwrap();
        let obeyed: Vec<_> = heard.iter().map(|heard| (heard.node, heard.has_obeyed)).collect();
        assert_eq!(obeyed, [(node(3), true), (node(4), false)]);
        assert_eq!(heard[1].state, Some(NmtState::PreOperational));
    }

    #[test]
    fn where_nobody_was_named_all_who_are_heard_count_until_the_end() {
        let (mut confirmation, _) = begin(NmtCommand::StartRemoteNode, &[]);
        assert_eq!(hear(&mut confirmation, &[(3, 5), (4, 4)]), None);
        let heard = confirmation.on_time(confirmation.closes, &mut Vec::new()).unwrap();
        assert_eq!(heard.iter().filter(|heard| heard.has_obeyed).count(), 1);
        assert_eq!(heard.len(), 2);
    }

    #[test]
    fn a_heartbeat_from_before_the_order_confirms_nothing() {
        let (mut confirmation, _) = begin(NmtCommand::StartRemoteNode, &[3]);
        let before = Instant::from_micros(8);
        let beat = Frame::new(0x703, [5]);
        assert_eq!(confirmation.on_frame(before, &beat, &mut Vec::new()), None);
        for frame in [Frame::new(0x703, []), Frame::new(0x703, [5, 5]), Frame::new(0x700, [5])] {
            assert_eq!(confirmation.on_frame(confirmation.closes, &frame, &mut Vec::new()), None);
        }
    }
}
