//! NMT command with its confirmation by heartbeats.
//!
//! NMT has no replies. A command is confirmed by the next heartbeat in the commanded state, or by the boot-up after
//! a reset. A node without a heartbeat (1017h is 0) confirms resets only.

use std::time::Duration;

use canopen_rs::{NmtCommand, NmtState, NodeId};

use crate::diagnostics::beats::{Beat, Beats};
use crate::procedure::Procedure;
use canopen::frame::Frame;
use canopen::nmt::Order;
use units::time::Instant;

/// State and confirmation of one node after a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeResponse {
    pub node: NodeId,
    /// NMT state in its last heartbeat since the command; [`NmtState::Initialising`] for a boot-up.
    pub state: Option<NmtState>,
    /// Its last heartbeat or boot-up, also from before the command.
    pub last: Option<Beat>,
    /// Set if it has confirmed the command.
    pub is_confirmed: bool,
}

/// Command in progress.
#[derive(Clone, Debug)]
pub struct Confirmation {
    wanted: NmtState,
    nodes: Vec<NodeResponse>,
    beats: Beats,
    /// Set if every node that sends is expected to confirm, instead of named ones.
    is_open: bool,
    sent: Instant,
    closes: Instant,
}

impl Confirmation {
    /// Sends a command and waits, at most `timeout`, until all `nodes` confirm it. Without nodes it collects responses
    /// for all of `timeout`.
    pub fn start(
        order: Order,
        nodes: &[NodeId],
        timeout: Duration,
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Self {
        out.push(order.frame());
        Self {
            wanted: confirming(order.command),
            nodes: nodes.iter().map(|node| NodeResponse::new(*node)).collect(),
            beats: Beats::default(),
            is_open: nodes.is_empty(),
            sent: now,
            closes: now + timeout,
        }
    }

    /// Adds heartbeats received before the command.
    #[must_use]
    pub fn after(self, beats: Beats) -> Self {
        Self { beats, ..self }
    }

    fn outcome(&mut self) -> Vec<NodeResponse> {
        let mut nodes = std::mem::take(&mut self.nodes);
        for response in &mut nodes {
            response.last = self.beats.last(response.node);
        }
        nodes
    }
}

impl NodeResponse {
    const fn new(node: NodeId) -> Self {
        Self { node, state: None, last: None, is_confirmed: false }
    }
}

/// Returns the state in whose heartbeat a node confirms a command; [`NmtState::Initialising`] for a reset.
const fn confirming(command: NmtCommand) -> NmtState {
    match command {
        NmtCommand::StartRemoteNode => NmtState::Operational,
        NmtCommand::StopRemoteNode => NmtState::Stopped,
        NmtCommand::EnterPreOperational => NmtState::PreOperational,
        NmtCommand::ResetNode | NmtCommand::ResetCommunication => NmtState::Initialising,
    }
}

impl Procedure for Confirmation {
    /// Named nodes, or all that sent a heartbeat.
    type Outcome = Vec<NodeResponse>;

    fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        _: &mut Vec<Frame>,
    ) -> Option<Vec<NodeResponse>> {
        let Beat { node: speaker, state, .. } = self.beats.on_frame(now, frame)?;
        // A heartbeat queued before the command confirms nothing.
        if now < self.sent {
            return None;
        }
        if self.is_open && !self.nodes.iter().any(|response| response.node == speaker) {
            self.nodes.push(NodeResponse::new(speaker));
        }
        let response = self.nodes.iter_mut().find(|response| response.node == speaker)?;
        response.state = Some(state);
        response.is_confirmed |= state == self.wanted;
        let is_done = !self.is_open && self.nodes.iter().all(|response| response.is_confirmed);
        is_done.then(|| self.outcome())
    }

    fn on_time(&mut self, now: Instant, _: &mut Vec<Frame>) -> Option<Vec<NodeResponse>> {
        (now >= self.closes).then(|| self.outcome())
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

    fn start(command: NmtCommand, nodes: &[u8]) -> (Confirmation, Vec<Frame>) {
        let nodes: Vec<NodeId> = nodes.iter().map(|raw| node(*raw)).collect();
        let mut out = Vec::new();
        let order = Order::to_all(command);
        (Confirmation::start(order, &nodes, TIMEOUT, Instant::from_micros(9), &mut out), out)
    }

    /// Outcome after heartbeats received after the command.
    fn receive(confirmation: &mut Confirmation, beats: &[(u16, u8)]) -> Option<Vec<NodeResponse>> {
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
            for response in [0x00, 0x04, 0x05, 0x7F] {
                let (mut confirmation, out) = start(command, &[3]);
                assert_eq!(out, [Order::to_all(command).frame()]);
                let outcome = receive(&mut confirmation, &[(3, response)]);
                assert_eq!(outcome.is_some(), response == state, "{command:?} {response:02X}h");
            }
        }
    }

    #[test]
    fn all_named_nodes_must_confirm() {
        let (mut confirmation, _) = start(NmtCommand::StartRemoteNode, &[3, 4]);
        assert_eq!(receive(&mut confirmation, &[(3, 5), (5, 5), (4, 0x7F)]), None);
        let responses =
            confirmation.on_time(Instant::from_micros(500_009), &mut Vec::new()).unwrap();
        let confirmed: Vec<_> =
            responses.iter().map(|response| (response.node, response.is_confirmed)).collect();
        assert_eq!(confirmed, [(node(3), true), (node(4), false)]);
        assert_eq!(responses[1].state, Some(NmtState::PreOperational));
    }

    #[test]
    fn without_named_nodes_all_responses_are_collected() {
        let (mut confirmation, _) = start(NmtCommand::StartRemoteNode, &[]);
        assert_eq!(receive(&mut confirmation, &[(3, 5), (4, 4)]), None);
        let responses = confirmation.on_time(confirmation.closes, &mut Vec::new()).unwrap();
        assert_eq!(responses.iter().filter(|response| response.is_confirmed).count(), 1);
        assert_eq!(responses.len(), 2);
    }

    #[test]
    fn node_that_fell_silent_has_its_last_heartbeat() {
        let at = |ms: u64| Instant::from_micros(ms * 1_000);
        let mut before = Beats::default();
        for ms in [0, 20] {
            before.on_frame(at(ms), &Frame::new(0x703, [0x7F]));
        }
        let mut out = Vec::new();
        let order = Order::to_all(NmtCommand::ResetNode);
        let confirmation = Confirmation::start(order, &[node(3)], TIMEOUT, at(30), &mut out);
        let mut confirmation = confirmation.after(before);
        let responses = confirmation.on_time(at(530), &mut out).unwrap();
        let (state, last) = (responses[0].state, responses[0].last.unwrap());
        assert_eq!((state, last.at, last.state), (None, at(20), NmtState::PreOperational));
        assert!(last.is_overdue(at(530)));
    }

    #[test]
    fn heartbeat_before_the_command_confirms_nothing() {
        let (mut confirmation, _) = start(NmtCommand::StartRemoteNode, &[3]);
        let before = Instant::from_micros(8);
        let beat = Frame::new(0x703, [5]);
        assert_eq!(confirmation.on_frame(before, &beat, &mut Vec::new()), None);
        for frame in [Frame::new(0x703, []), Frame::new(0x703, [5, 5]), Frame::new(0x700, [5])] {
            assert_eq!(confirmation.on_frame(confirmation.closes, &frame, &mut Vec::new()), None);
        }
    }
}
