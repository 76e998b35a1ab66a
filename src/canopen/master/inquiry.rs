//! What a running node is asked or told by SDO, one thing at a time: what it remembers of its errors, the
//! state of its power stage, to take its power off.
//!
//! Which, and when, is decided by the owner of the [master](crate::master).

use std::time::Duration;

use canopen_rs::NodeId;
use canopen_rs::Value;

use crate::drive::Controlword;
use crate::drive::Statusword;
use crate::frame::Frame;
use crate::master::error_history::History;
use crate::master::error_history::Reading;
use crate::object::Object;
use crate::sdo::Content;
use crate::sdo::Outcome;
use crate::sdo::Transfer;
use crate::sdo::bytes;
use units::time::Instant;

/// How long a node has for its answer.
const REPLY: Duration = Duration::from_millis(500);

/// Times that an inquiry which another client disturbed begins again.
const MAX_REPEATS: u8 = 3;

/// One transfer under way, or several in a row. Where it fails and another client of the same server has
/// sent a request meanwhile, it begins again.
#[derive(Clone, Debug)]
pub(super) struct Inquiry {
    node: NodeId,
    task: Task,
    is_disturbed: bool,
    repeats: u8,
}

/// What is read or written.
#[derive(Clone, Debug)]
enum Task {
    /// 1003h is read.
    History(Reading),
    /// 6041h is read.
    Statusword(Transfer),
    /// 6040h = 0 is written.
    PowerOff(Transfer),
}

/// What came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Answer {
    /// What the node remembers.
    History(History),
    /// The state of its power stage.
    Statusword(Statusword),
    /// Nothing that is to be told: it was done, or the node did not say.
    Nothing,
}

impl Inquiry {
    /// Asks for the history of `node`.
    pub(super) fn history(node: NodeId, now: Instant, out: &mut Vec<Frame>) -> Self {
        Self::new(node, Task::History(Reading::new(node, now, out)))
    }

    /// Asks for the statusword of `node`.
    pub(super) fn statusword(node: NodeId, now: Instant, out: &mut Vec<Frame>) -> Self {
        let transfer = Transfer::read(node, Object::STATUSWORD, REPLY, now, out);
        Self::new(node, Task::Statusword(transfer))
    }

    /// Tells `node` to take its power off; `None` cannot be, as two bytes always fit.
    pub(super) fn power_off(node: NodeId, now: Instant, out: &mut Vec<Frame>) -> Option<Self> {
        let off = bytes(&Value::Unsigned16(Controlword::DISABLE_VOLTAGE.0));
        let transfer = Transfer::write(node, Object::CONTROLWORD, off, REPLY, now, out).ok()?;
        Some(Self::new(node, Task::PowerOff(transfer)))
    }

    const fn new(node: NodeId, task: Task) -> Self {
        Self { node, task, is_disturbed: false, repeats: 0 }
    }

    /// Another client has sent a request to the same server.
    pub(super) const fn disturb(&mut self) {
        self.is_disturbed = true;
    }

    /// Takes one received frame; the answer comes once.
    pub(super) fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Answer> {
        let outcome = match &mut self.task {
            Task::History(reading) => {
                reading.on_frame(now, frame, out).map(|history| of_history(reading, history))
            }
            Task::Statusword(transfer) => transfer.on_frame(now, frame, out).map(of_statusword),
            Task::PowerOff(transfer) => transfer.on_frame(now, frame, out).map(of_power_off),
        };
        self.conclude(now, outcome?, out)
    }

