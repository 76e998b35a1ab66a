//! Lines as `candump -L` writes them, written, and read back byte for byte.
//!
//! ```text
//! (1700000000.123456) vcan0 181#3706E8030000FEFF       a data frame
//! (1700000000.123456) wrench0 18FF0000##0001122…       CAN FD: flags, then data
//! (1700000000.123456) can0 20000004#0008000000000000   an error frame
//! (1700000000.123456) can0 701#R                       a remote frame
//! ```
//!
//! Stamps have six digits, or nine as `candump -N` writes them. Three digits of identifier are 11 bits,
//! eight are 29 bits or an error frame.

use std::fmt;
use std::io;
use std::io::Write;

use thiserror::Error;

use crate::canopen::frame::Channel;
use crate::canopen::frame::Telegram;
use crate::time::Instant;

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
    /// What it carries.
    pub content: Content,
}

/// What a line carries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Content {
    /// A data frame.
    Data(Vec<u8>),
    /// A CAN FD frame: its flags, one hexadecimal digit, and its data.
    Fd(u8, Vec<u8>),
    /// A remote frame, and the length it asks for, where it says one.
    Remote(Option<u8>),
    /// What a CAN controller reports.
    Error(Vec<u8>),
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
        let is_extended = digits.len() == 8;
        if !is_extended && digits.len() != 3 || !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(NotALine::Identifier);
        }
        let id = u32::from_str_radix(digits, 16).map_err(|_| NotALine::Identifier)?;
        let content = if let Some(fd) = rest.strip_prefix('#') {
            let (flags, data) = fd.split_at_checked(1).ok_or(NotALine::Data)?;
            let flags = u8::from_str_radix(flags, 16).map_err(|_| NotALine::Data)?;
            Content::Fd(flags, bytes(data, 64)?)
        } else if let Some(length) = rest.strip_prefix('R') {
            let length = length.is_empty().then_some(None);
            Content::Remote(match length {
                Some(none) => none,
                None => Some(rest[1..].parse().map_err(|_| NotALine::Data)?),
            })
        } else if id & ERROR_FLAG != 0 {
            Content::Error(bytes(rest, 8)?)
        } else {
            Content::Data(bytes(rest, 8)?)
        };
        Ok(Self { nanos, is_fine, interface, id, is_extended, content })
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
            Content::Remote(Some(length)) => return write!(f, "R{length}"),
        };
        data.iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

/// `(seconds.digits)` in nanoseconds, and whether it has nine digits.
fn stamp(word: &str) -> Option<(u64, bool)> {
    let (seconds, digits) = word.strip_prefix('(')?.strip_suffix(')')?.split_once('.')?;
    if !digits.bytes().chain(seconds.bytes()).all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let scale = match digits.len() {
        6 => 1_000,
        9 => 1,
        _ => return None,
    };
    let whole = seconds.parse::<u64>().ok()?.checked_mul(1_000_000_000)?;
    let nanos = whole.checked_add(digits.parse::<u64>().ok()?.checked_mul(scale)?)?;
    Some((nanos, scale == 1))
}

/// Pairs of hexadecimal digits, `most` of them at most.
fn bytes(digits: &str, most: usize) -> Result<Vec<u8>, NotALine> {
    if !digits.len().is_multiple_of(2) || digits.len() > 2 * most {
        return Err(NotALine::Data);
    }
    let pair = |pair: &[u8]| {
        let text = std::str::from_utf8(pair).ok().filter(|text| !text.starts_with('+'))?;
        u8::from_str_radix(text, 16).ok()
    };
    digits.as_bytes().chunks_exact(2).map(pair).collect::<Option<_>>().ok_or(NotALine::Data)
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
    use super::*;
    use crate::canopen::frame::Frame;
    use proptest::prelude::*;

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
