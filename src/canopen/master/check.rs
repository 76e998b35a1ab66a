//! What an object must hold, and how that and what it holds instead are shown to people.
//!
//! A comparison and its words; who reads the object is the [boot](crate::master::commission)'s business.

use std::fmt;

use canopen_rs::Value;

use crate::object::Object;
use crate::sdo::Content;
use crate::sdo::bytes;

/// What an object must hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// Which object.
    pub object: Object,
    /// What it must hold; what is written, too.
    pub expected: Value,
    /// The bits that must be equal.
    pub mask: u64,
    /// Whether what is not in the mask must be at least as large, rather than anything.
    pub or_later: bool,
}

impl Check {
    /// Every bit is compared.
    pub const fn exactly(object: Object, expected: Value) -> Self {
        Self { object, expected, mask: u64::MAX, or_later: false }
    }

    /// A COB-ID: bit 31 while it is off, else everything but bit 30, by which a device says whether
    /// it answers remote frames.
    pub const fn cob_id(object: Object, expected: Value) -> Self {
        let is_off = matches!(expected, Value::Unsigned32(raw) if raw & COB_ID_INVALID != 0);
        let mask = if is_off { 1 << 31 } else { !(1 << 30) };
        Self { object, expected, mask, or_later: false }
    }

    /// A revision number (1018h:3) of the same major revision, its high word, and the same minor one
    /// or a later.
    pub const fn revision_from(object: Object, revision: u32) -> Self {
        let expected = Value::Unsigned32(revision);
        Self { object, expected, mask: 0xFFFF_0000, or_later: true }
    }

    /// Whether `content` is of the right size and every compared bit is as expected.
    pub fn accepts(&self, content: &Content) -> bool {
        let expected = bytes(&self.expected);
        content.exactly(expected.len()).is_some_and(|found| {
            let masks = self.mask.to_le_bytes().into_iter().chain(std::iter::repeat(u8::MAX));
            let is_equal =
                found.iter().zip(&expected).zip(masks).all(|((a, b), mask)| (a ^ b) & mask == 0);
            is_equal && (!self.or_later || found.iter().rev().ge(expected.iter().rev()))
        })
    }

    /// The expected value as people read it: `04020010h`, with `x` for what is not compared.
    pub fn wanted(&self) -> Shown {
        let bytes = bytes(&self.expected);
        if self.is_text() {
            return Shown::Text(bytes);
        }
        if self.or_later {
            return Shown::OrLater(bytes);
        }
        Shown::Number { bytes, mask: self.mask }
    }

    /// What was found, as people read it, cut to the expected size where its own is not told.
    pub fn found(&self, content: &Content) -> Shown {
        let size = bytes(&self.expected).len();
        let found = content.exactly(size).unwrap_or(content.bytes()).to_vec();
        if self.is_text() {
            return Shown::Text(found);
        }
        Shown::Number { bytes: found, mask: u64::MAX }
    }

    const fn is_text(&self) -> bool {
        matches!(self.expected, Value::VisibleString(_))
    }
}

/// Bit 31 of a COB-ID: the service is off.
pub const COB_ID_INVALID: u32 = 1 << 31;

/// A value as people read it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Shown {
    /// As CiA 301 writes numbers, the most significant digit first and an `h` at the end; `x` for a
    /// digit that does not count, and the mask where a part of a digit does.
    Number {
        /// Little-endian.
        bytes: Vec<u8>,
        /// The bits that count.
        mask: u64,
    },
    /// A number, little-endian, and those above it of the same major revision.
    OrLater(Vec<u8>),
    /// In quotation marks.
    Text(Vec<u8>),
}

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number { bytes, .. } if bytes.is_empty() => f.write_str("empty"),
            Self::Number { bytes, .. } if bytes.len() > 8 => write!(f, "{} bytes", bytes.len()),
            Self::Number { bytes, mask } => number(f, bytes, *mask),
            Self::OrLater(bytes) => {
                number(f, bytes, u64::MAX)?;
                f.write_str(" or a later minor revision")
            }
            Self::Text(bytes) => write!(f, "{:?}", String::from_utf8_lossy(bytes)),
        }
    }
}

