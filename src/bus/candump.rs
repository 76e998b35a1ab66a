//! Lines as `candump -L` writes them, written, and read back byte for byte.
//!
//! ```text
//! (1700000000.123456) vcan0 181#3706E8030000FEFF       a data frame
//! (1700000000.123456) wrench0 18FF0000##0001122…       CAN FD: flags, then data
//! (1700000000.123456) can0 20000004#0008000000000000   an error frame
//! (1700000000.123456) can0 701#R                       a remote frame
//! (1700000000.123456) can0 181#3706E8030000FEFF_E      a data length code above 8: candump -8
//! ```
//!
//! Stamps have six digits, or nine as `candump -N` writes them. Three digits of identifier are 11 bits,
//! eight are 29 bits or an error frame.

use std::fmt;
use std::io;
use std::io::Write;
use std::ops::Deref;

use thiserror::Error;

use canopen::frame::Channel;
use canopen::frame::Telegram;
use units::time::Instant;

/// An identifier that marks an error frame.
const ERROR_FLAG: u32 = 0x2000_0000;

/// One line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line<'t> {
    /// Nanoseconds of its stamp.
    pub nanos: u64,
    /// Whether the stamp has nine digits.
    pub is_fine: bool,
    /// The interface.
    pub interface: &'t str,
    /// The identifier, with [`is_extended`](Self::is_extended) to tell 11 bits from 29.
    pub id: u32,
    /// Whether it was written with eight digits.
    pub is_extended: bool,
    /// The data length code, where it was written apart from the length: 9 to 15, each of which means 8 bytes.
    pub raw_dlc: Option<u8>,
    /// What it carries.
    pub content: Content,
}

/// What a line carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// A data frame.
    Data(Bytes),
    /// A CAN FD frame: its flags, one hexadecimal digit, and its data.
    Fd(u8, Bytes),
    /// A remote frame, and the length it asks for, where it says one.
    Remote(Option<u8>),
    /// What a CAN controller reports.
    Error(Bytes),
}

/// The most data a frame has: CAN FD's.
const MOST: usize = 64;

impl Content {
    /// Returns whether this is a frame that may have a data length code above 8.
    pub(super) fn is_classical_of_8(&self) -> bool {
        match self {
            Self::Data(data) => data.len() == 8,
            Self::Remote(length) => *length == Some(8),
            Self::Fd(..) | Self::Error(_) => false,
        }
    }
}

/// The data of a frame, in place: a log of a million lines is read without an allocation.
#[derive(Clone, Copy)]
pub struct Bytes {
    length: usize,
    bytes: [u8; MOST],
}

impl Bytes {
    const EMPTY: Self = Self { length: 0, bytes: [0; MOST] };

    /// Pairs of hexadecimal digits, `most` of them at most.
    fn parse(digits: &[u8], most: usize) -> Option<Self> {
        let mut bytes = Self::EMPTY;
        let (pairs, rest) = digits.as_chunks::<2>();
        if !rest.is_empty() || pairs.len() > most {
            return None;
        }
        pairs.iter().try_for_each(|pair| bytes.push(byte(*pair)?))?;
        Some(bytes)
    }

    /// One more, `None` if there is no room.
    pub(super) fn push(&mut self, byte: u8) -> Option<()> {
        *self.bytes.get_mut(self.length)? = byte;
        self.length += 1;
        Some(())
    }

    pub(super) const fn empty() -> Self {
        Self::EMPTY
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

/// Two hexadecimal digits.
pub(super) fn byte(digits: [u8; 2]) -> Option<u8> {
    let [high, low] = digits.map(digit);
    Some(high? << 4 | low?)
}

/// One hexadecimal digit.
const fn digit(digit: u8) -> Option<u8> {
    match digit {
        b'0'..=b'9' => Some(digit - b'0'),
        b'A'..=b'F' => Some(digit - b'A' + 10),
        b'a'..=b'f' => Some(digit - b'a' + 10),
        _ => None,
    }
}

/// Why a line is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NotALine {
    /// No `(seconds.digits)` at its start.
    #[error("no stamp like (1700000000.123456)")]
    Stamp,
    /// No interface after the stamp.
    #[error("no interface")]
    Interface,
    /// No identifier of three or eight digits before a `#`.
    #[error("no identifier of 3 or 8 hexadecimal digits")]
    Identifier,
    /// Data that is not in pairs of hexadecimal digits, or too long.
    #[error("no data in pairs of hexadecimal digits")]
    Data,
}

impl<'t> Line<'t> {
    /// Reads a line; a direction (` R` or ` T`) at its end is passed over.
    ///
    /// # Errors
    /// The first part that is not as it should be.
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

