//! Requests to several nodes, one transfer at a time at each.
//!
//! Nodes are served side by side, the requests of one in the order they were asked. Every request has
//! an outcome, once, unless it is cancelled.

use std::collections::BTreeMap;
use std::collections::VecDeque;
use std::time::Duration;

use canopen_rs::NodeId;

use crate::canopen::frame::Frame;
use crate::canopen::object::Object;
use crate::canopen::sdo::Outcome;
use crate::canopen::sdo::SdoError;
use crate::canopen::sdo::terms::Terms;
use crate::canopen::sdo::transfer::Transfer;
use crate::time::Instant;

/// What is asked of a node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// Of which object.
    pub object: Object,
    /// To read or to write.
    pub task: Task,
    /// By which protocol, and how patiently with each reply.
    pub terms: Terms,
    /// How long it may take in all, from when it is asked.
    pub within: Duration,
}

/// What is to be done with an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Task {
    /// Tell what it holds.
    Read,
    /// Make it hold these bytes, little-endian.
    Write(Vec<u8>),
}

/// By which a request is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(u64);

/// A request that is over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Done {
    /// Which.
    pub ticket: Ticket,
    /// Who was asked.
    pub node: NodeId,
    /// For which object.
    pub object: Object,
    /// How it ended.
    pub outcome: Outcome,
}

/// Requests to several nodes.
#[derive(Clone, Debug, Default)]
pub struct Queue {
    issued: u64,
    lines: BTreeMap<u8, Line>,
}

/// The requests to one node.
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
    /// Puts a request to `node` behind those it has; it begins with a call of
    /// [`on_time`](Self::on_time).
    pub fn ask(&mut self, now: Instant, node: NodeId, request: Request) -> Ticket {
        let ticket = Ticket(self.issued);
        self.issued += 1;
        let until = now + request.within;
        let line = self.lines.entry(node.raw()).or_insert_with(|| Line::new(node));
        line.waiting.push_back(Waiting { ticket, request, until });
        ticket
    }

    /// Takes back a request, which then has no outcome; the server is told where it had begun. False
    /// if it is over.
    pub fn cancel(&mut self, ticket: Ticket, out: &mut Vec<Frame>) -> bool {
        let is_cancelled = self.lines.values_mut().any(|line| line.cancel(ticket, out));
        self.lines.retain(|_, line| !line.is_empty());
        is_cancelled
    }

    /// Takes back every request. To be called before a queue in use is dropped, or servers would wait.
    pub fn cancel_all(&mut self, out: &mut Vec<Frame>) {
        for line in std::mem::take(&mut self.lines).values_mut() {
            if let Some(running) = &mut line.running {
                running.transfer.cancel(out);
            }
        }
    }

    /// How many requests are not over.
    pub fn len(&self) -> usize {
        self.lines.values().map(Line::len).sum()
    }

    /// Whether every request is over.
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Takes one received frame; requests are appended to `out`.
    pub fn on_frame(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) -> Option<Done> {
        let done = self.lines.values_mut().find_map(|line| line.on_frame(now, frame, out));
        self.lines.retain(|_, line| !line.is_empty());
        done
    }

    /// Does what is due, until one request is over; called again, it goes on.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Done> {
        let done = self.lines.values_mut().find_map(|line| line.on_time(now, out));
        self.lines.retain(|_, line| !line.is_empty());
        done
    }

    /// When [`on_time`](Self::on_time) must next be called; `None` when every request is over.
    pub fn deadline(&self) -> Option<Instant> {
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
        // One that waits for its turn may have waited too long.
        if let Some(place) = self.waiting.iter().position(|waiting| now >= waiting.until) {
            let Waiting { ticket, request, .. } = self.waiting.remove(place)?;
            return Some(self.done(ticket, request.object, Err(SdoError::Silent)));
        }
        if let Some(running) = &mut self.running {
            if now >= running.until {
                running.transfer.cancel(out);
                return self.end(Err(SdoError::Silent));
            }
            let outcome = running.transfer.on_time(now, out)?;
            return self.end(outcome);
        }
        let waiting = self.waiting.pop_front()?;
        self.begin(now, waiting, out)
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

    /// Begins the request whose turn it is; one that cannot be begun is over.
    fn begin(&mut self, now: Instant, waiting: Waiting, out: &mut Vec<Frame>) -> Option<Done> {
        let Waiting { ticket, request: Request { object, task, terms, .. }, until } = waiting;
        let begun = match task {
            Task::Read => Ok(Transfer::read_on(terms, self.node, object, now, out)),
            Task::Write(bytes) => Transfer::write_on(terms, self.node, object, bytes, now, out),
        };
        match begun {
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
