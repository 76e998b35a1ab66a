//! Read-back of one object of a running node: compares it with the value its boot has verified, or returns it.
//!
//! One request and one expedited reply of at most four bytes, so that a cycle allocates nothing. The owner
//! of the [master](crate::master) chooses object and time.

use canopen_rs::NodeId;
use canopen_rs::sdo::{request_cob_id, response_cob_id};
use derive_more::Display;

use crate::abort::AbortCode;
use crate::frame::Frame;
use crate::master::check::Check;
use crate::master::disturbance::Disturbance;
use crate::nameplate::StoredValue;
use crate::object::Object;
use crate::plan::REPLY_TIMEOUT;
use crate::sdo::command::{ABORT, CCS_UPLOAD, CS_ABORT, EXPEDITED, SCS_UPLOAD, SIZE_INDICATED};
use crate::sdo::{SdoError, bytes};
use units::time::Instant;

/// Expected value of an object, of at most four bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjectRead {
    /// Object to read.
    pub object: Object,
    /// Expected value.
    pub value: u32,
    /// Bits that are compared.
    mask: u32,
    /// Number of bytes, 1 to 4.
    size: u8,
    /// Set if the value is compared, not returned.
    is_compared: bool,
}

impl ObjectRead {
    /// Converts a check; `None` for a value that is longer or empty.
    pub fn from_check(check: &Check) -> Option<Self> {
        let expected = bytes(&check.expected);
        let size = u8::try_from(expected.len()).ok().filter(|size| (1..=4).contains(size))?;
        let mut four = [0; 4];
        four.iter_mut().zip(&expected).for_each(|(to, from)| *to = *from);
        let [a, b, c, d, ..] = check.mask.to_le_bytes();
        let mask = u32::from_le_bytes([a, b, c, d]) & (u32::MAX >> (32 - 8 * u32::from(size)));
        let value = u32::from_le_bytes(four);
        Some(Self { object: check.object, value, mask, size, is_compared: true })
    }

    /// Returns a value that a drive holds, to be found again.
    pub const fn held(held: &StoredValue) -> Self {
        let StoredValue { object, value, size } = *held;
        Self { object, value, mask: u32::MAX, size, is_compared: true }
    }

    /// Returns an object of `size` bytes, 1 to 4, whose value is not known before.
    pub const fn unknown(object: Object, size: u8) -> Self {
        Self { object, value: 0, mask: 0, size, is_compared: false }
    }

    /// Compares the value of an expedited reply; `size` is absent if the reply does not indicate it.
    fn compare(&self, found: u32, size: Option<u8>) -> ReadBack {
        if !self.is_compared {
            return ReadBack::Value(found);
        }
        let is_sized = size.is_none_or(|size| size == self.size);
        if is_sized && (found ^ self.value) & self.mask == 0 {
            ReadBack::Unchanged
        } else {
            ReadBack::Changed { expected: self.value, found }
        }
    }
}

/// Outcome of a read-back.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum ReadBack {
    /// Value as verified by the boot.
    #[display("is as proven")]
    Unchanged,
    /// Value other than the verified one.
    #[display("is {found:X}h, was {expected:X}h at boot")]
    Changed {
        /// Verified value.
        expected: u32,
        /// Value now.
        found: u32,
    },
    /// Value of an object without an expected value.
    #[display("is {_0:X}h")]
    Value(u32),
    /// Failed read: the value is unknown.
    #[display("cannot be read again: {_0}")]
    Unread(SdoError),
}

/// Read-back in progress.
#[derive(Clone, Copy, Debug)]
pub(super) struct ObjectReader {
    node: NodeId,
    setting: ObjectRead,
    until: Instant,
    disturbance: Disturbance,
    /// Set if the object was requested again after no answer.
    is_read_again: bool,
}

impl ObjectReader {
    /// Requests the object of `setting` from `node`.
    pub(super) fn start(
        node: NodeId,
        setting: ObjectRead,
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Self {
        let disturbance = Disturbance::default();
        let mut reading = Self { node, setting, until: now, disturbance, is_read_again: false };
        reading.send(now, out);
        reading
    }

    fn send(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.until = now + REPLY_TIMEOUT;
        out.push(self.request(UPLOAD, [0; 4]));
    }

    /// Object being read.
    pub(super) const fn object(&self) -> Object {
        self.setting.object
    }

    /// Marks the request as disturbed: another client has sent a request to the same server.
    pub(super) const fn disturb(&mut self) {
        self.disturbance.note();
    }

    /// Takes one received frame. Returns the outcome once.
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
            // A server may send four bytes in segments; none does.
            SCS_UPLOAD => {
                let code = AbortCode::GENERAL_ERROR;
                out.push(self.request(ABORT, code.0.to_le_bytes()));
                Some(ReadBack::Unread(SdoError::AbortedLocally(code)))
            }
            CS_ABORT => self.fail(now, SdoError::AbortedByServer(AbortCode(four)), out),
            _ => None,
        }
    }

    /// Aborts a request whose reply is overdue, and repeats it once.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<ReadBack> {
        if now < self.until {
            return None;
        }
        out.push(self.request(ABORT, AbortCode::TIMED_OUT.0.to_le_bytes()));
        if !std::mem::replace(&mut self.is_read_again, true) {
            self.disturbance.forget();
            self.send(now, out);
            return None;
        }
        self.fail(now, SdoError::Timeout, out)
    }

    /// Time of the next call of [`on_time`](Self::on_time).
    pub(super) const fn deadline(&self) -> Instant {
        self.until
    }

    /// Ends, or repeats a request that another client disturbed.
    fn fail(&mut self, now: Instant, error: SdoError, out: &mut Vec<Frame>) -> Option<ReadBack> {
        if !self.disturbance.take() {
            return Some(ReadBack::Unread(error));
        }
        self.send(now, out);
        None
    }

    fn request(&self, command: u8, [a, b, c, d]: [u8; 4]) -> Frame {
        let Object { index, sub } = self.setting.object;
        let [low, high] = index.to_le_bytes();
        Frame::new(request_cob_id(self.node), [command, low, high, sub, a, b, c, d])
    }
}

