//! Lines of `candump -L` logs, parsed, and written again byte for byte.
//!
//! ```text
//! (1700000000.123456) vcan0 181#3706E8030000FEFF       a data frame
//! (1700000000.123456) wrench0 18FF0000##0001122…       CAN FD: flags, then data
//! (1700000000.123456) can0 20000004#0008000000000000   an error frame
//! (1700000000.123456) can0 701#R                       a remote frame
//! (1700000000.123456) can0 181#3706E8030000FEFF_E      raw DLC above 8: candump -8
//! ```
//!
//! Stamps have six digits, or nine with `candump -N`. Three digits of identifier are 11 bits, eight are 29 bits or an
//! error frame.

use std::fmt;
use std::ops::Deref;

use thiserror::Error;

/// Flag of error frames in the identifier.
const ERROR_FLAG: u32 = 0x2000_0000;

/// Frame of a log, with its time stamp and interface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line<'t> {
    /// Time stamp, in ns.
    pub nanos: u64,
    /// Set if the stamp has nine digits, ns; otherwise it has six, µs.
    pub is_fine: bool,
    /// Interface name, as `vcan0`.
    pub interface: &'t str,
    /// Identifier; [`is_extended`](Self::is_extended) distinguishes 29 bits from 11.
    pub id: u32,
    /// Set if the identifier has eight digits: 29 bits, or an error frame.
    pub is_extended: bool,
    /// Raw data length code 9 to 15, which means 8 bytes, if the line has one.
    pub raw_dlc: Option<u8>,
    /// Kind of the frame, with its data.
    pub content: Content,
}

/// Kind of a frame, with its data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Classical data frame, up to 8 bytes.
    Data(Bytes),
    /// CAN FD frame: flags (one hexadecimal digit) and data, up to 64 bytes.
    Fd(u8, Bytes),
    /// Remote frame, and its length if the line has one.
    Remote(Option<u8>),
    /// Error frame of the CAN controller: identifier with 20000000h.
    Error(Bytes),
}

/// Maximum data bytes of a frame (CAN FD).
const MAX_DATA: usize = 64;

impl Content {
    /// Returns whether the frame may have a data length code above 8.
    pub(super) fn is_classical_of_8(&self) -> bool {
        match self {
            Self::Data(data) => data.len() == 8,
            Self::Remote(length) => *length == Some(8),
            Self::Fd(..) | Self::Error(_) => false,
        }
    }
}

/// Data of a frame, stored in place: parsing does not allocate.
#[derive(Clone, Copy)]
pub struct Bytes {
    length: usize,
    bytes: [u8; MAX_DATA],
}

impl Bytes {
    pub(super) const EMPTY: Self = Self { length: 0, bytes: [0; MAX_DATA] };

    /// Parses pairs of hexadecimal digits, at most `most` pairs.
    fn parse(digits: &[u8], most: usize) -> Option<Self> {
        let mut bytes = Self::EMPTY;
        let (pairs, rest) = digits.as_chunks::<2>();
        if !rest.is_empty() || pairs.len() > most {
            return None;
        }
        pairs.iter().try_for_each(|pair| bytes.push(byte(*pair)?))?;
        Some(bytes)
    }

    /// Appends a byte; `None` if full.
    pub(super) fn push(&mut self, byte: u8) -> Option<()> {
        *self.bytes.get_mut(self.length)? = byte;
        self.length += 1;
        Some(())
    }
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}

impl PartialEq for Bytes {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl Eq for Bytes {}

impl<const N: usize> PartialEq<[u8; N]> for Bytes {
    fn eq(&self, other: &[u8; N]) -> bool {
        **self == *other
    }
}

impl fmt::Debug for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&**self, f)
    }
}

/// Parses two hexadecimal digits.
pub(super) fn byte(digits: [u8; 2]) -> Option<u8> {
    let [high, low] = digits.map(digit);
    Some(high? << 4 | low?)
}

/// Parses one hexadecimal digit.
const fn digit(digit: u8) -> Option<u8> {
    match digit {
        b'0'..=b'9' => Some(digit - b'0'),
        b'A'..=b'F' => Some(digit - b'A' + 10),
        b'a'..=b'f' => Some(digit - b'a' + 10),
        _ => None,
    }
}

