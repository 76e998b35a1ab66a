//! Writer of inputs in the format of docs/sessions.md.

use std::io::{self, Write};
use std::time::Duration;

use crate::input::{Call, Input};
use crate::intermediates::Digest;
use crate::table::{self, FORMAT, MAGIC};
use bus::{BusError, BusEvent, ReceivedEvent, ReopenError, SendError, Wake};
use canopen::frame::{Channel, Frame};
use controller::switches::CommandMode;
use node::Request;
use node::cause::ResetReason;
use node::trial::TrialRequest;
use remote::{RemoteSample, SideError};
use units::numbering::Joint;
use units::time::Instant;

/// Writer of a file of inputs.
#[derive(Debug)]
pub struct InputWriter<W> {
    to: W,
    last: Last,
    entry: Vec<u8>,
    /// Number of entries written, including earlier parts.
    entries: u64,
    /// Bytes written.
    written: u64,
}

/// Previous values, relative to which entries are written.
#[derive(Clone, Copy, Debug)]
pub struct Last {
    /// Last reading of the bus's clock, in µs.
    pub now: u64,
    /// Last time of host suspension.
    pub suspended: Duration,
    /// Time of the last sample, in µs, its numbers as bits, and whether it has a gripper.
    pub sensed: (u64, [u64; NUMBERS], bool),
}

/// Numbers of a sample: wrench (force, moment), position, quaternion (i, j, k, w), opening and force of the gripper.
pub const NUMBERS: usize = 15;

/// Bit in the mask of a sample that marks a gripper. Each lower bit marks one of the numbers.
pub const HAS_GRIPPER: u16 = 1 << NUMBERS;

impl Default for Last {
    fn default() -> Self {
        Self { now: 0, suspended: Duration::ZERO, sensed: (0, [0; NUMBERS], false) }
    }
}

impl<W: Write> InputWriter<W> {
    /// Starts the file of the first or only part.
    ///
    /// # Errors
    /// When the write fails.
    pub fn begin(to: W) -> io::Result<Self> {
        Self::begin_part(to, 1, 0)
    }

    /// Starts the file of a part, after `entries` entries in earlier parts.
    ///
    /// # Errors
    /// When the write fails.
    pub fn begin_part(mut to: W, part: u32, entries: u64) -> io::Result<Self> {
        let mut header = MAGIC.to_vec();
        header.extend_from_slice(&FORMAT.to_le_bytes());
        header.extend_from_slice(&part.to_le_bytes());
        header.extend_from_slice(&entries.to_le_bytes());
        to.write_all(&header)?;
        let entry = Vec::with_capacity(256);
        Ok(Self { to, last: Last::default(), entry, entries, written: length(header.len()) })
    }

    /// Returns the number of entries written, including earlier parts.
    pub const fn entries(&self) -> u64 {
        self.entries
    }

    /// Returns the number of bytes written to this file.
    pub const fn written(&self) -> u64 {
        self.written
    }

    /// Returns the destination.
    pub const fn get_ref(&self) -> &W {
        &self.to
    }

    /// Writes an input.
    ///
    /// # Errors
    /// When the write fails.
    pub fn write(&mut self, input: &Input) -> io::Result<()> {
        self.entry.clear();
        self.encode(input);
        self.to.write_all(&self.entry)?;
        self.entries += 1;
        self.written += length(self.entry.len());
        Ok(())
    }

