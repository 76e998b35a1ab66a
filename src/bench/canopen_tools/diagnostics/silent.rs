//! NMT states of nodes that respond to no SDO request, polled by one remote frame each. An NMT-stopped node still answers node
//! guarding (CiA 301, 7.3.2.2.4).
//!
//! The life time of such a node (100Ch times 100Dh) cannot be read before the poll. If it has one, the remote frame starts
//! its life guarding.

use std::time::Duration;

use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::{NmtState, NodeId};

use crate::diagnostics::states::state;
use crate::procedure::Procedure;
use canopen::frame::Frame;
use units::time::Instant;

/// Nodes polled in parallel: their remote frames fit any transmit queue.
const MAX_PARALLEL: usize = 20;

/// Poll in progress.
#[derive(Clone, Debug)]
pub struct Silent {
    timeout: Duration,
    waiting: Vec<NodeId>,
    asked: Vec<NodeId>,
    /// End of the wait for the polled nodes.
    until: Instant,
    answers: Vec<(NodeId, NmtState)>,
}

impl Silent {
    /// Polls `nodes`, with `timeout` for each answer.
    pub fn start(
        nodes: impl IntoIterator<Item = NodeId>,
        timeout: Duration,
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Self {
        let mut waiting: Vec<NodeId> = nodes.into_iter().collect();
        waiting.reverse();
        let mut poll =
            Self { timeout, waiting, asked: Vec::new(), until: now, answers: Vec::new() };
        poll.ask_more(now, out);
        poll
    }

    fn ask_more(&mut self, now: Instant, out: &mut Vec<Frame>) {
        let kept = self.waiting.len().saturating_sub(MAX_PARALLEL);
        self.asked = self.waiting.split_off(kept);
        self.asked.reverse();
        if !self.asked.is_empty() {
            self.until = now + self.timeout;
        }
        out.extend(self.asked.iter().map(|node| Frame::remote(heartbeat_cob_id(*node), 1)));
    }
}

impl Procedure for Silent {
    /// Nodes that answered, with their states.
    type Outcome = Vec<(NodeId, NmtState)>;

    fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Self::Outcome> {
        let answer = self.asked.iter().find_map(|node| Some((*node, state(*node, frame)?)));
        if let Some((node, state)) = answer {
            self.asked.retain(|asked| *asked != node);
            self.answers.push((node, state));
        }
        self.on_time(now, out)
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Self::Outcome> {
        if !self.asked.is_empty() && now < self.until {
            return None;
        }
        self.ask_more(now, out);
        self.asked.is_empty().then(|| std::mem::take(&mut self.answers))
    }

    fn deadline(&self) -> Option<Instant> {
        Some(self.until)
    }

    fn abandon(&mut self, _now: Instant, _out: &mut Vec<Frame>) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMEOUT: Duration = Duration::from_millis(100);

    /// Answers to the polls of nodes 1 to `last`, its end, and the most frames sent at once.
    fn ask(
        last: u8,
        answer: impl Fn(&Frame) -> Option<Frame>,
    ) -> (Vec<(u8, NmtState)>, Instant, usize) {
        let (mut now, mut out, mut most) = (Instant::ZERO, Vec::new(), 0);
        let nodes = (1..=last).map(|raw| NodeId::new(raw).unwrap());
        let mut poll = Silent::start(nodes, TIMEOUT, now, &mut out);
        loop {
            let sent = std::mem::take(&mut out);
            assert!(sent.iter().all(Frame::is_remote));
            most = most.max(sent.len());
            let mut outcome = None;
            for reply in sent.iter().filter_map(&answer) {
                outcome = outcome.or(poll.on_frame(now, &reply, &mut out));
            }
            if outcome.is_none() && out.is_empty() {
                now = now.max(poll.deadline().unwrap());
                outcome = poll.on_time(now, &mut out);
            }
            if let Some(answers) = outcome {
                let answers = answers.into_iter().map(|(node, state)| (node.raw(), state));
                return (answers.collect(), now, most);
            }
        }
    }

    #[test]
    fn stopped_node_is_found_on_a_bus_of_127() {
        let answer = |frame: &Frame| match frame.cob_id {
            0x703 => Some(Frame::new(0x703, [0x84])),
            0x77F => Some(Frame::new(0x77F, [0x04])),
            _ => None,
        };
        let (answers, end, most) = ask(127, answer);
        assert_eq!(answers, [(3, NmtState::Stopped), (127, NmtState::Stopped)]);
        assert!(end <= Instant::from_micros(700_000), "{end:?}");
        assert_eq!(most, MAX_PARALLEL);
    }

    #[test]
    fn answers_of_all_nodes_end_a_round_at_once() {
        let (answers, end, _) = ask(25, |frame| Some(Frame::new(frame.cob_id, [0x04])));
        assert_eq!((answers.len(), end), (25, Instant::ZERO));
        assert_eq!(ask(0, |_| None).0, []);
    }
}
