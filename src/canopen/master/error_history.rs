//! Error history of a node (1003h, CiA 301, 7.5.2.4), read by SDO: the count, then the newest errors.
//!
//! One request at a time; the [master](crate::master) decides when its frames are sent. A node without a
//! history reads as an empty one.

use std::fmt;

use canopen_rs::NodeId;

use crate::error_codes;
use crate::frame::Frame;
use crate::object::Object;
use crate::plan::REPLY_TIMEOUT;
use crate::sdo::{Outcome, Transfer};
use units::time::Instant;

/// Maximum number of errors read, the newest first.
pub const MAX_ERRORS: usize = 8;

/// Error history of a node, the newest error first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct History {
    entries: [u32; MAX_ERRORS],
    count: usize,
}

impl History {
    /// Error codes, the newest first.
    pub fn codes(&self) -> impl Iterator<Item = u16> + '_ {
        self.entries.iter().take(self.count).map(|entry| {
            let [low, high, ..] = entry.to_le_bytes();
            u16::from_le_bytes([low, high])
        })
    }
}

/// `8250h RPDO timeout, 2310h continuous over-current at the output`, or `empty`
impl fmt::Display for History {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.count == 0 {
            return f.write_str("empty");
        }
        for (place, code) in self.codes().enumerate() {
            let separator = if place == 0 { "" } else { ", " };
            write!(f, "{separator}{code:04X}h {}", error_codes::description(code))?;
        }
        Ok(())
    }
}

/// Reader of one node's history.
#[derive(Clone, Debug)]
pub struct HistoryReader {
    node: NodeId,
    history: History,
    /// Current sub-index; 0 is the count.
    sub: u8,
    /// Last sub-index to read.
    last: u8,
    transfer: Transfer,
    has_failed: bool,
}

impl HistoryReader {
    /// Requests the count.
    pub fn new(node: NodeId, now: Instant, out: &mut Vec<Frame>) -> Self {
        let transfer = Transfer::read(node, Object::ERROR_HISTORY, REPLY_TIMEOUT, now, out);
        let history = History::default();
        Self { node, history, sub: 0, last: 0, transfer, has_failed: false }
    }

    /// Takes one received frame. Returns the history once.
    pub fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<History> {
        let outcome = self.transfer.on_frame(now, frame, out)?;
        self.on_outcome(now, outcome, out)
    }

    /// Ends the wait for an overdue reply. Returns the errors read so far.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<History> {
        let outcome = self.transfer.on_time(now, out)?;
        self.on_outcome(now, outcome, out)
    }

    /// Time of the next call of [`on_time`](Self::on_time); `None` after the history.
    pub const fn deadline(&self) -> Option<Instant> {
        self.transfer.deadline()
    }

    /// Returns whether a transfer has failed, so that the history may lack entries.
    pub const fn has_failed(&self) -> bool {
        self.has_failed
    }

    fn on_outcome(
        &mut self,
        now: Instant,
        outcome: Outcome,
        out: &mut Vec<Frame>,
    ) -> Option<History> {
        let Ok(content) = outcome else {
            self.has_failed = true;
            return Some(self.history);
        };
        if self.sub == 0 {
            let count = content.exactly(1).and_then(|count| count.first().copied()).unwrap_or(0);
            self.last = count.min(u8::try_from(MAX_ERRORS).unwrap_or(u8::MAX));
        } else {
            let entry = content.exactly(4).and_then(|entry| <[u8; 4]>::try_from(entry).ok());
            let place = self.history.entries.get_mut(self.history.count);
            let (Some(place), Some(entry)) = (place, entry) else { return Some(self.history) };
            *place = u32::from_le_bytes(entry);
            self.history.count += 1;
        }
        if self.sub == self.last {
            return Some(self.history);
        }
        self.sub += 1;
        let object = Object { sub: self.sub, ..Object::ERROR_HISTORY };
        self.transfer = Transfer::read(self.node, object, REPLY_TIMEOUT, now, out);
        None
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;
    use crate::testing::plans::elbow;
    use crate::testing::scripted::ScriptedDevice;

    /// Reads a device's history. Returns it with the number of frames sent.
    fn read(device: &mut ScriptedDevice) -> (History, usize) {
        let (mut out, mut sent) = (Vec::new(), 0);
        let mut reading = HistoryReader::new(device.node, Instant::ZERO, &mut out);
        loop {
            assert!(out.len() <= 1, "one request at a time");
            let Some(request) = out.pop() else {
                let now = reading.deadline().expect("a reading without a history waits");
                if let Some(history) = reading.on_time(now, &mut out) {
                    return (history, sent);
                }
                continue;
            };
            sent += 1;
            let answer = device.answer(&request);
            let history = answer.and_then(|a| reading.on_frame(Instant::ZERO, &a, &mut out));
            if let Some(history) = history {
                assert_eq!(reading.deadline(), None);
                return (history, sent);
            }
        }
    }

    fn with_errors(codes: &[u32]) -> ScriptedDevice {
        let mut device = ScriptedDevice::suiting(&elbow());
        let count = u8::try_from(codes.len()).unwrap();
        device.objects.insert(Object::ERROR_HISTORY, vec![count]);
        for (sub, code) in (1..).zip(codes) {
            let object = Object { sub, ..Object::ERROR_HISTORY };
            device.objects.insert(object, code.to_le_bytes().to_vec());
        }
        device
    }

    #[test]
    fn newest_errors_are_read_and_named() {
        let (history, sent) = read(&mut with_errors(&[0xABCD_8250, 0x2310]));
        assert_eq!(history.codes().collect::<Vec<_>>(), [0x8250, 0x2310]);
        let expected = "8250h RPDO timeout, 2310h continuous over-current at the output";
        assert_eq!((history.to_string().as_str(), sent), (expected, 3));
    }

    #[test]
    fn at_most_eight_errors_are_read() {
        let (history, sent) = read(&mut with_errors(&[0x1000; 20]));
        assert_eq!((history.codes().count(), sent), (8, 9));
    }

    #[test]
    fn absent_history_reads_as_empty() {
        let mut device = ScriptedDevice::suiting(&elbow());
        assert_eq!(read(&mut device).0.to_string(), "empty");
        let mut device = ScriptedDevice { deaf_for: u32::MAX, ..with_errors(&[1]) };
        assert_eq!(read(&mut device).0.to_string(), "empty");
        assert_eq!(read(&mut with_errors(&[])).0.to_string(), "empty");
    }

    proptest! {
        #[test]
        fn any_replies_yield_the_history_once(
            replies in proptest::collection::vec((any::<[u8; 8]>(), 0_u8..10, 0_u64..700), 0..60),
        ) {
            let (mut out, mut now, mut histories) = (Vec::new(), Instant::ZERO, 0);
            let mut reading = HistoryReader::new(NodeId::new(3).unwrap(), now, &mut out);
            for (mut payload, sub, step) in replies {
                now = now + Duration::from_millis(step);
                [payload[1], payload[2], payload[3]] = [0x03, 0x10, sub];
                histories += u32::from(reading.on_time(now, &mut out).is_some());
                let reply = Frame::new(0x583, payload);
                histories += u32::from(reading.on_frame(now, &reply, &mut out).is_some());
            }
            if let Some(due) = reading.deadline() {
                histories += u32::from(reading.on_time(due, &mut out).is_some());
            }
            prop_assert_eq!(histories, 1);
        }
    }
}
