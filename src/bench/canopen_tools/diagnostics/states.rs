//! NMT states of nodes that send no heartbeat, polled one by one by remote frames: node guarding (CiA 301, 7.2.8.2.2.1).
//!
//! A node with a life time (100Ch times 100Dh) starts life guarding at its first remote frame. It would detect a lost master
//! when the polls end, so such nodes are not polled.

use std::collections::VecDeque;
use std::time::Duration;

use canopen_rs::nmt::{decode_heartbeat, heartbeat_cob_id};
use canopen_rs::{NmtState, NodeId};

use crate::procedure::Procedure;
use canopen::frame::Frame;
use canopen::object::Object;
use canopen::sdo::{Outcome, SdoError, Transfer};
use units::time::Instant;

/// Toggle bit of an answer.
const TOGGLE: u8 = 0x80;

/// Answer of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// State in its answer to the remote frame.
    State(NmtState),
    /// No answer in time.
    Silent,
    /// Not polled: life guarding would start.
    LifeGuarding,
}

/// Poll of one node.
#[derive(Clone, Debug)]
enum Step {
    /// Reads the guard time (100Ch), then the life time factor (100Dh).
    Read(Object, Box<Transfer>),
    /// Waits for the answer to the remote frame.
    Poll(Instant),
}

/// Poll in progress.
#[derive(Clone, Debug)]
pub struct States {
    timeout: Duration,
    waiting: VecDeque<NodeId>,
    current: Option<(NodeId, Step)>,
    answers: Vec<(NodeId, Answer)>,
}

impl States {
    /// Polls `nodes`, which answer SDO requests, with `timeout` for each response.
    pub fn start(
        nodes: impl IntoIterator<Item = NodeId>,
        timeout: Duration,
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Self {
        let waiting = nodes.into_iter().collect();
        let mut states = Self { timeout, waiting, current: None, answers: Vec::new() };
        states.ask_next(now, out);
        states
    }

    fn ask_next(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.current = None;
        if let Some(node) = self.waiting.pop_front() {
            self.read(node, Object::GUARD_TIME, now, out);
        }
    }

    fn read(&mut self, node: NodeId, object: Object, now: Instant, out: &mut Vec<Frame>) {
        let read = Transfer::read(node, object, self.timeout, now, out);
        self.current = Some((node, Step::Read(object, Box::new(read))));
    }

    fn conclude(&mut self, node: NodeId, answer: Answer, now: Instant, out: &mut Vec<Frame>) {
        self.answers.push((node, answer));
        self.ask_next(now, out);
    }

    fn poll(&mut self, node: NodeId, now: Instant, out: &mut Vec<Frame>) {
        out.push(Frame::remote(heartbeat_cob_id(node), 1));
        self.current = Some((node, Step::Poll(now + self.timeout)));
    }

    /// Takes the content of 100Ch or 100Dh.
    fn on_read(
        &mut self,
        (node, object): (NodeId, Object),
        read: Outcome,
        now: Instant,
        out: &mut Vec<Frame>,
    ) {
        let is_guard_time = object == Object::GUARD_TIME;
        let is_set = match read {
            Err(SdoError::Timeout) => return self.conclude(node, Answer::Silent, now, out),
            // A node without the object has no life time.
            Err(SdoError::AbortedByServer(_) | SdoError::AbortedLocally(_)) => false,
            Ok(content) => {
                let size = if is_guard_time { 2 } else { 1 };
                let bytes = content.exactly(size).unwrap_or_else(|| content.bytes());
                bytes.iter().any(|byte| *byte != 0)
            }
        };
        match (is_set, is_guard_time) {
            (false, _) => self.poll(node, now, out),
            (true, true) => self.read(node, Object::LIFE_TIME_FACTOR, now, out),
            (true, false) => self.conclude(node, Answer::LifeGuarding, now, out),
        }
    }

    fn outcome(&mut self) -> Option<Vec<(NodeId, Answer)>> {
        self.current.is_none().then(|| std::mem::take(&mut self.answers))
    }
}

impl Procedure for States {
    /// Every polled node with its answer.
    type Outcome = Vec<(NodeId, Answer)>;

    fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Self::Outcome> {
        let (node, step) = self.current.as_mut()?;
        let node = *node;
        match step {
            Step::Read(object, transfer) => {
                let (object, read) = (*object, transfer.on_frame(now, frame, out)?);
                self.on_read((node, object), read, now, out);
            }
            Step::Poll(_) => {
                let state = state(node, frame)?;
                self.conclude(node, Answer::State(state), now, out);
            }
        }
        self.outcome()
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Self::Outcome> {
        let Some((node, step)) = self.current.as_mut() else { return self.outcome() };
        let node = *node;
        match step {
            Step::Read(object, transfer) => {
                let (object, read) = (*object, transfer.on_time(now, out)?);
                self.on_read((node, object), read, now, out);
            }
            Step::Poll(until) if now >= *until => self.conclude(node, Answer::Silent, now, out),
            Step::Poll(_) => {}
        }
        self.outcome()
    }

    fn deadline(&self) -> Option<Instant> {
        match &self.current {
            Some((_, Step::Read(_, transfer))) => transfer.deadline(),
            Some((_, Step::Poll(until))) => Some(*until),
            None => Some(Instant::ZERO),
        }
    }

    fn abandon(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Some((_, Step::Read(_, transfer))) = &mut self.current {
            transfer.abandon(now, out);
        }
    }
}

/// Decodes the answer of a node, or its heartbeat.
pub(super) fn state(node: NodeId, frame: &Frame) -> Option<NmtState> {
    if frame.cob_id != heartbeat_cob_id(node) || frame.is_remote() {
        return None;
    }
    let &[answer] = frame.data() else { return None };
    let state = decode_heartbeat(&[answer & !TOGGLE]).ok()?;
    Some(if state == NmtState::Initialising { NmtState::PreOperational } else { state })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMEOUT: Duration = Duration::from_millis(100);

    fn node(raw: u8) -> NodeId {
        NodeId::new(raw).unwrap()
    }

    /// Node with this guard time and life time factor, absent where `None`; it answers polls with `state`.
    fn device(
        raw: u16,
        times: Option<(u8, u8)>,
        state: Option<u8>,
        frame: &Frame,
    ) -> Option<Frame> {
        if *frame == Frame::remote(0x700 + raw, 1) {
            return Some(Frame::new(0x700 + raw, [state?]));
        }
        let &[0x40, low, high, sub, ..] = frame.data() else { return None };
        if frame.cob_id != 0x600 + raw {
            return None;
        }
        let reply = match (u16::from_le_bytes([low, high]), times) {
            (0x100C, Some((time, _))) => [0x4B, low, high, sub, time, 0, 0, 0],
            (0x100D, Some((_, factor))) => [0x4F, low, high, sub, factor, 0, 0, 0],
            _ => [0x80, low, high, sub, 0, 0, 2, 6],
        };
        Some(Frame::new(0x580 + raw, reply))
    }

    /// Answers of nodes, and all frames sent.
    fn ask(
        nodes: &[u8],
        answer: impl Fn(&Frame) -> Option<Frame>,
    ) -> (Vec<(NodeId, Answer)>, Vec<Frame>) {
        let (mut now, mut out, mut sent) = (Instant::ZERO, Vec::new(), Vec::new());
        let mut states = States::start(nodes.iter().copied().map(node), TIMEOUT, now, &mut out);
        loop {
            let requests = std::mem::take(&mut out);
            assert!(requests.len() <= 2, "one request at a time, and the abort of the last");
            sent.extend(requests.iter().copied());
            let outcome = match requests.iter().find_map(&answer) {
                Some(reply) => states.on_frame(now, &reply, &mut out),
                None => {
                    now = states.deadline().unwrap().max(now);
                    states.on_time(now, &mut out)
                }
            };
            if let Some(answers) = outcome {
                return (answers, sent);
            }
        }
    }

    #[test]
    fn states_are_asked_one_by_one_with_either_toggle_bit() {
        let answer = |frame: &Frame| {
            let with = |raw, state| device(raw, Some((0, 3)), Some(state), frame);
            with(3, 0x85).or_else(|| with(4, 0x7F)).or_else(|| device(5, None, None, frame))
        };
        let (answers, sent) = ask(&[3, 4, 5, 6], answer);
        let expected = [
            (node(3), Answer::State(NmtState::Operational)),
            (node(4), Answer::State(NmtState::PreOperational)),
            (node(5), Answer::Silent),
            (node(6), Answer::Silent),
        ];
        assert_eq!(answers, expected);
        let polls = sent.iter().filter(|frame| frame.is_remote()).count();
        assert_eq!(polls, 3, "node 6 does not answer SDO");
    }

    #[test]
    fn node_with_a_life_time_is_not_polled() {
        let answer = |frame: &Frame| device(3, Some((20, 3)), Some(5), frame);
        let (answers, sent) = ask(&[3], answer);
        assert_eq!(answers, [(node(3), Answer::LifeGuarding)]);
        assert!(sent.iter().all(|frame| !frame.is_remote()));
        let factorless = |frame: &Frame| device(3, Some((20, 0)), Some(5), frame);
        assert_eq!(ask(&[3], factorless).0, [(node(3), Answer::State(NmtState::Operational))]);
    }

    #[test]
    fn no_nodes_end_at_once() {
        assert_eq!(ask(&[], |_| None), (Vec::new(), Vec::new()));
    }
}