    /// Ends the wait for a reply whose time is over.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Answer> {
        let outcome = match &mut self.task {
            Task::History(reading) => {
                reading.on_time(now, out).map(|history| of_history(reading, history))
            }
            Task::Statusword(transfer) => transfer.on_time(now, out).map(of_statusword),
            Task::PowerOff(transfer) => transfer.on_time(now, out).map(of_power_off),
        };
        self.conclude(now, outcome?, out)
    }

    /// When [`on_time`](Self::on_time) must next be called; `None` once it is over.
    pub(super) const fn deadline(&self) -> Option<Instant> {
        match &self.task {
            Task::History(reading) => reading.deadline(),
            Task::Statusword(transfer) | Task::PowerOff(transfer) => transfer.deadline(),
        }
    }

    /// Returns the answer, or begins again.
    fn conclude(
        &mut self,
        now: Instant,
        outcome: Result<Answer, Answer>,
        out: &mut Vec<Frame>,
    ) -> Option<Answer> {
        let (Ok(answer) | Err(answer)) = outcome;
        if outcome.is_ok() || !self.is_disturbed || self.repeats >= MAX_REPEATS {
            return Some(answer);
        }
        let again = match &self.task {
            Task::History(_) => Some(Self::history(self.node, now, out)),
            Task::Statusword(_) => Some(Self::statusword(self.node, now, out)),
            Task::PowerOff(_) => Self::power_off(self.node, now, out),
        };
        let Some(again) = again else { return Some(answer) };
        *self = Self { repeats: self.repeats + 1, ..again };
        None
    }
}

/// A history, `Err` if only a part of it was read.
const fn of_history(reading: &Reading, history: History) -> Result<Answer, Answer> {
    let answer = Answer::History(history);
    if reading.has_failed() { Err(answer) } else { Ok(answer) }
}

fn of_statusword(outcome: Outcome) -> Result<Answer, Answer> {
    let content = outcome.map_err(|_| Answer::Nothing)?;
    Ok(statusword(&content).unwrap_or(Answer::Nothing))
}

fn of_power_off(outcome: Outcome) -> Result<Answer, Answer> {
    outcome.map(|_| Answer::Nothing).map_err(|_| Answer::Nothing)
}

/// A statusword, if these are the two bytes of one.
fn statusword(content: &Content) -> Option<Answer> {
    let raw = content.exactly(2)?.try_into().ok()?;
    Some(Answer::Statusword(Statusword(u16::from_le_bytes(raw))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node() -> NodeId {
        NodeId::new(3).unwrap()
    }

    #[test]
    fn a_state_is_told_and_one_of_the_wrong_size_is_none() {
        for (reply, answer) in [
            ([0x4B, 0x41, 0x60, 0, 0x08, 0x02, 0, 0], Answer::Statusword(Statusword(0x0208))),
            ([0x43, 0x41, 0x60, 0, 0x08, 0x02, 0, 0], Answer::Nothing),
            ([0x80, 0x41, 0x60, 0, 0, 0, 2, 6], Answer::Nothing),
        ] {
            let mut out = Vec::new();
            let mut inquiry = Inquiry::statusword(node(), Instant::ZERO, &mut out);
            let reply = Frame::new(0x583, reply);
            assert_eq!(inquiry.on_frame(Instant::ZERO, &reply, &mut out), Some(answer));
        }
    }

    #[test]
    fn power_is_taken_off_by_one_frame() {
        let mut out = Vec::new();
        let inquiry = Inquiry::power_off(node(), Instant::ZERO, &mut out).unwrap();
        assert_eq!(out, [Frame::new(0x603, [0x2B, 0x40, 0x60, 0, 0, 0, 0, 0])]);
        assert!(inquiry.deadline().is_some());
    }

    #[test]
    fn an_inquiry_that_another_client_breaks_begins_again() {
        let mut out = Vec::new();
        let mut inquiry = Inquiry::statusword(node(), Instant::ZERO, &mut out);
        let abort = Frame::new(0x583, [0x80, 0x41, 0x60, 0, 0, 0, 4, 5]);
        for repeat in 0..=MAX_REPEATS {
            inquiry.disturb();
            let answer = inquiry.on_frame(Instant::ZERO, &abort, &mut out);
            let is_last = repeat == MAX_REPEATS;
            assert_eq!(answer, is_last.then_some(Answer::Nothing), "{repeat}");
        }
        assert_eq!(out, [Frame::new(0x603, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]); 4]);
        let mut inquiry = Inquiry::statusword(node(), Instant::ZERO, &mut out);
        let answer = inquiry.on_frame(Instant::ZERO, &abort, &mut out);
        assert_eq!(answer, Some(Answer::Nothing), "refused, and undisturbed");
    }
}
