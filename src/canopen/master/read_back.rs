//! One object of a running node, read again and compared with what its boot has proven.
//!
//! One request and one reply, expedited in four bytes, so that nothing is allocated in a cycle. Which
//! object, and when, is decided by the owner of the [master](crate::master).

use std::fmt;
use std::time::Duration;

use canopen_rs::NodeId;
use canopen_rs::sdo::request_cob_id;
use canopen_rs::sdo::response_cob_id;

use crate::abort::AbortCode;
use crate::frame::Frame;
use crate::master::check::Check;
use crate::object::Object;
use crate::sdo::SdoError;
use crate::sdo::bytes;
use units::time::Instant;

/// Time for the reply.
const REPLY_TIMEOUT: Duration = Duration::from_millis(500);

/// Times that a request which another client disturbed is sent again.
const MAX_REPEATS: u8 = 3;

/// A value of at most four bytes that an object must hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Which object.
    pub object: Object,
    /// What it must hold.
    pub value: u32,
    /// The bits that must be equal.
    mask: u32,
    /// Number of bytes, 1 to 4.
    size: u8,
}

impl Setting {
    /// The same as `check`; `None` for a value that is longer or empty.
    pub fn of(check: &Check) -> Option<Self> {
        let expected = bytes(&check.expected);
        let size = u8::try_from(expected.len()).ok().filter(|size| (1..=4).contains(size))?;
        let mut four = [0; 4];
        four.iter_mut().zip(&expected).for_each(|(to, from)| *to = *from);
        let [a, b, c, d, ..] = check.mask.to_le_bytes();
        let mask = u32::from_le_bytes([a, b, c, d]) & (u32::MAX >> (32 - 8 * u32::from(size)));
        Some(Self { object: check.object, value: u32::from_le_bytes(four), mask, size })
    }

    /// Compares what an expedited reply holds; `size` is absent where the reply does not declare it.
    fn compare(&self, found: u32, size: Option<u8>) -> ReadBack {
        let is_sized = size.is_none_or(|size| size == self.size);
        if is_sized && (found ^ self.value) & self.mask == 0 {
            ReadBack::Unchanged
        } else {
            ReadBack::Changed { expected: self.value, found }
        }
    }
}

/// What came of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadBack {
    /// The object holds what was proven.
    Unchanged,
    /// It holds another value.
    Changed {
        /// The proven value.
        expected: u32,
        /// Its value now.
        found: u32,
    },
    /// It could not be read: nothing is known.
    Unread(SdoError),
}

/// As in "1400h:5 is 0h, was proven as 5h".
impl fmt::Display for ReadBack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unchanged => f.write_str("is as proven"),
            Self::Changed { expected, found } => {
                write!(f, "is {found:X}h, was proven as {expected:X}h")
            }
            Self::Unread(error) => write!(f, "cannot be read again: {error}"),
        }
    }
}

/// A request under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    node: NodeId,
    setting: Setting,
    until: Instant,
    is_disturbed: bool,
    repeats: u8,
}

impl Reading {
    /// Asks `node` for the object of `setting`.
    pub(super) fn begin(
        node: NodeId,
        setting: Setting,
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Self {
        let until = now + REPLY_TIMEOUT;
        let reading = Self { node, setting, until, is_disturbed: false, repeats: 0 };
        out.push(reading.request(UPLOAD, [0; 4]));
        reading
    }

    /// The object it reads.
    pub(super) const fn object(&self) -> Object {
        self.setting.object
    }

    /// Another client has sent a request to the same server.
    pub(super) const fn disturb(&mut self) {
        self.is_disturbed = true;
    }

    /// Takes one received frame; the outcome comes once.
    pub(super) fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<ReadBack> {
        if frame.cob_id != response_cob_id(self.node) {
            return None;
        }
        let &[command, low, high, sub, a, b, c, d] = frame.data() else { return None };
        if (Object { index: u16::from_le_bytes([low, high]), sub }) != self.setting.object {
            return None;
        }
        let four = u32::from_le_bytes([a, b, c, d]);
        match command >> 5 {
            SCS_UPLOAD if command & EXPEDITED != 0 => {
                let size = (command & SIZE_INDICATED != 0).then(|| 4 - (command >> 2 & 3));
                let unused = 8 * u32::from(size.map_or(0, |size| 4 - size));
                Some(self.setting.compare(four & (u32::MAX >> unused), size))
            }
            // Four bytes in segments: the server may, and nobody does.
            SCS_UPLOAD => {
                let code = AbortCode::GENERAL_ERROR;
                out.push(self.request(ABORT, code.0.to_le_bytes()));
                Some(ReadBack::Unread(SdoError::BrokenOff(code)))
            }
            CS_ABORT => self.fail(now, SdoError::Refused(AbortCode(four)), out),
            _ => None,
        }
    }

    /// Ends the wait for a reply whose time is over.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<ReadBack> {
        if now < self.until {
            return None;
        }
        out.push(self.request(ABORT, AbortCode::TIMED_OUT.0.to_le_bytes()));
        self.fail(now, SdoError::Silent, out)
    }

    /// When [`on_time`](Self::on_time) must next be called.
    pub(super) const fn deadline(&self) -> Instant {
        self.until
    }

    /// Ends, or asks again where another client may be the reason.
    fn fail(&mut self, now: Instant, error: SdoError, out: &mut Vec<Frame>) -> Option<ReadBack> {
        if !self.is_disturbed || self.repeats >= MAX_REPEATS {
            return Some(ReadBack::Unread(error));
        }
        let again = Self::begin(self.node, self.setting, now, out);
        *self = Self { repeats: self.repeats + 1, ..again };
        None
    }

