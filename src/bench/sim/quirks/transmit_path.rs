//! Delays, repeats or drops the frames that a drive transmits.
//!
//! The device itself is unchanged, except that one with a late boot does not receive until then.

use std::collections::VecDeque;
use std::time::Duration;

use canopen_rs::emcy::ErrorRegister;
use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::sdo::response_cob_id;
use canopen_rs::{EmergencyMessage, NmtState};

use canopen::frame::{COB_ID_MAX, Frame};
use canopen::heartbeat::is_boot_up;
use canopen::master::check::COB_ID_INVALID;
use canopen::object::Object;
use canopen_device::station::earlier;
use canopen_device::{Application, Device};
use units::time::Instant;

/// Deviations of transmitted frames. The default has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct FrameQuirks {
    /// Delay of SDO responses.
    pub(super) response_delay: Duration,
    /// Sends SDO responses twice.
    pub(super) repeats_responses: bool,
    /// Number of the one SDO upload response that is lost, counted from power-up.
    pub(super) lost_response: Option<u32>,
    /// Number of the one SDO download response that is lost, counted from power-up.
    pub(super) lost_confirmation: Option<u32>,
    /// Time from the first SDO response since power-up until it is sent; later ones wait for it.
    pub(super) first_response_delay: Duration,
    /// Delay of the boot-up; until then the drive does not send or receive.
    pub(super) boot_delay: Duration,
    /// Sends no boot-up message.
    pub(super) hides_boot_up: bool,
    /// Minimum time between heartbeats; earlier ones are dropped.
    pub(super) min_heartbeat_period: Duration,
    /// Period of EMCY messages in pre-operational.
    pub(super) emcy_period: Option<Duration>,
    /// Sends no EMCY.
    pub(super) hides_emergencies: bool,
}

/// Transmit path of one drive.
#[derive(Clone, Debug, Default)]
pub(crate) struct TransmitPath {
    quirks: FrameQuirks,
    /// Set if no quirk changes frames.
    is_transparent: bool,
    /// Delayed frames, in order of their due times.
    delayed: VecDeque<(Instant, Frame)>,
    booting_until: Option<Instant>,
    /// SDO upload responses since power-up.
    uploads: u32,
    /// SDO download responses since power-up.
    downloads: u32,
    /// Time of the first SDO response; `None` before it.
    answers_from: Option<Instant>,
    /// Time of the last heartbeat.
    last_heartbeat: Option<Instant>,
    /// Due time of the next EMCY of a storm.
    next_emcy: Option<Instant>,
}

/// Communication object of a transmitted frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    BootUp,
    Heartbeat,
    SdoResponse,
    Emergency,
    Other,
}

impl Kind {
    fn classify<A: Application>(frame: &Frame, device: &Device<A>) -> Self {
        let node = device.node();
        let has_heartbeat = device.dictionary().unsigned(Object::PRODUCER_HEARTBEAT) > 0;
        if is_boot_up(frame, node) {
            Self::BootUp
        } else if frame.cob_id == heartbeat_cob_id(node) && has_heartbeat {
            Self::Heartbeat
        } else if frame.cob_id == response_cob_id(node) {
            Self::SdoResponse
        } else if emcy_cob_id(device) == Some(frame.cob_id) {
            Self::Emergency
        } else {
            Self::Other
        }
    }
}

impl TransmitPath {
    /// Creates an empty path.
    pub(crate) fn new(quirks: FrameQuirks) -> Self {
        Self { quirks, is_transparent: quirks == FrameQuirks::default(), ..Self::default() }
    }

    /// Starts again: the drive has lost its power.
    pub(crate) fn power_up(&mut self) {
        *self = Self::new(self.quirks);
    }

    /// Returns whether frames pass as they are, and nothing else is sent.
    pub(crate) const fn is_transparent(&self) -> bool {
        self.is_transparent
    }

    /// Returns whether the drive receives frames: its boot delay is over.
    pub(crate) fn is_receiving(&self, now: Instant) -> bool {
        self.booting_until.is_none_or(|end| now >= end)
    }

    /// Takes the frames that `device` sends at `now`, and appends those due to `out`.
    pub(crate) fn forward<A: Application>(
        &mut self,
        now: Instant,
        device: &Device<A>,
        sent: impl IntoIterator<Item = Frame>,
        out: &mut Vec<Frame>,
    ) {
        if self.is_transparent {
            return out.extend(sent);
        }
        // First: a late boot-up message precedes the first answer.
        self.send_due(now, out);
        for frame in sent {
            match Kind::classify(&frame, device) {
                Kind::BootUp => self.send_boot_up(now, frame, out),
                _ if !self.is_receiving(now) => {}
                Kind::Heartbeat => out.extend(self.take_heartbeat_slot(now).then_some(frame)),
                Kind::SdoResponse => self.send_response(now, frame, out),
                Kind::Emergency => out.extend((!self.quirks.hides_emergencies).then_some(frame)),
                Kind::Other => out.push(frame),
            }
        }
        self.send_storm(now, device, out);
    }

