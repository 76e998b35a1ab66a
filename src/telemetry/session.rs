//! Log of a session: one candump file of all buses and cycles.
//!
//! CAN FD frames of pseudo-interfaces are interleaved with the frames of the buses. One file contains the complete
//! run, and candump readers accept it.
//!
//! | interface | identifier | bytes                                                                 |
//! |-----------|------------|-----------------------------------------------------------------------|
//! | `wrench0` | 18FF0000h  | wrench on the object at {S} used in this cycle: six f64, N and N·m     |
//! | `node0`   | 18FF0001h  | mode u8, inputs u8 (FFh: silent), sampled joints as bits u8, 0, cycle u32 |
//!
//! Numbers are little-endian, as in CANopen. Both lines are written at the end of their cycle.

use std::io::{self, Write};

use bus::log_writer::LogWriter;
use canopen::frame::Telegram;
use node::cause::Cause;
use node::record::{Mode, Record};
use units::spatial::Wrench;
use units::time::Instant;

/// Pseudo-interface and identifier of wrenches.
pub const WRENCH: (&str, u32) = ("wrench0", 0x18FF_0000);

/// Pseudo-interface and identifier of modes and switches.
pub const NODE: (&str, u32) = ("node0", 0x18FF_0001);

/// Part of a cycle's record that the log keeps.
#[derive(Clone, Copy, Debug)]
pub struct Brief {
    /// Number of the cycle, from 1.
    pub cycle: u64,
    /// Time of the cycle's SYNC.
    pub at: Instant,
    /// Mode of the node.
    pub mode: Mode,
    /// Cause of the stop, while stopped.
    pub cause: Option<Cause>,
    /// Inputs of the switch box; `None` when they are stale.
    pub inputs: Option<u8>,
    /// Joints with a sample in time.
    pub sampled: [bool; 6],
    /// Wrench of the environment on the object at {S}, in N and N·m.
    pub f_s: Wrench,
}

impl From<&Record> for Brief {
    fn from(record: &Record) -> Self {
        let &Record { cycle, at, mode, cause, inputs, sampled, f_s, .. } = record;
        Self { cycle, at, mode, cause, inputs, sampled, f_s }
    }
}

/// Writer of a session log. The first failed write ends the log, so that it has no gaps, but not the session.
#[derive(Debug)]
pub struct SessionLog<W: Write> {
    log: LogWriter<W>,
    /// Newest time stamp. Earlier events are written with it, so stamps never decrease.
    latest: Instant,
    failed: Option<io::Error>,
}

impl<W: Write> SessionLog<W> {
    /// Creates a session log on `log`.
    pub const fn new(log: LogWriter<W>) -> Self {
        Self { log, latest: Instant::ZERO, failed: None }
    }

    /// Writes a frame.
    pub fn frame(&mut self, at: Instant, telegram: &Telegram) {
        self.write(at, |log, at| log.frame(at, telegram));
    }

    /// Writes a cycle: wrench, mode, inputs and samples.
    pub fn cycle(&mut self, brief: &Brief) {
        self.write(brief.at, |log, at| {
            let (interface, id) = WRENCH;
            log.pseudo(at, interface, id, &wrench_bytes(&brief.f_s))?;
            let (interface, id) = NODE;
            log.pseudo(at, interface, id, &state_bytes(brief))
        });
    }

    /// Returns the number of bytes written to this part of the log.
    pub const fn written(&self) -> u64 {
        self.log.written()
    }

    /// Flushes this part of the log, and continues in `next` with non-decreasing stamps. A log that has ended remains ended.
    pub fn begin_part(&mut self, next: LogWriter<W>) {
        self.flush();
        if self.failed.is_none() {
            self.log = next;
        }
    }

    /// Flushes the log. A failure ends it.
    pub fn flush(&mut self) {
        let latest = self.latest;
        self.write(latest, |log, _| log.flush());
    }

    /// Returns the error that ended the log.
    pub const fn failure(&self) -> Option<&io::Error> {
        self.failed.as_ref()
    }

    /// Flushes the log.
    ///
    /// # Errors
    /// Returns the error of the write that failed.
    pub fn finish(mut self) -> io::Result<()> {
        self.flush();
        self.failed.map_or(Ok(()), Err)
    }

    /// Writes at `at` or the newest stamp, whichever is later, unless the log has ended.
    fn write(
        &mut self,
        at: Instant,
        what: impl FnOnce(&mut LogWriter<W>, Instant) -> io::Result<()>,
    ) {
        if self.failed.is_none() {
            self.latest = self.latest.max(at);
            self.failed = what(&mut self.log, self.latest).err();
        }
    }
}

fn wrench_bytes(f_s: &Wrench) -> [u8; 48] {
    let mut bytes = [0; 48];
    for (to, from) in bytes.chunks_exact_mut(8).zip(f_s.components()) {
        to.copy_from_slice(&from.to_le_bytes());
    }
    bytes
}

fn state_bytes(brief: &Brief) -> [u8; 8] {
    let sampled =
        (0..).zip(brief.sampled).fold(0, |bits, (joint, is)| bits | u8::from(is) << joint);
    let [c0, c1, c2, c3, ..] = brief.cycle.to_le_bytes();
    [brief.mode.code(), brief.inputs.unwrap_or(0xFF), sampled, 0, c0, c1, c2, c3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::frame::{Channel, Frame};

    /// Disk with limited room.
    struct Disk {
        room: usize,
        written: Vec<u8>,
        refused: u32,
    }

    impl Write for &mut Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if bytes.len() > self.room {
                self.refused += 1;
                return Err(io::Error::from(io::ErrorKind::StorageFull));
            }
            self.room -= bytes.len();
            self.written.extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn hazard_32_full_disk_ends_the_log_for_good() {
        let mut disk = Disk { room: 100, written: Vec::new(), refused: 0 };
        let mut log = SessionLog::new(LogWriter::new(&mut disk, &["can0".to_owned()], 0));
        let telegram = Telegram { channel: Channel(0), frame: Frame::new(0x181, [1, 2]) };
        for micros in 0..1_000 {
            log.frame(Instant::from_micros(micros), &telegram);
        }
        assert_eq!(log.failure().unwrap().kind(), io::ErrorKind::StorageFull);
        assert_eq!(log.finish().unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert_eq!(disk.refused, 1, "a failed write is not repeated");
        assert!(disk.written.starts_with(b"(0.000000) can0 181#0102\n(0.000001)"));
    }
}
