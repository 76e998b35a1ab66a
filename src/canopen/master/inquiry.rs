//! SDO requests to a running node, one at a time. They read its error history or its statusword, switch its power off
//! and read its statusword, or end its monitoring of the master.
//!
//! The owner of the [master](crate::master) chooses request and time.

use std::time::Duration;

use canopen_rs::{NodeId, Value};

use crate::drive::{Controlword, Statusword};
use crate::frame::Frame;
use crate::master::disturbance::Disturbance;
use crate::master::error_history::{History, HistoryReader};
use crate::master::monitoring_off::{EndResult, MonitoringOff};
use crate::object::Object;
use crate::plan::{NodePlan, REPLY_TIMEOUT};
use crate::sdo::{Content, Outcome, Transfer, bytes};
use units::time::Instant;

/// Time after which a statusword that is not answered is no longer read: the upload is repeated once.
pub const STATUSWORD_TIMEOUT: Duration = Duration::from_millis(1_000);

/// One or several consecutive transfers. A transfer that fails after another client has sent a request to
/// the same server is repeated.
#[derive(Clone, Debug)]
pub(super) struct Inquiry {
    node: NodeId,
    task: Task,
    disturbance: Disturbance,
    /// Set if an unanswered upload was requested again.
    is_read_again: bool,
    /// Set if the frames precede those of all other nodes.
    is_urgent: bool,
}

/// Object that is read or written.
#[derive(Clone, Debug)]
enum Task {
    /// Reads 1003h.
    History(HistoryReader),
    /// Reads 6041h.
    Statusword(Transfer),
    /// Writes 6040h = 0; 6041h is read next.
    PowerOff(Transfer),
    /// Writes 1016h:1 = 0, or 100Dh and 100Ch.
    MonitoringOff(MonitoringOff),
}

/// Outcome of an inquiry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Answer {
    /// Error history of the node.
    History(History),
    /// Statusword of the drive.
    Statusword(Statusword),
    /// Outcome of the end of the node's monitoring of the master.
    Monitoring(EndResult),
    /// No content: the node did not reply, or refused.
    Nothing,
}

impl Task {
    fn history(node: NodeId, now: Instant, out: &mut Vec<Frame>) -> Self {
        Self::History(HistoryReader::new(node, now, out))
    }

    fn statusword(node: NodeId, now: Instant, out: &mut Vec<Frame>) -> Self {
        Self::Statusword(Transfer::read(node, Object::STATUSWORD, REPLY_TIMEOUT, now, out))
    }

    /// Never `None`: two bytes fit an expedited download.
    fn power_off(node: NodeId, now: Instant, out: &mut Vec<Frame>) -> Option<Self> {
        let off = bytes(&Value::Unsigned16(Controlword::DISABLE_VOLTAGE.0));
        let transfer = Transfer::write(node, Object::CONTROLWORD, off, REPLY_TIMEOUT, now, out);
        transfer.ok().map(Self::PowerOff)
    }
}

impl Inquiry {
    /// Requests the error history of `node`.
    pub(super) fn history(node: NodeId, now: Instant, out: &mut Vec<Frame>) -> Self {
        Self::new(node, Task::history(node, now, out))
    }

    /// Requests the statusword of `node`.
    pub(super) fn statusword(node: NodeId, now: Instant, out: &mut Vec<Frame>) -> Self {
        Self::new(node, Task::statusword(node, now, out))
    }

    /// Sends "disable voltage" to `node` ahead of all other requests, then reads its statusword. Never `None`.
    pub(super) fn power_off(node: NodeId, now: Instant, out: &mut Vec<Frame>) -> Option<Self> {
        Some(Self::new(node, Task::power_off(node, now, out)?).urgent())
    }

    /// Sends the frames ahead of those of all other nodes.
    pub(super) fn urgent(self) -> Self {
        Self { is_urgent: true, ..self }
    }

    /// Returns whether the frames precede those of all other nodes.
    pub(super) const fn is_urgent(&self) -> bool {
        self.is_urgent
    }