/// First byte of the request.
const UPLOAD: u8 = CCS_UPLOAD << 5;

#[cfg(test)]
mod tests {
    use canopen_rs::Value;
    use proptest::prelude::*;

    use super::*;

    const NOW: Instant = Instant::ZERO;

    fn node() -> NodeId {
        NodeId::new(3).unwrap()
    }

    fn timer() -> ObjectRead {
        let object = Object::rpdo_communication(1, 5);
        ObjectRead::from_check(&Check::exactly(object, Value::Unsigned16(5))).unwrap()
    }

    fn started() -> (ObjectReader, Vec<Frame>) {
        let mut out = Vec::new();
        let reading = ObjectReader::start(node(), timer(), NOW, &mut out);
        assert_eq!(out, [Frame::new(0x603, [0x40, 0x00, 0x14, 5, 0, 0, 0, 0])]);
        (reading, out)
    }

    fn outcome(reply: [u8; 8]) -> Option<ReadBack> {
        let (mut reading, mut out) = started();
        reading.on_frame(NOW, &Frame::new(0x583, reply), &mut out)
    }

    #[test]
    fn changed_value_is_reported_with_the_verified_one() {
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
        assert_eq!(changed(0).unwrap().to_string(), "is 0h, was 5h at boot");
    }

    #[test]
    fn aborted_or_timed_out_read_back_is_unread() {
        let refused = outcome([0x80, 0x00, 0x14, 5, 0, 0, 1, 6]);
        assert!(
            matches!(refused, Some(ReadBack::Unread(SdoError::AbortedByServer(_)))),
            "{refused:?}"
        );
        let segmented = outcome([0x41, 0x00, 0x14, 5, 2, 0, 0, 0]);
        assert!(matches!(segmented, Some(ReadBack::Unread(SdoError::AbortedLocally(_)))));
        let (mut reading, mut out) = started();
        assert_eq!(reading.on_time(NOW + REPLY_TIMEOUT / 2, &mut out), None);
        assert_eq!(reading.on_time(NOW + REPLY_TIMEOUT, &mut out), None, "asked again");
        let silent = reading.on_time(NOW + REPLY_TIMEOUT * 2, &mut out);
        assert_eq!(silent, Some(ReadBack::Unread(SdoError::Timeout)));
        assert_eq!(out.len(), 4, "two requests and their aborts");
    }

    #[test]
    fn read_back_disturbed_by_another_client_is_repeated() {
        let (mut reading, mut out) = started();
        let abort = Frame::new(0x583, [0x80, 0x00, 0x14, 5, 0, 0, 4, 5]);
        reading.disturb();
        assert_eq!(reading.on_frame(NOW, &abort, &mut out), None);
        assert_eq!(out.len(), 2);
        assert!(reading.on_frame(NOW, &abort, &mut out).is_some(), "undisturbed, it counts");
    }

    #[test]
    fn only_masked_bits_are_compared() {
        let cob_id = Check::cob_id(Object::tpdo_communication(1, 1), Value::Unsigned32(0x183));
        let setting = ObjectRead::from_check(&cob_id).unwrap();
        assert_eq!(setting.compare(0x4000_0183, Some(4)), ReadBack::Unchanged);
        assert_ne!(setting.compare(0x8000_0183, Some(4)), ReadBack::Unchanged);
        let signed = Check::exactly(Object::FAULT_REACTION, Value::Integer16(-2));
        let setting = ObjectRead::from_check(&signed).unwrap();
        assert_eq!(setting.compare(0xFFFE, Some(2)), ReadBack::Unchanged);
        let long = Check::exactly(Object::STORED_EDS, Value::Unsigned64(1));
        assert_eq!(ObjectRead::from_check(&long), None);
    }

    proptest! {
        #[test]
        fn only_the_verified_value_is_unchanged(data: [u8; 8]) {
            let [command, about @ ..] = data;
            // Bit 4 is reserved. Without an indicated size, bits 2 and 3 are meaningless.
            let is_two_bytes = command & 0xEF == 0x4B || command & 0xE3 == 0x42;
            let is_proven = is_two_bytes && about[..5] == [0x00, 0x14, 5, 5, 0];
            prop_assert_eq!(outcome(data) == Some(ReadBack::Unchanged), is_proven);
        }
    }
}
