//! A session on disk: one candump log of everything, and a summary.
//!
//! Between the frames of the buses stand lines on pseudo-interfaces, as CAN FD frames, so that one
//! file holds the whole run and candump readers take it:
//!
//! | interface | identifier | bytes                                                                 |
//! |-----------|------------|-----------------------------------------------------------------------|
//! | `wrench0` | 18FF0000h  | the wrench on the object at {S} this cycle used: six f64, N and N·m   |
//! | `node0`   | 18FF0001h  | mode u8, inputs u8 (FFh: silent), sampled joints as bits u8, 0, cycle u32 |
//!
//! Numbers are little-endian, as CANopen's. Both lines come at the end of the cycle they are about.

use std::io;
use std::io::Write;

use crate::canopen::frame::Telegram;
use crate::telemetry::candump::LogWriter;
use crate::telemetry::record::Mode;
use crate::telemetry::record::Record;
use crate::time::Instant;

/// Where wrenches stand in the log.
pub const WRENCH: (&str, u32) = ("wrench0", 0x18FF_0000);

/// Where modes and switches stand in the log.
pub const NODE: (&str, u32) = ("node0", 0x18FF_0001);

/// Writes the log of a session. A write that fails is counted, and never stops the session.
#[derive(Debug)]
pub struct SessionLog<W: Write> {
    log: LogWriter<W>,
    /// The newest stamp, before which nothing is written: a log goes forward.
    latest: Instant,
    failed: Option<io::Error>,
}

impl<W: Write> SessionLog<W> {
    /// Onto `log`.
    pub const fn new(log: LogWriter<W>) -> Self {
        Self { log, latest: Instant::ZERO, failed: None }
    }

    /// A frame on a bus.
    pub fn frame(&mut self, at: Instant, telegram: &Telegram) {
        self.latest = self.latest.max(at);
        let written = self.log.frame(self.latest, telegram);
        self.note(written);
    }

    /// A cycle: its wrench, mode, inputs and samples.
    pub fn record(&mut self, record: &Record) {
        self.latest = self.latest.max(record.at);
        let mut wrench = [0; 48];
        for (to, from) in wrench.chunks_exact_mut(8).zip(record.f_s.components()) {
            to.copy_from_slice(&from.to_le_bytes());
        }
        let (interface, id) = WRENCH;
        let written = self.log.pseudo(self.latest, interface, id, &wrench);
        self.note(written);

        let sampled =
            (0..).zip(record.sampled).fold(0, |bits, (joint, is)| bits | u8::from(is) << joint);
        let [c0, c1, c2, c3, ..] = record.cycle.to_le_bytes();
        let state = [code(record.mode), record.inputs.unwrap_or(0xFF), sampled, 0, c0, c1, c2, c3];
        let (interface, id) = NODE;
        let written = self.log.pseudo(self.latest, interface, id, &state);
        self.note(written);
    }

    /// Everything written is on its way to the disk.
    ///
    /// # Errors
    /// The first write that failed, if any did.
    pub fn finish(mut self) -> io::Result<()> {
        let flushed = self.log.flush();
        self.note(flushed);
        self.failed.map_or(Ok(()), Err)
    }

    fn note(&mut self, written: io::Result<()>) {
        if let Err(error) = written {
            self.failed.get_or_insert(error);
        }
    }
}

/// A mode as a number, in the order of the mode graph.
const fn code(mode: Mode) -> u8 {
    match mode {
        Mode::Boot => 0,
        Mode::Ready => 1,
        Mode::Armed => 2,
        Mode::Engaged => 3,
        Mode::ReflectionOff => 4,
        Mode::ZeroTorque => 5,
        Mode::DrivesOff => 6,
    }
}
