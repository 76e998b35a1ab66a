//! Writer of logs in the format of `candump -L`: frames of several buses, and data of pseudo-interfaces.
//!
//! ```text
//! (1700000000.123456) vcan0 181#3706E8030000FEFF       a frame
//! (1700000000.123456) wrench0 18FF0000##0001122…       data of a pseudo-interface, as CAN FD: flags, then data
//! ```

use std::io::{self, Write};

use canopen::frame::{Channel, TEXT_LENGTH, Telegram, write_hex};
use units::time::Instant;

/// Writer of a log of several buses.
#[derive(Debug)]
pub struct LogWriter<W> {
    to: W,
    interfaces: Vec<String>,
    epoch_micros: u64,
    /// Second of the last line, and how the stamps in it begin.
    second: (u64, Vec<u8>),
    /// Line being written.
    line: Vec<u8>,
    /// Bytes written.
    written: u64,
}

impl<W: Write> LogWriter<W> {
    /// Writes to `to`, with one interface name per channel. Stamps are `epoch_micros` plus the bus time.
    pub fn new(to: W, interfaces: &[String], epoch_micros: u64) -> Self {
        let second = (u64::MAX, Vec::new());
        let interfaces = interfaces.to_vec();
        Self { to, interfaces, epoch_micros, second, line: Vec::new(), written: 0 }
    }

    /// Returns the number of bytes written, line ends included.
    pub const fn written(&self) -> u64 {
        self.written
    }

    /// Returns the sink, without flushing it.
    pub fn into_inner(self) -> W {
        self.to
    }

    /// Writes a frame.
    ///
    /// # Errors
    /// When the write fails.
    pub fn frame(&mut self, at: Instant, telegram: &Telegram) -> io::Result<()> {
        self.stamp(at);
        let Channel(place) = telegram.channel;
        let name = self.interfaces.get(usize::from(place)).map_or("can?", String::as_str);
        self.line.extend_from_slice(name.as_bytes());
        self.line.push(b' ');
        self.line.extend_from_slice(telegram.frame.text(&mut [0; TEXT_LENGTH]));
        self.end()
    }

    /// Writes data of a pseudo-interface, as a CAN FD frame with a 29-bit identifier.
    ///
    /// # Errors
    /// When the write fails.
    pub fn pseudo(&mut self, at: Instant, name: &str, id: u32, data: &[u8]) -> io::Result<()> {
        self.stamp(at);
        self.line.extend_from_slice(name.as_bytes());
        self.line.push(b' ');
        self.hex(&id.to_be_bytes());
        self.line.extend_from_slice(b"##0");
        self.hex(data);
        self.end()
    }

    /// Flushes the writer.
    ///
    /// # Errors
    /// When the flush fails.
    pub fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }

    /// Begins a line with the time stamp of candump: seconds, and six digits of µs.
    fn stamp(&mut self, at: Instant) {
        let micros = self.epoch_micros + at.as_micros();
        let second = micros / 1_000_000;
        if second != self.second.0 {
            self.second = (second, format!("({second}.").into_bytes());
        }
        self.line.clear();
        self.line.extend_from_slice(&self.second.1);
        self.line.extend_from_slice(&six_digits(micros % 1_000_000));
        self.line.extend_from_slice(b") ");
    }

    /// Appends the hexadecimal digits of these bytes.
    fn hex(&mut self, data: &[u8]) {
        for part in data.chunks(8) {
            let mut digits = [0; 16];
            write_hex(&mut digits, part);
            self.line.extend_from_slice(digits.get(..2 * part.len()).unwrap_or_default());
        }
    }

    /// Ends the line, and writes it.
    fn end(&mut self) -> io::Result<()> {
        self.line.push(b'\n');
        self.to.write_all(&self.line)?;
        self.written += u64::try_from(self.line.len()).unwrap_or(u64::MAX);
        Ok(())
    }
}

/// Returns the last six decimal digits of a number.
fn six_digits(mut value: u64) -> [u8; 6] {
    let mut digits = [0; 6];
    for place in digits.iter_mut().rev() {
        *place = b'0' + u8::try_from(value % 10).unwrap_or(0);
        value /= 10;
    }
    digits
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use canopen::frame::Frame;

    proptest! {
        #[test]
        fn lines_are_those_of_candump(
            epoch in 0..2_000_000_000_000_000_u64,
            micros in 0..u64::from(u32::MAX),
            cob_id in 0..0x800_u16,
            data in prop::collection::vec(any::<u8>(), 0..=8),
            id in 0..0x2000_0000_u32,
        ) {
            let at = Instant::from_micros(micros);
            let telegram = Telegram { channel: Channel(0), frame: Frame::from_slice(cob_id, &data).unwrap() };
            let mut log = LogWriter::new(Vec::new(), &["can0".to_owned()], epoch);
            log.frame(at, &telegram).unwrap();
            log.pseudo(at, "node0", id, &data).unwrap();
            let (seconds, rest) = ((epoch + micros) / 1_000_000, (epoch + micros) % 1_000_000);
            let bytes: String = data.iter().map(|byte| format!("{byte:02X}")).collect();
            let stamp = format!("({seconds}.{rest:06})");
            let expected = format!("{stamp} can0 {cob_id:03X}#{bytes}\n{stamp} node0 {id:08X}##0{bytes}\n");
            prop_assert_eq!(String::from_utf8(log.to).unwrap(), expected);
        }
    }
}