    /// Flushes the writer.
    ///
    /// # Errors
    /// When the flush fails.
    pub fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }

    /// Returns the destination.
    pub fn into_inner(self) -> W {
        self.to
    }

    fn encode(&mut self, input: &Input) {
        match input {
            Input::Call(call) => self.call(*call),
            Input::Returned(sent) => {
                self.tag(table::RETURNED);
                self.bytes(&sent.to_le_bytes());
            }
            Input::Intermediates(cycle, Digest(bytes)) => {
                self.tag(table::INTERMEDIATES);
                self.varint(*cycle);
                self.bytes(bytes);
            }
            Input::Now(now) => self.now(*now),
            Input::Wall(wall) => {
                self.tag(table::WALL);
                self.duration(*wall);
            }
            Input::Suspended(total) if *total == self.last.suspended => {
                self.tag(table::SUSPENDED_AGAIN);
            }
            Input::Suspended(total) => {
                self.last.suspended = *total;
                self.tag(table::SUSPENDED);
                self.duration(*total);
            }
            Input::Confirmed(Channel(channel), None) => self.bytes(&[table::UNCONFIRMED, *channel]),
            Input::Confirmed(Channel(channel), Some(at)) => {
                self.bytes(&[table::CONFIRMED, *channel]);
                self.time(*at);
            }
            Input::NotSent(number, error) => {
                self.tag(match error {
                    SendError::Full => table::QUEUE_FULL,
                    SendError::Down => table::BUS_DOWN,
                });
                self.varint((*number).into());
            }
            Input::Woken(wake) => self.woken(wake),
            Input::Reopened(outcome) => self.reopened(outcome),
            Input::Sensed(sensed) => self.sensed(sensed.as_ref()),
            Input::SideError(error) => self.side_error(error.as_ref()),
            Input::Misfits(texts) => {
                self.tag(table::MISFITS);
                self.varint(length(texts.len()));
                texts.iter().for_each(|text| self.text(text));
            }
            Input::Polled(answer) => self.tag(if *answer { table::END } else { table::GO_ON }),
            Input::Lost(inputs) => {
                self.tag(table::LOST);
                self.varint(*inputs);
            }
        }
    }

    fn call(&mut self, call: Call) {
        self.tag(match call {
            Call::New => table::NEW,
            Call::BringUp => table::BRING_UP,
            Call::BringUpUnpowered(_) => table::BRING_UP_UNPOWERED,
            Call::Request(Request::Arm) => table::ARM,
            Call::Request(Request::Disarm) => table::DISARM,
            Call::Request(Request::Reset) => table::RESET,
            Call::Request(Request::Command(CommandMode::Rate)) => table::COMMAND_RATE,
            Call::Request(Request::Command(CommandMode::Pose)) => table::COMMAND_POSE,
            Call::Request(Request::Adjust(_)) => table::ADJUST,
            Call::Request(Request::Zero(_)) => table::ZERO,
            Call::Request(Request::Park) => table::PARK,
            Call::Request(Request::Trial(_)) => table::TRIAL,
            Call::Cycle => table::CYCLE,
            Call::Stop => table::STOP,
        });
        match call {
            Call::BringUpUnpowered(reason) => self.tag(match reason {
                ResetReason::UncleanEnd => 0,
                ResetReason::NoLatch => 1,
            }),
            Call::Request(Request::Adjust(adjustment)) => self.text(&adjustment.to_string()),
            Call::Request(Request::Zero(joint)) => self.tag(joint.map_or(0, Joint::number)),
            Call::Request(Request::Trial(TrialRequest { joint, share })) => {
                self.tag(joint.number());
                self.bytes(&share.to_le_bytes());
            }
            Call::New | Call::BringUp | Call::Request(_) | Call::Cycle | Call::Stop => {}
        }
    }

    fn now(&mut self, now: Instant) {
        if now.as_micros() == self.last.now {
            return self.tag(table::NOW_AGAIN);
        }
        self.tag(table::NOW);
        self.reading(now);
    }

    fn woken(&mut self, Wake { now, received }: &Wake) {
        let Some(ReceivedEvent { at, channel: Channel(channel), event }) = received else {
            self.tag(table::WOKEN);
            return self.reading(*now);
        };
        let tag = match event {
            BusEvent::Frame(_) => table::FRAME,
            BusEvent::Error(_) => table::BUS_FAULT,
        };
        self.bytes(&[tag, *channel]);
        self.reading(*now);
        self.time(*at);
        match event {
            BusEvent::Frame(frame) => self.frame(frame),
            BusEvent::Error(error) => self.tag(match error {
                BusError::Warning => 0,
                BusError::Overrun => 1,
                BusError::Passive => 2,
                BusError::Off => 3,
                BusError::Down => 4,
            }),
        }
    }

    /// Writes COB-ID (bits 0 to 10), remote frame (bit 11) and length (bits 12 to 15), then the data.
    fn frame(&mut self, frame: &Frame) {
        let head =
            frame.cob_id | u16::from(frame.is_remote()) << 11 | u16::from(frame.length()) << 12;
        self.bytes(&head.to_le_bytes());
        self.bytes(frame.data());
    }

    fn reopened(&mut self, outcome: &Result<(), ReopenError>) {
        match outcome {
            Ok(()) => self.tag(table::REOPENED),
            Err(ReopenError::Gone(Channel(channel))) => {
                self.bytes(&[table::NOT_REOPENED_GONE, *channel]);
            }
            Err(ReopenError::Unfit(reason)) => {
                self.tag(table::NOT_REOPENED_UNFIT);
                self.text(reason);
            }
        }
    }

    fn sensed(&mut self, sensed: Option<&RemoteSample>) {
        let Some(sensed) = sensed else { return self.tag(table::NOT_SENSED) };
        let next = (sensed.at.as_micros(), numbers(sensed), sensed.gripper.is_some());
        if self.last.sensed == next {
            return self.tag(table::SENSED_AGAIN);
        }
        self.tag(table::SENSED);
        self.time(sensed.at);
        let (_, before, _) = std::mem::replace(&mut self.last.sensed, next);
        let (_, numbers, has_gripper) = next;
        let changed = (0..).zip(numbers.iter().zip(before));
        let changed = changed.filter(|(_, (number, before))| *number != before);
        let flag = if has_gripper { HAS_GRIPPER } else { 0 };
        let mask = changed.clone().fold(flag, |mask, (place, _)| mask | 1 << place);
        self.bytes(&mask.to_le_bytes());
        changed.for_each(|(_, (number, _))| self.bytes(&number.to_le_bytes()));
    }

    fn side_error(&mut self, error: Option<&SideError>) {
        match error {
            None => self.tag(table::NO_SIDE_FAULT),
            Some(SideError::Holds(reason)) => self.bytes(&[table::SIDE_HOLDS, reason.code()]),
            Some(SideError::Slow { p99_us, stated_us }) => {
                self.tag(table::SIDE_SLOW);
                self.bytes(&p99_us.to_le_bytes());
                self.bytes(&stated_us.to_le_bytes());
            }
        }
    }

    /// Writes a reading of the clock, to which later times are relative.
    fn reading(&mut self, now: Instant) {
        self.time(now);
        self.last.now = now.as_micros();
    }

    /// Writes a time as its difference to the last reading of the clock, in µs.
    fn time(&mut self, at: Instant) {
        let difference = at.as_micros().wrapping_sub(self.last.now).cast_signed();
        self.varint((difference << 1 ^ difference >> 63).cast_unsigned());
    }

    fn duration(&mut self, duration: Duration) {
        self.varint(duration.as_secs());
        self.varint(duration.subsec_nanos().into());
    }

    fn text(&mut self, text: &str) {
        self.varint(length(text.len()));
        self.bytes(text.as_bytes());
    }

    /// Writes seven bits per byte, the lowest first; bit 7 is set if more bytes follow.
    fn varint(&mut self, mut value: u64) {
        loop {
            let [low, ..] = (value & 0x7F).to_le_bytes();
            value >>= 7;
            self.entry.push(low | u8::from(value > 0) << 7);
            if value == 0 {
                return;
            }
        }
    }

    fn tag(&mut self, tag: u8) {
        self.entry.push(tag);
    }

    fn bytes(&mut self, bytes: &[u8]) {
        self.entry.extend_from_slice(bytes);
    }
}

/// Returns the bits of the numbers of a sample.
fn numbers(sensed: &RemoteSample) -> [u64; NUMBERS] {
    let [f0, f1, f2, m0, m1, m2] = sensed.f_s.components();
    let [x, y, z] = sensed.x_b_m.translation.vector.into();
    let [i, j, k, w] = sensed.x_b_m.rotation.coords.into();
    let [opening, grip] = sensed.gripper.map_or([0.0; 2], |it| [it.position, it.force]);
    [f0, f1, f2, m0, m1, m2, x, y, z, i, j, k, w, opening, grip].map(f64::to_bits)
}

fn length(length: usize) -> u64 {
    u64::try_from(length).unwrap_or(u64::MAX)
}