/// Reasons to refuse a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NotALine {
    /// No `(seconds.digits)` at the start of the line.
    #[error("no stamp like (1700000000.123456)")]
    Stamp,
    /// No interface follows the stamp.
    #[error("no interface")]
    Interface,
    /// No identifier of three or eight digits precedes a `#`.
    #[error("no identifier of 3 or 8 hexadecimal digits")]
    Identifier,
    /// Data that is too long or not pairs of hexadecimal digits.
    #[error("no data in pairs of hexadecimal digits")]
    Data,
}

impl<'t> Line<'t> {
    /// Parses a line; a direction (` R` or ` T`) at its end is ignored.
    ///
    /// # Errors
    /// Returns the first invalid part.
    pub fn parse(line: &'t str) -> Result<Self, NotALine> {
        let mut words = line.split_ascii_whitespace();
        let (nanos, is_fine) = words.next().and_then(stamp).ok_or(NotALine::Stamp)?;
        let interface = words.next().ok_or(NotALine::Interface)?;
        let (digits, rest) =
            words.next().and_then(|frame| frame.split_once('#')).ok_or(NotALine::Identifier)?;
        let (id, is_extended) = identifier(digits).ok_or(NotALine::Identifier)?;
        let (rest, raw_dlc) = raw_dlc(rest).ok_or(NotALine::Data)?;
        let content = content(id, rest).ok_or(NotALine::Data)?;
        if raw_dlc.is_some() && !content.is_classical_of_8() {
            return Err(NotALine::Data);
        }
        if !matches!((words.next(), words.next()), (None | Some("R" | "T"), None)) {
            return Err(NotALine::Data);
        }
        Ok(Self { nanos, is_fine, interface, id, is_extended, raw_dlc, content })
    }

    /// Returns COB-ID and data of a CANopen frame: 11 bits, at most eight bytes.
    pub fn canopen(&self) -> Option<(u16, &[u8])> {
        match &self.content {
            Content::Data(data) if !self.is_extended => Some((u16::try_from(self.id).ok()?, data)),
            Content::Data(_) | Content::Fd(..) | Content::Remote(_) | Content::Error(_) => None,
        }
    }
}

impl fmt::Display for Line<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (seconds, rest) = (self.nanos / 1_000_000_000, self.nanos % 1_000_000_000);
        if self.is_fine {
            write!(f, "({seconds}.{rest:09}) {} ", self.interface)?;
        } else {
            write!(f, "({seconds}.{:06}) {} ", rest / 1_000, self.interface)?;
        }
        let width = if self.is_extended { 8 } else { 3 };
        write!(f, "{:0width$X}#", self.id)?;
        let data = match &self.content {
            Content::Data(data) | Content::Error(data) => data,
            Content::Fd(flags, data) => {
                write!(f, "#{flags:X}")?;
                data
            }
            Content::Remote(None) => return f.write_str("R"),
            Content::Remote(Some(length)) => {
                write!(f, "R{length}")?;
                &Bytes::EMPTY
            }
        };
        data.iter().try_for_each(|byte| write!(f, "{byte:02X}"))?;
        self.raw_dlc.map_or(Ok(()), |dlc| write!(f, "_{dlc:X}"))
    }
}

/// Parses an identifier of three hexadecimal digits, or eight for an extended one.
pub(super) fn identifier(digits: &str) -> Option<(u32, bool)> {
    if digits.len() != 3 && digits.len() != 8 || digits.starts_with('+') {
        return None;
    }
    Some((u32::from_str_radix(digits, 16).ok()?, digits.len() == 8))
}

/// Returns whether this is the identifier of an error frame.
pub(super) const fn is_error(id: u32) -> bool {
    id & ERROR_FLAG != 0
}

/// Splits off a raw data length code, as `_E`.
fn raw_dlc(rest: &str) -> Option<(&str, Option<u8>)> {
    match rest.split_once('_') {
        None => Some((rest, None)),
        Some((content, code)) => Some((content, Some(long_dlc(code)?))),
    }
}

/// Parses a data length code of 9 to 15, one hexadecimal digit.
pub(super) fn long_dlc(code: &str) -> Option<u8> {
    let &[code] = code.as_bytes() else { return None };
    digit(code).filter(|dlc| *dlc > 8)
}

