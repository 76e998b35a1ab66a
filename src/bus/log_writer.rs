//! Lines of `candump -L` logs, written: frames of several buses, and data of pseudo-interfaces.
//!
//! ```text
//! (1700000000.123456) vcan0 181#3706E8030000FEFF       a frame
//! (1700000000.123456) wrench0 18FF0000##0001122…       data of a pseudo-interface, as CAN FD: flags, then data
//! ```

use std::io::{self, Write};

use canopen::frame::{Channel, Telegram};
use units::time::Instant;

/// Writer of a log of several buses.
#[derive(Debug)]
pub struct LogWriter<W> {
    to: W,
    interfaces: Vec<String>,
    epoch_micros: u64,
}

impl<W: Write> LogWriter<W> {
    /// Writes to `to`, with one interface name per channel. Stamps are `epoch_micros` plus the bus time.
    pub fn new(to: W, interfaces: &[String], epoch_micros: u64) -> Self {
        Self { to, interfaces: interfaces.to_vec(), epoch_micros }
    }

    /// Writes a frame.
    ///
    /// # Errors
    /// The write fails.
    pub fn frame(&mut self, at: Instant, telegram: &Telegram) -> io::Result<()> {
        self.stamp(at)?;
        let Channel(place) = telegram.channel;
        let name = self.interfaces.get(usize::from(place)).map_or("can?", String::as_str);
        writeln!(self.to, "{name} {}", telegram.frame)
    }

    /// Writes data of a pseudo-interface, as a CAN FD frame with a 29-bit identifier.
    ///
    /// # Errors
    /// The write fails.
    pub fn pseudo(&mut self, at: Instant, name: &str, id: u32, data: &[u8]) -> io::Result<()> {
        self.stamp(at)?;
        write!(self.to, "{name} {id:08X}##0")?;
        data.iter().try_for_each(|byte| write!(self.to, "{byte:02X}"))?;
        writeln!(self.to)
    }

    /// Flushes the writer.
    ///
    /// # Errors
    /// The flush fails.
    pub fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }

    fn stamp(&mut self, at: Instant) -> io::Result<()> {
        let micros = self.epoch_micros + at.as_micros();
        write!(self.to, "({}.{:06}) ", micros / 1_000_000, micros % 1_000_000)
    }
}