fn number(f: &mut fmt::Formatter<'_>, bytes: &[u8], mask: u64) -> fmt::Result {
    let masks = mask.to_le_bytes();
    let digits = || {
        let bytes = bytes.iter().zip(masks).rev();
        bytes.flat_map(|(byte, mask)| [(byte >> 4, mask >> 4), (byte & 0xF, mask & 0xF)])
    };
    for (digit, counts) in digits() {
        if counts == 0 { f.write_str("x") } else { write!(f, "{digit:X}") }?;
    }
    f.write_str("h")?;
    if digits().all(|(_, counts)| counts == 0 || counts == 0xF) {
        return Ok(());
    }
    f.write_str(" in the bits ")?;
    digits().try_for_each(|(_, counts)| write!(f, "{counts:X}"))?;
    f.write_str("h")
}

#[cfg(test)]
pub(super) mod tests {
    use std::time::Duration;

    use canopen_rs::ByteString;
    use canopen_rs::NodeId;

    use super::*;
    use crate::frame::Frame;
    use crate::sdo::Transfer;
    use units::time::Instant;

    /// What a node's expedited reply with these bytes is read as.
    pub(crate) fn content(object: Object, bytes: &[u8]) -> Content {
        let (node, mut out) = (NodeId::new(3).unwrap(), Vec::new());
        let wait = Duration::from_millis(1);
        let mut read = Transfer::read(node, object, wait, Instant::ZERO, &mut out);
        let [low, high] = object.index.to_le_bytes();
        let unused = 4 - u8::try_from(bytes.len()).unwrap();
        let mut reply = [0x43 | unused << 2, low, high, object.sub, 0, 0, 0, 0];
        reply[4..4 + bytes.len()].copy_from_slice(bytes);
        read.on_frame(Instant::ZERO, &Frame::new(0x583, reply), &mut out).unwrap().unwrap()
    }

    #[test]
    fn what_is_not_compared_reads_as_x() {
        let check =
            Check { mask: 0xFFFF, ..Check::exactly(Object::DEVICE_TYPE, Value::Unsigned32(402)) };
        assert_eq!(check.wanted().to_string(), "xxxx0192h");
        let check = Check { mask: 0x8000_0000, ..check };
        assert_eq!(check.wanted().to_string(), "0xxxxxxxh in the bits 80000000h");
        let mode = Check::exactly(Object::MODE_DISPLAY, Value::Integer8(-1));
        assert_eq!(mode.wanted().to_string(), "FFh");
    }

    #[test]
    fn a_cob_id_may_come_back_with_the_bit_that_forbids_remote_frames() {
        let object = Object::tpdo_communication(1, 1);
        let check = Check::cob_id(object, Value::Unsigned32(0x183));
        for (byte, accepted) in [(0x40, true), (0x00, true), (0x80, false), (0x20, false)] {
            let content = content(object, &[0x83, 0x01, 0, byte]);
            assert_eq!(check.accepts(&content), accepted, "{byte:02X}");
        }
    }

    #[test]
    fn a_later_minor_revision_of_the_same_major_one_is_taken() {
        let check = Check::revision_from(Object::REVISION, 0x0002_0104);
        for (revision, accepted) in [
            (0x0002_0104_u32, true),
            (0x0002_0105, true),
            (0x0002_0200, true),
            (0x0002_0103, false),
            (0x0002_0004, false),
            (0x0003_0104, false),
            (0x0001_FFFF, false),
        ] {
            let content = content(Object::REVISION, &revision.to_le_bytes());
            assert_eq!(check.accepts(&content), accepted, "{revision:08X}");
        }
        assert_eq!(check.wanted().to_string(), "00020104h or a later minor revision");
    }

    #[test]
    fn a_text_is_compared_as_a_whole_and_shown_in_quotation_marks() {
        let version = Value::VisibleString(ByteString::from_bytes(b"1.2").unwrap());
        let check = Check::exactly(Object::SOFTWARE_VERSION, version);
        assert!(check.accepts(&content(Object::SOFTWARE_VERSION, b"1.2")));
        let other = content(Object::SOFTWARE_VERSION, b"1.20");
        assert!(!check.accepts(&other));
        assert_eq!(check.wanted().to_string(), "\"1.2\"");
        assert_eq!(check.found(&other).to_string(), "\"1.20\"");
    }

    #[test]
    fn a_number_of_another_size_is_not_taken_for_the_value() {
        let check = Check::exactly(Object::VENDOR_ID, Value::Unsigned32(0x0F8C));
        let short = content(Object::VENDOR_ID, &[0x8C, 0x0F]);
        assert!(!check.accepts(&short));
        assert_eq!(check.found(&short).to_string(), "0F8Ch");
        assert!(
            !Check::exactly(Object::MODE_DISPLAY, Value::Integer8(10)).accepts(&Content::default())
        );
    }
}
