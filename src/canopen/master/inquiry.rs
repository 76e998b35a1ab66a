//! What a running node is asked or told by SDO, one thing at a time: what it remembers of its errors, the
//! state of its power stage, to take its power off.
//!
//! Which, and when, is decided by the owner of the [master](crate::canopen::master).

use std::time::Duration;

use canopen_rs::NodeId;
use canopen_rs::Value;

use crate::canopen::drive::Controlword;
use crate::canopen::drive::Statusword;
use crate::canopen::frame::Frame;
use crate::canopen::master::error_history::History;
use crate::canopen::master::error_history::Reading;
use crate::canopen::object::Object;
use crate::canopen::sdo::Content;
use crate::canopen::sdo::Transfer;
use crate::canopen::sdo::bytes;
use crate::time::Instant;

/// How long a node has for its answer.
const REPLY: Duration = Duration::from_millis(500);

/// One transfer under way, or several in a row.
#[derive(Clone, Debug)]
pub(super) enum Inquiry {
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
        Self::History(Reading::new(node, now, out))
    }

    /// Asks for the statusword of `node`.
    pub(super) fn statusword(node: NodeId, now: Instant, out: &mut Vec<Frame>) -> Self {
        Self::Statusword(Transfer::read(node, Object::STATUSWORD, REPLY, now, out))
    }

    /// Tells `node` to take its power off; `None` cannot be, as two bytes always fit.
    pub(super) fn power_off(node: NodeId, now: Instant, out: &mut Vec<Frame>) -> Option<Self> {
        let off = bytes(&Value::Unsigned16(Controlword::DISABLE_VOLTAGE.0));
        Transfer::write(node, Object::CONTROLWORD, off, REPLY, now, out).ok().map(Self::PowerOff)
    }

    /// Takes one received frame; the answer comes once.
    pub(super) fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Answer> {
        match self {
            Self::History(reading) => reading.on_frame(now, frame, out).map(Answer::History),
            Self::Statusword(transfer) => {
                let outcome = transfer.on_frame(now, frame, out)?;
                Some(outcome.ok().as_ref().and_then(statusword).unwrap_or(Answer::Nothing))
            }
            Self::PowerOff(transfer) => transfer.on_frame(now, frame, out).map(|_| Answer::Nothing),
        }
    }

    /// Ends the wait for a reply whose time is over.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Answer> {
        match self {
            Self::History(reading) => reading.on_time(now, out).map(Answer::History),
            Self::Statusword(transfer) | Self::PowerOff(transfer) => {
                transfer.on_time(now, out).map(|_| Answer::Nothing)
            }
        }
    }

    /// When [`on_time`](Self::on_time) must next be called; `None` once it is over.
    pub(super) const fn deadline(&self) -> Option<Instant> {
        match self {
            Self::History(reading) => reading.deadline(),
            Self::Statusword(transfer) | Self::PowerOff(transfer) => transfer.deadline(),
        }
    }
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
}
