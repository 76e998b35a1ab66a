//! Expected value of an object, its comparison with the value found, and the text of both.
//!
//! The [boot](crate::master::commission) reads the object.

use std::fmt;

use canopen_rs::Value;

use crate::object::Object;
use crate::sdo::{Content, bytes};

/// Expected value of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// Object to read, and to write where the step writes.
    pub object: Object,
    /// Value to compare; also the value to write.
    pub expected: Value,
    /// Bits that must be equal.
    pub mask: u64,
    /// Set if the value must be at least as large in the bits outside the mask.
    pub or_later: bool,
}

impl Check {
    /// Compares every bit.
    pub const fn exactly(object: Object, expected: Value) -> Self {
        Self { object, expected, mask: u64::MAX, or_later: false }
    }

    /// Compares a COB-ID: only bit 31 if the expected one is invalid, else all bits except bit 30, which reports
    /// support of remote frames.
    pub const fn cob_id(object: Object, expected: Value) -> Self {
        let is_off = matches!(expected, Value::Unsigned32(raw) if raw & COB_ID_INVALID != 0);
        let mask = if is_off { 1 << 31 } else { NOT_NO_RTR };
        Self { object, expected, mask, or_later: false }
    }

    /// Returns the same COB-ID with bit 30 inverted, for a node that accepts no other; `None` for a check of something
    /// else.
    pub const fn with_other_bit_30(&self) -> Option<Self> {
        match (self.expected, self.mask) {
            (Value::Unsigned32(raw), 0x8000_0000 | NOT_NO_RTR) => {
                let expected = Value::Unsigned32(raw ^ COB_ID_NO_RTR);
                Some(Self { object: self.object, expected, mask: self.mask, or_later: false })
            }
            _ => None,
        }
    }

    /// Accepts a revision number (1018h:3) with the same major revision (high word) and the same or a later
    /// minor one.
    pub const fn revision_from(object: Object, revision: u32) -> Self {
        let expected = Value::Unsigned32(revision);
        Self { object, expected, mask: 0xFFFF_0000, or_later: true }
    }

    /// Returns whether `content` has the right size and every compared bit is as expected.
    pub fn accepts(&self, content: &Content) -> bool {
        let expected = bytes(&self.expected);
        content.exactly(expected.len()).is_some_and(|found| {
            let masks = self.mask.to_le_bytes().into_iter().chain(std::iter::repeat(u8::MAX));
            let is_equal =
                found.iter().zip(&expected).zip(masks).all(|((a, b), mask)| (a ^ b) & mask == 0);
            is_equal && (!self.or_later || found.iter().rev().ge(expected.iter().rev()))
        })
    }

    /// Expected value for display: `04020010h`, with `x` for digits that are not compared.
    pub fn expected_value(&self) -> DisplayedValue {
        let bytes = bytes(&self.expected);
        if self.is_text() {
            return DisplayedValue::Text(bytes);
        }
        if self.or_later {
            return DisplayedValue::OrLater(bytes);
        }
        DisplayedValue::Number { bytes, mask: self.mask }
    }

    /// Found value for display, cut to the expected size if the reply does not indicate its size.
    pub fn found_value(&self, content: &Content) -> DisplayedValue {
        let size = bytes(&self.expected).len();
        let found = content.exactly(size).unwrap_or(content.bytes()).to_vec();
        if self.is_text() {
            return DisplayedValue::Text(found);
        }
        DisplayedValue::Number { bytes: found, mask: u64::MAX }
    }

    const fn is_text(&self) -> bool {
        matches!(self.expected, Value::VisibleString(_))
    }
}

/// Bit 31 of a COB-ID: the service is disabled.
pub const COB_ID_INVALID: u32 = 1 << 31;

/// Bit 30 of the COB-ID of a TPDO: no RTR is allowed (CiA 301, 7.5.2.37).
pub const COB_ID_NO_RTR: u32 = 1 << 30;

/// Mask of a COB-ID without bit 30.
const NOT_NO_RTR: u64 = !(1 << 30);

/// Value of an object in the notation of error messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DisplayedValue {
    /// Number in the notation of CiA 301: most significant digit first, suffix `h`. Digits that are not compared are
    /// written `x`; a partly compared digit adds the mask.
    Number {
        /// Little-endian.
        bytes: Vec<u8>,
        /// Bits that are compared.
        mask: u64,
    },
    /// Little-endian number, and later minor revisions of the same major one.
    OrLater(Vec<u8>),
    /// Text in quotation marks.
    Text(Vec<u8>),
}

impl fmt::Display for DisplayedValue {
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

    use canopen_rs::{ByteString, NodeId};

    use super::*;
    use crate::frame::Frame;
    use crate::sdo::Transfer;
    use units::time::Instant;

    /// Content of an expedited reply with these bytes.
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
    fn digits_not_compared_read_as_x() {
        let check =
            Check { mask: 0xFFFF, ..Check::exactly(Object::DEVICE_TYPE, Value::Unsigned32(402)) };
        assert_eq!(check.expected_value().to_string(), "xxxx0192h");
        let check = Check { mask: 0x8000_0000, ..check };
        assert_eq!(check.expected_value().to_string(), "0xxxxxxxh in the bits 80000000h");
        let mode = Check::exactly(Object::MODE_DISPLAY, Value::Integer8(-1));
        assert_eq!(mode.expected_value().to_string(), "FFh");
    }

    #[test]
    fn cob_id_may_be_read_back_with_bit_30() {
        let object = Object::tpdo_communication(1, 1);
        let check = Check::cob_id(object, Value::Unsigned32(0x183));
        for (byte, accepted) in [(0x40, true), (0x00, true), (0x80, false), (0x20, false)] {
            let content = content(object, &[0x83, 0x01, 0, byte]);
            assert_eq!(check.accepts(&content), accepted, "{byte:02X}");
        }
    }

    #[test]
    fn later_minor_revision_is_accepted() {
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
        assert_eq!(check.expected_value().to_string(), "00020104h or a later minor revision");
    }

    #[test]
    fn text_is_compared_as_a_whole_and_quoted() {
        let version = Value::VisibleString(ByteString::from_bytes(b"1.2").unwrap());
        let check = Check::exactly(Object::SOFTWARE_VERSION, version);
        assert!(check.accepts(&content(Object::SOFTWARE_VERSION, b"1.2")));
        let other = content(Object::SOFTWARE_VERSION, b"1.20");
        assert!(!check.accepts(&other));
        assert_eq!(check.expected_value().to_string(), "\"1.2\"");
        assert_eq!(check.found_value(&other).to_string(), "\"1.20\"");
    }

    #[test]
    fn number_of_another_size_is_not_accepted() {
        let check = Check::exactly(Object::VENDOR_ID, Value::Unsigned32(0x0F8C));
        let short = content(Object::VENDOR_ID, &[0x8C, 0x0F]);
        assert!(!check.accepts(&short));
        assert_eq!(check.found_value(&short).to_string(), "0F8Ch");
        assert!(
            !Check::exactly(Object::MODE_DISPLAY, Value::Integer8(10)).accepts(&Content::default())
        );
    }
}