    fn request(&self, command: u8, [a, b, c, d]: [u8; 4]) -> Frame {
        let Object { index, sub } = self.setting.object;
        let [low, high] = index.to_le_bytes();
        Frame::new(request_cob_id(self.node), [command, low, high, sub, a, b, c, d])
    }
}

/// The whole first byte of the requests it sends (CiA 301, 7.2.4.3).
const UPLOAD: u8 = 0x40;
const ABORT: u8 = 0x80;
/// The three highest bits of a reply.
const SCS_UPLOAD: u8 = 2;
const CS_ABORT: u8 = 4;
/// Of the reply that opens an upload: the value is in it, and bits 2 and 3 say how many bytes are not.
const EXPEDITED: u8 = 1 << 1;
const SIZE_INDICATED: u8 = 1;

#[cfg(test)]
mod tests {
    use canopen_rs::Value;
    use proptest::prelude::*;

    use super::*;

    const NOW: Instant = Instant::ZERO;

    fn node() -> NodeId {
        NodeId::new(3).unwrap()
    }

    fn timer() -> Setting {
        let object = Object::rpdo_communication(1, 5);
        Setting::of(&Check::exactly(object, Value::Unsigned16(5))).unwrap()
    }

    fn begun() -> (Reading, Vec<Frame>) {
        let mut out = Vec::new();
        let reading = Reading::begin(node(), timer(), NOW, &mut out);
        assert_eq!(out, [Frame::new(0x603, [0x40, 0x00, 0x14, 5, 0, 0, 0, 0])]);
        (reading, out)
    }

    fn outcome(reply: [u8; 8]) -> Option<ReadBack> {
        let (mut reading, mut out) = begun();
        reading.on_frame(NOW, &Frame::new(0x583, reply), &mut out)
    }

    #[test]
    fn a_setting_that_was_changed_is_reported_with_both_values() {
        let changed = |found| Some(ReadBack::Changed { expected: 5, found });
        for (reply, expected) in [
            ([0x4B, 0x00, 0x14, 5, 5, 0, 0, 0], Some(ReadBack::Unchanged)),
            ([0x4B, 0x00, 0x14, 5, 5, 0, 9, 9], Some(ReadBack::Unchanged)),
            ([0x42, 0x00, 0x14, 5, 5, 0, 9, 9], Some(ReadBack::Unchanged)),
            ([0x4B, 0x00, 0x14, 5, 0, 0, 0, 0], changed(0)),
            ([0x43, 0x00, 0x14, 5, 5, 0, 0, 0], changed(5)),
            ([0x4B, 0x00, 0x14, 2, 0, 0, 0, 0], None),
            ([0x60, 0x00, 0x14, 5, 0, 0, 0, 0], None),
        ] {
            assert_eq!(outcome(reply), expected, "{reply:02X?}");
        }
        assert_eq!(changed(0).unwrap().to_string(), "is 0h, was proven as 5h");
    }

    #[test]
    fn a_refused_or_silent_read_back_is_never_unchanged() {
        let refused = outcome([0x80, 0x00, 0x14, 5, 0, 0, 1, 6]);
        assert!(matches!(refused, Some(ReadBack::Unread(SdoError::Refused(_)))), "{refused:?}");
        let segmented = outcome([0x41, 0x00, 0x14, 5, 2, 0, 0, 0]);
        assert!(matches!(segmented, Some(ReadBack::Unread(SdoError::BrokenOff(_)))));
        let (mut reading, mut out) = begun();
        assert_eq!(reading.on_time(NOW + REPLY_TIMEOUT / 2, &mut out), None);
        let silent = reading.on_time(NOW + REPLY_TIMEOUT, &mut out);
        assert_eq!(silent, Some(ReadBack::Unread(SdoError::Silent)));
        assert_eq!(out.len(), 2, "the request and its abort");
    }

    #[test]
    fn a_read_back_that_another_client_breaks_begins_again() {
        let (mut reading, mut out) = begun();
        let abort = Frame::new(0x583, [0x80, 0x00, 0x14, 5, 0, 0, 4, 5]);
        reading.disturb();
        assert_eq!(reading.on_frame(NOW, &abort, &mut out), None);
        assert_eq!(out.len(), 2);
        assert!(reading.on_frame(NOW, &abort, &mut out).is_some(), "undisturbed, it counts");
    }

    #[test]
    fn only_the_bits_that_count_are_compared() {
        let cob_id = Check::cob_id(Object::tpdo_communication(1, 1), Value::Unsigned32(0x183));
        let setting = Setting::of(&cob_id).unwrap();
        assert_eq!(setting.compare(0x4000_0183, Some(4)), ReadBack::Unchanged);
        assert_ne!(setting.compare(0x8000_0183, Some(4)), ReadBack::Unchanged);
        let signed = Check::exactly(Object::FAULT_REACTION, Value::Integer16(-2));
        let setting = Setting::of(&signed).unwrap();
        assert_eq!(setting.compare(0xFFFE, Some(2)), ReadBack::Unchanged);
        let long = Check::exactly(Object::STORED_EDS, Value::Unsigned64(1));
        assert_eq!(Setting::of(&long), None);
    }

    proptest! {
        #[test]
        fn only_the_proven_value_is_unchanged(data: [u8; 8]) {
            let [command, about @ ..] = data;
            // Bit 4 is reserved; without a declared size bits 2 and 3 mean nothing.
            let is_two_bytes = command & 0xEF == 0x4B || command & 0xE3 == 0x42;
            let is_proven = is_two_bytes && about[..5] == [0x00, 0x14, 5, 5, 0];
            prop_assert_eq!(outcome(data) == Some(ReadBack::Unchanged), is_proven);
        }
    }
}