    /// Ends the node's monitoring of its master; `None` if it monitors none.
    pub(super) fn monitoring_off(
        plan: &NodePlan,
        missing: &[Object],
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Option<Self> {
        let ending = MonitoringOff::start(plan, missing, now, out)?;
        Some(Self::new(plan.node, Task::MonitoringOff(ending)))
    }

    fn new(node: NodeId, task: Task) -> Self {
        let disturbance = Disturbance::default();
        Self { node, task, disturbance, is_read_again: false, is_urgent: false }
    }

    /// Marks the inquiry as disturbed: another client has sent a request to the same server.
    pub(super) const fn disturb(&mut self) {
        self.disturbance.note();
    }

    /// Takes one received frame. Returns the answer once.
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
            Task::MonitoringOff(ending) => ending.on_frame(now, frame, out).map(of_monitoring),
        };
        self.conclude(now, outcome?, out)
    }

    /// Ends the wait for an overdue reply. An upload is requested again, once.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Answer> {
        let outcome = match &mut self.task {
            Task::History(reading) => {
                reading.on_time(now, out).map(|history| of_history(reading, history))
            }
            Task::Statusword(transfer) => transfer.on_time(now, out).map(of_statusword),
            Task::PowerOff(transfer) => transfer.on_time(now, out).map(of_power_off),
            Task::MonitoringOff(ending) => ending.on_time(now, out).map(of_monitoring),
        };
        let outcome = outcome?;
        let is_upload = matches!(self.task, Task::History(_) | Task::Statusword(_));
        if outcome.is_err() && is_upload && !std::mem::replace(&mut self.is_read_again, true) {
            self.disturbance.forget();
            self.task = self.again(now, out)?;
            return None;
        }
        self.conclude(now, outcome, out)
    }

    /// Time of the next call of [`on_time`](Self::on_time); `None` after the answer.
    pub(super) const fn deadline(&self) -> Option<Instant> {
        match &self.task {
            Task::History(reading) => reading.deadline(),
            Task::Statusword(transfer) | Task::PowerOff(transfer) => transfer.deadline(),
            Task::MonitoringOff(ending) => ending.deadline(),
        }
    }

    /// Returns the answer, or repeats a disturbed inquiry.
    fn conclude(
        &mut self,
        now: Instant,
        outcome: Result<Answer, Answer>,
        out: &mut Vec<Frame>,
    ) -> Option<Answer> {
        let (Ok(answer) | Err(answer)) = outcome;
        if outcome.is_ok() && matches!(self.task, Task::PowerOff(_)) {
            *self = Self::statusword(self.node, now, out).urgent();
            return None;
        }
        if outcome.is_ok() || !self.disturbance.take() {
            return Some(answer);
        }
        let Some(task) = self.again(now, out) else { return Some(answer) };
        self.task = task;
        None
    }

    /// Sends the same request again.
    fn again(&self, now: Instant, out: &mut Vec<Frame>) -> Option<Task> {
        match &self.task {
            Task::History(_) => Some(Task::history(self.node, now, out)),
            Task::Statusword(_) => Some(Task::statusword(self.node, now, out)),
            Task::PowerOff(_) => Task::power_off(self.node, now, out),
            // Repeats by itself.
            Task::MonitoringOff(_) => None,
        }
    }
}