    /// Returns the time at which [`forward`](Self::forward) must be called next, even without frames.
    pub(crate) fn deadline(&self) -> Option<Instant> {
        if self.is_transparent {
            return None;
        }
        earlier(self.delayed.front().map(|(at, _)| *at), self.next_emcy)
    }

    /// Sends the boot-up message. Delayed frames are lost: the reset has cleared the SDO server.
    fn send_boot_up(&mut self, now: Instant, frame: Frame, out: &mut Vec<Frame>) {
        self.delayed.clear();
        self.last_heartbeat = None;
        let frame = (!self.quirks.hides_boot_up).then_some(frame);
        if self.quirks.boot_delay.is_zero() {
            out.extend(frame);
        } else {
            let boot_end = now + self.quirks.boot_delay;
            self.booting_until = Some(boot_end);
            self.delayed.extend(frame.map(|frame| (boot_end, frame)));
        }
    }

    fn send_response(&mut self, now: Instant, frame: Frame, out: &mut Vec<Frame>) {
        if self.is_lost(&frame) {
            return;
        }
        let first = self.quirks.first_response_delay;
        let answers_from = *self.answers_from.get_or_insert(now + first);
        let times = if self.quirks.repeats_responses { 2 } else { 1 };
        let responses = std::iter::repeat_n(frame, times);
        let due = (now + self.quirks.response_delay).max(answers_from);
        if due <= now {
            out.extend(responses);
        } else {
            self.delayed.extend(responses.map(|frame| (due, frame)));
        }
    }

    /// Counts responses; returns whether this one is lost.
    fn is_lost(&mut self, frame: &Frame) -> bool {
        let (count, lost) = match frame.data().first().map(|command| command >> 5) {
            Some(SCS_UPLOAD) => (&mut self.uploads, self.quirks.lost_response),
            Some(SCS_DOWNLOAD) => (&mut self.downloads, self.quirks.lost_confirmation),
            _ => return false,
        };
        *count = count.saturating_add(1);
        lost == Some(*count)
    }

    fn take_heartbeat_slot(&mut self, now: Instant) -> bool {
        let is_too_soon =
            self.last_heartbeat.is_some_and(|last| now < last + self.quirks.min_heartbeat_period);
        if !is_too_soon {
            self.last_heartbeat = Some(now);
        }
        !is_too_soon
    }

    fn send_due(&mut self, now: Instant, out: &mut Vec<Frame>) {
        while self.delayed.front().is_some_and(|(at, _)| *at <= now) {
            out.extend(self.delayed.pop_front().map(|(_, frame)| frame));
        }
    }

    /// Sends EMCY messages periodically while the drive is pre-operational and has booted.
    fn send_storm<A: Application>(
        &mut self,
        now: Instant,
        device: &Device<A>,
        out: &mut Vec<Frame>,
    ) {
        let Some(every) = self.quirks.emcy_period else { return };
        if device.state() != NmtState::PreOperational {
            self.next_emcy = None;
            return;
        }
        let due = *self.next_emcy.get_or_insert(now);
        if due > now {
            return;
        }
        self.next_emcy = Some(now + every);
        if self.is_receiving(now) {
            let message = EmergencyMessage {
                error_code: DEVICE_SPECIFIC,
                error_register: ErrorRegister(GENERIC),
                vendor_specific: [0; 5],
            };
            out.extend(emcy_cob_id(device).map(|cob_id| Frame::new(cob_id, message.encode())));
        }
    }
}

/// Returns the COB-ID of EMCY messages (1014h), `None` if they are disabled.
fn emcy_cob_id<A: Application>(device: &Device<A>) -> Option<u16> {
    let raw = device.dictionary().unsigned(Object::EMCY_COB_ID);
    let identifier = u16::try_from(raw & u32::from(COB_ID_MAX)).ok();
    identifier.filter(|_| raw & COB_ID_INVALID == 0)
}

/// Server command specifier of an upload response (CiA 301, 7.2.4.3.6).
const SCS_UPLOAD: u8 = 2;
/// Server command specifier of a download response (CiA 301, 7.2.4.3.3).
const SCS_DOWNLOAD: u8 = 3;
/// Error code of device-specific errors (CiA 301, table 26).
const DEVICE_SPECIFIC: u16 = 0xFF00;
/// Generic error, bit 0 of the error register (1001h).
const GENERIC: u8 = 1;