/// Parses the content after the `#`.
fn content(id: u32, rest: &str) -> Option<Content> {
    if let Some(fd) = rest.strip_prefix('#') {
        let (flags, data) = fd.as_bytes().split_first()?;
        return Some(Content::Fd(digit(*flags)?, Bytes::parse(data, MAX_DATA)?));
    }
    match rest.strip_prefix('R') {
        Some("") => Some(Content::Remote(None)),
        Some(length) => Some(Content::Remote(Some(u8::try_from(number(length)?).ok()?))),
        None if is_error(id) => Some(Content::Error(Bytes::parse(rest.as_bytes(), 8)?)),
        None => Some(Content::Data(Bytes::parse(rest.as_bytes(), 8)?)),
    }
}

/// Parses `(seconds.digits)` to ns, and whether it has nine digits.
pub(super) fn stamp(word: &str) -> Option<(u64, bool)> {
    let (seconds, digits) = word.strip_prefix('(')?.strip_suffix(')')?.split_once('.')?;
    let (below, is_fine) = fraction(digits)?;
    let whole = number(seconds)?.checked_mul(1_000_000_000)?;
    Some((whole.checked_add(below)?, is_fine))
}

/// Parses six or nine decimals of a second, to ns.
pub(super) fn fraction(digits: &str) -> Option<(u64, bool)> {
    let scale = match digits.len() {
        6 => 1_000,
        9 => 1,
        _ => return None,
    };
    Some((number(digits)? * scale, scale == 1))
}

/// Parses decimal digits; `None` for anything else, such as a sign.
fn number(digits: &str) -> Option<u64> {
    digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok())?
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use bus::log_writer::LogWriter;
    use canopen::frame::{Channel, Frame, Telegram};
    use units::time::Instant;

    #[test]
    fn candump_lines_survive_parse_and_display() {
        for line in [
            "(1700000000.123456) vcan0 181#3706E8030000FEFF",
            "(1700000000.123456789) vcan0 080#",
            "(0.000001) wrench0 18FF0000##00011223344556677",
            "(1.000000) can0 20000004#0008000000000000",
            "(1.000000) can0 701#R",
            "(1.000000) can0 701#R8",
            "(1.000000) can0 1FFFFFFF#00",
            "(1.000000) can0 123#1122334455667788_E",
            "(1.000000) can0 123#R8_9",
        ] {
            assert_eq!(Line::parse(line).unwrap().to_string(), line);
        }
    }

    #[test]
    fn invalid_lines_are_refused_with_a_reason() {
        for (line, reason) in [
            ("", NotALine::Stamp),
            ("(1.00000) can0 080#", NotALine::Stamp),
            ("(1.000000)", NotALine::Interface),
            ("(1.000000) can0 80#", NotALine::Identifier),
            ("(1.000000) can0 +80#", NotALine::Identifier),
            ("(1.000000) can0 080#1", NotALine::Data),
            ("(1.000000) can0 080#+1", NotALine::Data),
            ("(1.000000) can0 080#112233445566778899", NotALine::Data),
            ("(1.000000) can0 080#R+8", NotALine::Data),
            ("(1.000000) can0 080##", NotALine::Data),
            ("(1.000000) can0 080#11 22", NotALine::Data),
            ("(+1.000000) can0 080#", NotALine::Stamp),
            ("(1.000000) can0 080#1122334455667788_8", NotALine::Data),
            ("(1.000000) can0 080#1122334455667788_", NotALine::Data),
            ("(1.000000) can0 080#11_E", NotALine::Data),
            ("(1.000000) can0 080##01122334455667788_E", NotALine::Data),
        ] {
            assert_eq!(Line::parse(line), Err(reason), "{line}");
        }
    }

    #[test]
    fn written_log_is_parsed() {
        let mut text = Vec::new();
        let mut log = LogWriter::new(&mut text, &["vcan0".to_owned()], 1_700_000_000_000_000);
        let telegram = Telegram { channel: Channel(0), frame: Frame::new(0x201, [0x0F, 0, 1, 2]) };
        log.frame(Instant::from_micros(42), &telegram).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert_eq!(text, "(1700000000.000042) vcan0 201#0F000102\n");
        assert_eq!(Line::parse(&text).unwrap().canopen(), Some((0x201, &[0x0F, 0, 1, 2][..])));
    }

    proptest! {
        #[test]
        fn any_text_is_parsed_or_refused(text in ".*") {
            if let Ok(line) = Line::parse(&text) {
                let again = line.to_string();
                prop_assert_eq!(Line::parse(&again).unwrap(), line);
            }
        }
    }
}
