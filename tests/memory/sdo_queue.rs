//! SDO requests to several nodes, one transfer at a time per node: the client of the tests on a disturbed bus.
//!
//! Nodes are served in parallel, the requests to one node in order. Every request has one outcome, unless it
//! is cancelled.

use std::collections::{BTreeMap, VecDeque};

use crate::common::prelude::*;
use canopen::sdo::{Outcome, SdoError, SdoOptions, Transfer};

/// Request to a node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Request {
    pub(crate) object: Object,
    /// Read or write.
    pub(crate) task: Task,
    /// Protocol, and timeout of each reply.
    pub(crate) options: SdoOptions,
    /// Maximum time from the request to its outcome.
    pub(crate) within: Duration,
}

/// Access to an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Task {
    /// Uploads the object.
    Read,
    /// Downloads these bytes, little-endian.
    Write(Vec<u8>),
}

/// Identifier of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Ticket(u64);

/// Finished request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Done {
    pub(crate) ticket: Ticket,
    pub(crate) node: NodeId,
    pub(crate) object: Object,
    pub(crate) outcome: Outcome,
}

/// Queue of requests to several nodes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Queue {
    issued: u64,
    lines: BTreeMap<u8, Line>,
}

/// Requests to one node.
#[derive(Clone, Debug)]
struct Line {
    node: NodeId,
    waiting: VecDeque<Waiting>,
    running: Option<Running>,
}

#[derive(Clone, Debug)]
struct Waiting {
    ticket: Ticket,
    request: Request,
    until: Instant,
}

#[derive(Clone, Debug)]
struct Running {
    ticket: Ticket,
    object: Object,
    until: Instant,
    transfer: Transfer,
}

impl Queue {
    /// Queues a request to `node`; the next call of [`on_time`](Self::on_time) starts it.
    pub(crate) fn submit(&mut self, now: Instant, node: NodeId, request: Request) -> Ticket {
        let ticket = Ticket(self.issued);
        self.issued += 1;
        let until = now + request.within;
        let line = self.lines.entry(node.raw()).or_insert_with(|| Line::new(node));
        line.waiting.push_back(Waiting { ticket, request, until });
        ticket
    }

    /// Cancels a request, without an outcome, and aborts its transfer. Returns false if it has already ended.
    pub(crate) fn cancel(&mut self, ticket: Ticket, out: &mut Vec<Frame>) -> bool {
        let is_cancelled = self.lines.values_mut().any(|line| line.cancel(ticket, out));
        self.lines.retain(|_, line| !line.is_empty());
        is_cancelled
    }

    /// Cancels every request. Call it before dropping a queue in use, as servers would wait otherwise.
    pub(crate) fn cancel_all(&mut self, out: &mut Vec<Frame>) {
        for line in std::mem::take(&mut self.lines).values_mut() {
            if let Some(running) = &mut line.running {
                running.transfer.cancel(out);
            }
        }
    }

    /// Number of pending requests.
    pub(crate) fn len(&self) -> usize {
        self.lines.values().map(Line::len).sum()
    }

    /// Returns whether no request is pending.
    pub(crate) fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Takes one received frame; requests are appended to `out`.
    pub(crate) fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Done> {
        let done = self.lines.values_mut().find_map(|line| line.on_frame(now, frame, out));
        self.lines.retain(|_, line| !line.is_empty());
        done
    }

    /// Performs all work that is due, up to one outcome per call.
    pub(crate) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Done> {
        let done = self.lines.values_mut().find_map(|line| line.on_time(now, out));
        self.lines.retain(|_, line| !line.is_empty());
        done
    }

    /// Time of the next call of [`on_time`](Self::on_time); `None` without pending requests.
    pub(crate) fn deadline(&self) -> Option<Instant> {
        self.lines.values().filter_map(Line::deadline).min()
    }
}

impl Line {
    const fn new(node: NodeId) -> Self {
        Self { node, waiting: VecDeque::new(), running: None }
    }

    fn len(&self) -> usize {
        self.waiting.len() + usize::from(self.running.is_some())
    }

    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn cancel(&mut self, ticket: Ticket, out: &mut Vec<Frame>) -> bool {
        if let Some(mut running) = self.running.take_if(|running| running.ticket == ticket) {
            running.transfer.cancel(out);
            return true;
        }
        let place = self.waiting.iter().position(|waiting| waiting.ticket == ticket);
        place.and_then(|place| self.waiting.remove(place)).is_some()
    }