/// Wraps a history; `Err` if it was read only in part.
const fn of_history(reading: &HistoryReader, history: History) -> Result<Answer, Answer> {
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

const fn of_monitoring(ended: EndResult) -> Result<Answer, Answer> {
    Ok(Answer::Monitoring(ended))
}

/// Decodes a statusword; `None` unless it has two bytes.
fn statusword(content: &Content) -> Option<Answer> {
    let raw = content.exactly(2)?.try_into().ok()?;
    Some(Answer::Statusword(Statusword(u16::from_le_bytes(raw))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::master::disturbance::MAX_REPEATS;

    fn node() -> NodeId {
        NodeId::new(3).unwrap()
    }

    #[test]
    fn statusword_of_the_wrong_size_is_invalid() {
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
    fn power_off_takes_one_frame() {
        let mut out = Vec::new();
        let inquiry = Inquiry::power_off(node(), Instant::ZERO, &mut out).unwrap();
        assert_eq!(out, [Frame::new(0x603, [0x2B, 0x40, 0x60, 0, 0, 0, 0, 0])]);
        assert!(inquiry.deadline().is_some());
    }

    #[test]
    fn confirmed_power_off_is_followed_by_a_read_of_the_statusword() {
        let mut out = Vec::new();
        let mut inquiry = Inquiry::power_off(node(), Instant::ZERO, &mut out).unwrap();
        let confirmed = Frame::new(0x583, [0x60, 0x40, 0x60, 0, 0, 0, 0, 0]);
        assert_eq!(inquiry.on_frame(Instant::ZERO, &confirmed, &mut out), None);
        assert_eq!(out.last(), Some(&Frame::new(0x603, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0])));
        assert!(inquiry.is_urgent());
        let read = Frame::new(0x583, [0x4B, 0x41, 0x60, 0, 0x37, 0x12, 0, 0]);
        let answer = inquiry.on_frame(Instant::ZERO, &read, &mut out);
        assert_eq!(answer, Some(Answer::Statusword(Statusword(0x1237))));
    }

    #[test]
    fn inquiry_disturbed_by_another_client_is_repeated() {
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

    const READ: [u8; 8] = [0x40, 0x41, 0x60, 0, 0, 0, 0, 0];
    const OFF: [u8; 8] = [0x2B, 0x40, 0x60, 0, 0, 0, 0, 0];

    /// Sent requests, without aborts.
    fn requests(out: &[Frame]) -> Vec<Frame> {
        out.iter().filter(|frame| frame.data().first() != Some(&0x80)).copied().collect()
    }

    /// Lets all replies be late; returns the answer, and how many of them there were.
    fn unanswered(inquiry: &mut Inquiry, out: &mut Vec<Frame>) -> (Answer, u32) {
        for timeouts in 1.. {
            let due = inquiry.deadline().unwrap();
            assert_eq!(inquiry.on_time(before(due), out), None, "before the deadline");
            if let Some(answer) = inquiry.on_time(due, out) {
                return (answer, timeouts);
            }
        }
        unreachable!()
    }

    fn before(due: Instant) -> Instant {
        Instant::from_micros(due.as_micros() - 1)
    }

    #[test]
    fn unanswered_upload_is_requested_once_more() {
        let mut out = Vec::new();
        let mut read = Inquiry::statusword(node(), Instant::ZERO, &mut out).urgent();
        assert_eq!(unanswered(&mut read, &mut out), (Answer::Nothing, 2));
        assert_eq!(requests(&out), [Frame::new(0x603, READ); 2]);
        assert!(read.is_urgent());
        let mut out = Vec::new();
        let mut history = Inquiry::history(node(), Instant::ZERO, &mut out);
        let (answer, timeouts) = unanswered(&mut history, &mut out);
        assert_eq!((answer, timeouts), (Answer::History(History::default()), 2));
        assert_eq!(requests(&out), [Frame::new(0x603, [0x40, 0x03, 0x10, 0, 0, 0, 0, 0]); 2]);
    }

    #[test]
    fn unanswered_power_off_is_not_repeated() {
        let mut out = Vec::new();
        let mut inquiry = Inquiry::power_off(node(), Instant::ZERO, &mut out).unwrap();
        assert_eq!(unanswered(&mut inquiry, &mut out), (Answer::Nothing, 1));
        assert_eq!(requests(&out), [Frame::new(0x603, OFF)]);
    }

    #[test]
    fn disturbed_power_off_is_written_again_and_stays_urgent() {
        let mut out = Vec::new();
        let abort = Frame::new(0x583, [0x80, 0x40, 0x60, 0, 0, 0, 4, 5]);
        let mut inquiry = Inquiry::power_off(node(), Instant::ZERO, &mut out).unwrap();
        for _ in 0..MAX_REPEATS {
            inquiry.disturb();
            assert_eq!(inquiry.on_frame(Instant::ZERO, &abort, &mut out), None);
            assert!(inquiry.is_urgent());
        }
        assert_eq!(out, [Frame::new(0x603, OFF); 4]);
        inquiry.disturb();
        let answer = inquiry.on_frame(Instant::ZERO, &abort, &mut out);
        assert_eq!((answer, out.len()), (Some(Answer::Nothing), 4));
    }

    #[test]
    fn disturbance_counts_for_one_repetition() {
        let mut out = Vec::new();
        let abort = Frame::new(0x583, [0x80, 0x41, 0x60, 0, 0, 0, 4, 5]);
        let mut inquiry = Inquiry::statusword(node(), Instant::ZERO, &mut out);
        inquiry.disturb();
        assert_eq!(inquiry.on_frame(Instant::ZERO, &abort, &mut out), None);
        let answer = inquiry.on_frame(Instant::ZERO, &abort, &mut out);
        assert_eq!((answer, out.len()), (Some(Answer::Nothing), 2), "undisturbed since");
    }

    #[test]
    fn disturbed_inquiry_that_succeeds_is_not_repeated() {
        let mut out = Vec::new();
        let mut inquiry = Inquiry::statusword(node(), Instant::ZERO, &mut out);
        inquiry.disturb();
        let reply = Frame::new(0x583, [0x4B, 0x41, 0x60, 0, 0x37, 0x12, 0, 0]);
        let answer = inquiry.on_frame(Instant::ZERO, &reply, &mut out);
        assert_eq!(answer, Some(Answer::Statusword(Statusword(0x1237))));
        assert_eq!(out.len(), 1);
    }

    #[test]
    fn repetition_after_a_disturbance_is_not_read_again_twice() {
        // Unanswered, disturbed and refused, unanswered: a lost reply is forgiven once in all.
        let mut out = Vec::new();
        let abort = Frame::new(0x583, [0x80, 0x41, 0x60, 0, 0, 0, 4, 5]);
        let mut inquiry = Inquiry::statusword(node(), Instant::ZERO, &mut out);
        let due = inquiry.deadline().unwrap();
        assert_eq!(inquiry.on_time(due, &mut out), None);
        inquiry.disturb();
        assert_eq!(inquiry.on_frame(due, &abort, &mut out), None);
        assert_eq!(unanswered(&mut inquiry, &mut out), (Answer::Nothing, 1));
        assert_eq!(requests(&out), [Frame::new(0x603, READ); 3]);
    }
}