    /// The data of an ordinary CANopen frame: 11 bits, at most eight bytes.
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

/// An identifier of three hexadecimal digits, or of eight, which makes it an extended one.
pub(super) fn identifier(digits: &str) -> Option<(u32, bool)> {
    if digits.len() != 3 && digits.len() != 8 || digits.starts_with('+') {
        return None;
    }
    Some((u32::from_str_radix(digits, 16).ok()?, digits.len() == 8))
}

/// Whether this is the identifier of an error frame.
pub(super) const fn is_error(id: u32) -> bool {
    id & ERROR_FLAG != 0
}

/// Splits `_E` off what stands behind the `#`; without it there is no raw data length code.
fn raw_dlc(rest: &str) -> Option<(&str, Option<u8>)> {
    match rest.split_once('_') {
        None => Some((rest, None)),
        Some((content, code)) => Some((content, Some(long_dlc(code)?))),
    }
}

/// A data length code of 9 to 15, one hexadecimal digit.
pub(super) fn long_dlc(code: &str) -> Option<u8> {
    let &[code] = code.as_bytes() else { return None };
    digit(code).filter(|dlc| *dlc > 8)
}

/// What stands behind the `#`.
fn content(id: u32, rest: &str) -> Option<Content> {
    if let Some(fd) = rest.strip_prefix('#') {
        let (flags, data) = fd.as_bytes().split_first()?;
        return Some(Content::Fd(digit(*flags)?, Bytes::parse(data, MOST)?));
    }
    match rest.strip_prefix('R') {
        Some("") => Some(Content::Remote(None)),
        Some(length) => Some(Content::Remote(Some(u8::try_from(number(length)?).ok()?))),
        None if is_error(id) => Some(Content::Error(Bytes::parse(rest.as_bytes(), 8)?)),
        None => Some(Content::Data(Bytes::parse(rest.as_bytes(), 8)?)),
    }
}

/// `(seconds.digits)` in nanoseconds, and whether it has nine digits.
pub(super) fn stamp(word: &str) -> Option<(u64, bool)> {
    let (seconds, digits) = word.strip_prefix('(')?.strip_suffix(')')?.split_once('.')?;
    let scale = match digits.len() {
        6 => 1_000,
        9 => 1,
        _ => return None,
    };
    let whole = number(seconds)?.checked_mul(1_000_000_000)?;
    let nanos = whole.checked_add(number(digits)?.checked_mul(scale)?)?;
    Some((nanos, scale == 1))
}

/// Decimal digits and nothing else.
fn number(digits: &str) -> Option<u64> {
    digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok())?
}

/// Writes a log of several buses.
#[derive(Debug)]
pub struct LogWriter<W> {
    to: W,
    interfaces: Vec<String>,
    epoch_micros: u64,
}

impl<W: Write> LogWriter<W> {
    /// Onto `to`; a channel's frames are on the interface of its place. Stamps are `epoch_micros` plus
    /// the bus's time.
    pub fn new(to: W, interfaces: &[String], epoch_micros: u64) -> Self {
        Self { to, interfaces: interfaces.to_vec(), epoch_micros }
    }

    /// A frame on a bus.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn frame(&mut self, at: Instant, telegram: &Telegram) -> io::Result<()> {
        self.stamp(at)?;
        let Channel(place) = telegram.channel;
        let name = self.interfaces.get(usize::from(place)).map_or("can?", String::as_str);
        writeln!(self.to, "{name} {}", telegram.frame)
    }

    /// Data on a pseudo-interface, as a CAN FD frame with a 29-bit identifier.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn pseudo(&mut self, at: Instant, name: &str, id: u32, data: &[u8]) -> io::Result<()> {
        self.stamp(at)?;
        write!(self.to, "{name} {id:08X}##0")?;
        data.iter().try_for_each(|byte| write!(self.to, "{byte:02X}"))?;
        writeln!(self.to)
    }

    /// Everything written is handed on.
    ///
    /// # Errors
    /// When it cannot be.
    pub fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }

    fn stamp(&mut self, at: Instant) -> io::Result<()> {
        let micros = self.epoch_micros + at.as_micros();
        write!(self.to, "({}.{:06}) ", micros / 1_000_000, micros % 1_000_000)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use canopen::frame::Frame;

    #[test]
    fn what_candump_writes_is_read_and_written_again() {
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
    fn what_is_no_line_says_why() {
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
    fn a_log_is_read_back() {
        let mut log = LogWriter::new(Vec::new(), &["vcan0".to_owned()], 1_700_000_000_000_000);
        let telegram = Telegram { channel: Channel(0), frame: Frame::new(0x201, [0x0F, 0, 1, 2]) };
        log.frame(Instant::from_micros(42), &telegram).unwrap();
        let text = String::from_utf8(log.to).unwrap();
        assert_eq!(text, "(1700000000.000042) vcan0 201#0F000102\n");
        assert_eq!(Line::parse(&text).unwrap().canopen(), Some((0x201, &[0x0F, 0, 1, 2][..])));
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in ".*") {
            if let Ok(line) = Line::parse(&text) {
                let again = line.to_string();
                prop_assert_eq!(Line::parse(&again).unwrap(), line);
            }
        }
    }
}