    fn on_frame(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) -> Option<Done> {
        let outcome = self.running.as_mut()?.transfer.on_frame(now, frame, out)?;
        self.end(outcome)
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Done> {
        // A queued request may time out before it is started.
        if let Some(place) = self.waiting.iter().position(|waiting| now >= waiting.until) {
            let Waiting { ticket, request, .. } = self.waiting.remove(place)?;
            return Some(self.done(ticket, request.object, Err(SdoError::Timeout)));
        }
        if let Some(running) = &mut self.running {
            if now >= running.until {
                running.transfer.cancel(out);
                return self.end(Err(SdoError::Timeout));
            }
            let outcome = running.transfer.on_time(now, out)?;
            return self.end(outcome);
        }
        let waiting = self.waiting.pop_front()?;
        self.start(now, waiting, out)
    }

    fn deadline(&self) -> Option<Instant> {
        let waiting = self.waiting.iter().map(|waiting| waiting.until);
        let next = match &self.running {
            None => (!self.waiting.is_empty()).then_some(Instant::ZERO),
            Some(running) => Some(
                running.transfer.deadline().map_or(running.until, |due| due.min(running.until)),
            ),
        };
        waiting.chain(next).min()
    }

    /// Starts the next request. Returns its outcome if it cannot be started.
    fn start(&mut self, now: Instant, waiting: Waiting, out: &mut Vec<Frame>) -> Option<Done> {
        let Waiting { ticket, request: Request { object, task, options, .. }, until } = waiting;
        let started = match task {
            Task::Read => Ok(Transfer::read_with(options, self.node, object, now, out)),
            Task::Write(bytes) => Transfer::write_with(options, self.node, object, bytes, now, out),
        };
        match started {
            Ok(transfer) => {
                self.running = Some(Running { ticket, object, until, transfer });
                None
            }
            Err(error) => Some(self.done(ticket, object, Err(error))),
        }
    }

    fn end(&mut self, outcome: Outcome) -> Option<Done> {
        let Running { ticket, object, .. } = self.running.take()?;
        Some(self.done(ticket, object, outcome))
    }

    const fn done(&self, ticket: Ticket, object: Object, outcome: Outcome) -> Done {
        Done { ticket, node: self.node, object, outcome }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::abort::AbortCode;
    use canopen::sdo::Content;

    const TYPE: Object = Object::DEVICE_TYPE;
    const ERRORS: Object = Object::ERROR_REGISTER;
    const NOW: Instant = Instant::ZERO;
    const WITHIN: Duration = Duration::from_millis(250);

    fn node(raw: u8) -> NodeId {
        NodeId::new(raw).unwrap()
    }

    fn reading(object: Object) -> Request {
        let options = SdoOptions::segmented(Duration::from_millis(100));
        Request { object, task: Task::Read, options, within: WITHIN }
    }

    /// Calls `on_time` for everything that is due at `now`.
    fn due(queue: &mut Queue, now: Instant) -> (Vec<Done>, Vec<Frame>) {
        let (mut over, mut out) = (Vec::new(), Vec::new());
        while queue.deadline().is_some_and(|due| due <= now) {
            over.extend(queue.on_time(now, &mut out));
        }
        (over, out)
    }

    fn request(node: u8, object: Object) -> Frame {
        let [low, high] = object.index.to_le_bytes();
        Frame::new(0x600 + u16::from(node), [0x40, low, high, object.sub, 0, 0, 0, 0])
    }

    fn reply(node: u8, object: Object) -> Frame {
        let [low, high] = object.index.to_le_bytes();
        Frame::new(0x580 + u16::from(node), [0x4F, low, high, object.sub, node, 0, 0, 0])
    }

    fn abort(node: u8, object: Object, code: AbortCode) -> Frame {
        let [low, high] = object.index.to_le_bytes();
        let [a, b, c, d] = code.0.to_le_bytes();
        Frame::new(0x600 + u16::from(node), [0x80, low, high, object.sub, a, b, c, d])
    }

    fn bytes(done: Option<Done>) -> (Ticket, Vec<u8>) {
        let done = done.expect("an outcome");
        (done.ticket, done.outcome.expect("a value").bytes().to_vec())
    }

    #[test]
    fn nodes_are_served_in_parallel_with_one_request_each() {
        let mut queue = Queue::default();
        let first = queue.submit(NOW, node(5), reading(TYPE));
        let second = queue.submit(NOW, node(5), reading(ERRORS));
        let other = queue.submit(NOW, node(7), reading(TYPE));
        let (over, out) = due(&mut queue, NOW);
        assert_eq!((over, out), (vec![], vec![request(5, TYPE), request(7, TYPE)]));
        let mut out = Vec::new();
        assert_eq!(queue.on_frame(NOW, &reply(5, ERRORS), &mut out), None, "not its turn");
        assert_eq!(bytes(queue.on_frame(NOW, &reply(7, TYPE), &mut out)), (other, vec![7]));
        assert_eq!(bytes(queue.on_frame(NOW, &reply(5, TYPE), &mut out)), (first, vec![5]));
        assert_eq!((out, queue.len()), (vec![], 1));
        assert_eq!(due(&mut queue, NOW).1, [request(5, ERRORS)]);
        let mut out = Vec::new();
        assert_eq!(bytes(queue.on_frame(NOW, &reply(5, ERRORS), &mut out)), (second, vec![5]));
        assert!(queue.is_empty());
        assert_eq!(queue.deadline(), None);
    }

    #[test]
    fn failed_request_starts_the_next_one() {
        let mut queue = Queue::default();
        let first = queue.submit(NOW, node(5), reading(TYPE));
        let second = queue.submit(NOW, node(5), reading(ERRORS));
        due(&mut queue, NOW);
        let refusal = Frame::new(0x585, [0x80, 0x00, 0x10, 0, 0, 0, 2, 6]);
        let done = queue.on_frame(NOW, &refusal, &mut Vec::new()).unwrap();
        assert_eq!((done.ticket, done.node, done.object), (first, node(5), TYPE));
        assert_eq!(done.outcome, Err(SdoError::AbortedByServer(AbortCode::NO_OBJECT)));
        assert_eq!(due(&mut queue, NOW).1, [request(5, ERRORS)]);
        let (over, out) = due(&mut queue, NOW + Duration::from_millis(100));
        assert_eq!((over[0].ticket, &over[0].outcome), (second, &Err(SdoError::Timeout)));
        assert_eq!(out, [abort(5, ERRORS, AbortCode::TIMED_OUT)]);
    }

    #[test]
    fn every_request_ends_within_its_time() {
        let mut queue = Queue::default();
        for _ in 0..5 {
            queue.submit(NOW, node(5), reading(TYPE));
        }
        let mut tickets = Vec::new();
        for millis in [0, 100, 200, 250] {
            let (over, _) = due(&mut queue, NOW + Duration::from_millis(millis));
            assert!(over.iter().all(|done| done.outcome == Err(SdoError::Timeout)));
            tickets.push(over.len());
        }
        assert_eq!(
            tickets,
            [0, 1, 1, 3],
            "two transfers timed out, one was started, two never were"
        );
        assert!(queue.is_empty());
    }

    #[test]
    fn cancelled_request_has_no_outcome_and_is_aborted() {
        let mut queue = Queue::default();
        let first = queue.submit(NOW, node(5), reading(TYPE));
        let second = queue.submit(NOW, node(5), reading(ERRORS));
        due(&mut queue, NOW);
        let mut out = Vec::new();
        assert!(queue.cancel(second, &mut out));
        assert!(out.is_empty(), "it was not started");
        assert!(queue.cancel(first, &mut out));
        assert_eq!(out, [abort(5, TYPE, AbortCode::GENERAL_ERROR)]);
        assert!(!queue.cancel(first, &mut out));
        assert!(queue.is_empty());
        assert_eq!(queue.on_frame(NOW, &reply(5, TYPE), &mut out), None);
    }

    #[test]
    fn cancel_all_aborts_every_transfer() {
        let mut queue = Queue::default();
        for raw in [5, 5, 7] {
            queue.submit(NOW, node(raw), reading(TYPE));
        }
        due(&mut queue, NOW);
        let mut out = Vec::new();
        queue.cancel_all(&mut out);
        assert_eq!(out, [5, 7].map(|raw| abort(raw, TYPE, AbortCode::GENERAL_ERROR)));
        assert_eq!((queue.len(), queue.deadline()), (0, None));
    }

    #[test]
    fn oversized_write_fails_before_it_is_started() {
        let mut queue = Queue::default();
        let options = SdoOptions { limit: 1, ..SdoOptions::segmented(WITHIN) };
        let task = Task::Write(vec![1, 2]);
        queue.submit(NOW, node(5), Request { object: TYPE, task, options, within: WITHIN });
        queue.submit(
            NOW,
            node(5),
            Request { task: Task::Write(vec![1]), options, ..reading(ERRORS) },
        );
        let (over, out) = due(&mut queue, NOW);
        assert_eq!(over[0].outcome, Err(SdoError::AbortedLocally(AbortCode::OUT_OF_MEMORY)));
        assert_eq!(out, [Frame::new(0x605, [0x2F, 0x01, 0x10, 0, 1, 0, 0, 0])]);
        let confirmed = Frame::new(0x585, [0x60, 0x01, 0x10, 0, 0, 0, 0, 0]);
        let done = queue.on_frame(NOW, &confirmed, &mut Vec::new()).unwrap();
        assert_eq!(done.outcome, Ok(Content::default()));
    }
}
