//! What happens to the frames of a drive on the way to its bus: they come late, twice, or not at all.
//!
//! A pure machine beside the device. What the device does is unchanged by it, but that one which boots
//! late hears nothing until it has.

use std::collections::VecDeque;
use std::time::Duration;

use canopen_rs::EmergencyMessage;
use canopen_rs::NmtState;
use canopen_rs::emcy::ErrorRegister;
use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::sdo::response_cob_id;

use canopen::device::Application;
use canopen::device::Device;
use canopen::frame::COB_ID_MAX;
use canopen::frame::Frame;
use canopen::heartbeat::is_boot_up;
use canopen::master::check::COB_ID_INVALID;
use canopen::object::Object;
use units::time::Instant;

/// What happens to frames. By default nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Habits {
    /// SDO replies come so much later.
    pub(super) reply_delay: Duration,
    /// SDO replies come twice.
    pub(super) repeats_replies: bool,
    /// It boots up so much later, and hears and says nothing until then.
    pub(super) boot_delay: Duration,
    /// Its boot-up message never comes.
    pub(super) hides_boot_up: bool,
    /// A heartbeat sooner than this after the one before does not come.
    pub(super) least_period: Duration,
    /// In pre-operational an emergency comes so often.
    pub(super) storm: Option<Duration>,
    /// Its emergencies never come.
    pub(super) hides_emergencies: bool,
}

/// One drive's way to its bus.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wire {
    habits: Habits,
    /// What is on its way, the first to come first.
    late: VecDeque<(Instant, Frame)>,
    asleep_until: Option<Instant>,
    /// Its last heartbeat.
    beat: Option<Instant>,
    /// When the next emergency of the storm is due.
    thunder: Option<Instant>,
}

/// What a frame is, to whom its sender is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    BootUp,
    Heartbeat,
    SdoReply,
    Emergency,
    Other,
}

impl Kind {
    fn of<A: Application>(frame: &Frame, device: &Device<A>) -> Self {
        let node = device.node();
        let beats = device.dictionary().unsigned(Object::PRODUCER_HEARTBEAT) > 0;
        if is_boot_up(frame, node) {
            Self::BootUp
        } else if frame.cob_id == heartbeat_cob_id(node) && beats {
            Self::Heartbeat
        } else if frame.cob_id == response_cob_id(node) {
            Self::SdoReply
        } else if emergencies(device) == Some(frame.cob_id) {
            Self::Emergency
        } else {
            Self::Other
        }
    }
}

impl Wire {
    /// A way on which nothing is yet.
    pub(crate) fn new(habits: Habits) -> Self {
        Self { habits, ..Self::default() }
    }

    /// Whether the drive hears what is on the bus.
    pub(crate) fn hears(&self, now: Instant) -> bool {
        self.asleep_until.is_none_or(|awake| now >= awake)
    }

    /// Takes what `device` says now; what comes out of it now is appended to `out`.
    pub(crate) fn carry<A: Application>(
        &mut self,
        now: Instant,
        device: &Device<A>,
        said: impl IntoIterator<Item = Frame>,
        out: &mut Vec<Frame>,
    ) {
        if self.habits == Habits::default() {
            return out.extend(said);
        }
        for frame in said {
            match Kind::of(&frame, device) {
                Kind::BootUp => self.boot_up(now, frame, out),
                _ if !self.hears(now) => {}
                Kind::Heartbeat => out.extend(self.is_time_to_beat(now).then_some(frame)),
                Kind::SdoReply => self.reply(now, frame, out),
                Kind::Emergency => out.extend((!self.habits.hides_emergencies).then_some(frame)),
                Kind::Other => out.push(frame),
            }
        }
        self.come(now, out);
        self.rage(now, device, out);
    }

    /// When [`carry`](Self::carry) must next be called, be it with nothing.
    pub(crate) fn deadline(&self) -> Option<Instant> {
        let late = self.late.front().map(|(at, _)| *at);
        late.into_iter().chain(self.thunder).min()
    }

    /// What was on its way before is lost, as the drive has forgotten what it was asked.
    fn boot_up(&mut self, now: Instant, frame: Frame, out: &mut Vec<Frame>) {
        self.late.clear();
        self.beat = None;
        let frame = (!self.habits.hides_boot_up).then_some(frame);
        if self.habits.boot_delay.is_zero() {
            out.extend(frame);
        } else {
            let awake = now + self.habits.boot_delay;
            self.asleep_until = Some(awake);
            self.late.extend(frame.map(|frame| (awake, frame)));
        }
    }

    fn reply(&mut self, now: Instant, frame: Frame, out: &mut Vec<Frame>) {
        let times = if self.habits.repeats_replies { 2 } else { 1 };
        let replies = std::iter::repeat_n(frame, times);
        if self.habits.reply_delay.is_zero() {
            out.extend(replies);
        } else {
            self.late.extend(replies.map(|frame| (now + self.habits.reply_delay, frame)));
        }
    }

    fn is_time_to_beat(&mut self, now: Instant) -> bool {
        let is_too_soon = self.beat.is_some_and(|last| now < last + self.habits.least_period);
        if !is_too_soon {
            self.beat = Some(now);
        }
        !is_too_soon
    }

    fn come(&mut self, now: Instant, out: &mut Vec<Frame>) {
        while self.late.front().is_some_and(|(at, _)| *at <= now) {
            out.extend(self.late.pop_front().map(|(_, frame)| frame));
        }
    }

    /// The storm, as long as the drive is pre-operational and awake.
    fn rage<A: Application>(&mut self, now: Instant, device: &Device<A>, out: &mut Vec<Frame>) {
        let Some(every) = self.habits.storm else { return };
        if device.state() != NmtState::PreOperational {
            self.thunder = None;
            return;
        }
        let due = *self.thunder.get_or_insert(now);
        if due > now {
            return;
        }
        self.thunder = Some(now + every);
        if self.hears(now) {
            let message = EmergencyMessage {
                error_code: DEVICE_SPECIFIC,
                error_register: ErrorRegister(GENERIC),
                vendor_specific: [0; 5],
            };
            out.extend(emergencies(device).map(|cob_id| Frame::new(cob_id, message.encode())));
        }
    }
}

/// Where a device says its emergencies; `None` where it says none.
fn emergencies<A: Application>(device: &Device<A>) -> Option<u16> {
    let raw = device.dictionary().unsigned(Object::EMCY_COB_ID);
    let identifier = u16::try_from(raw & u32::from(COB_ID_MAX)).ok();
    identifier.filter(|_| raw & COB_ID_INVALID == 0)
}

/// An error only its maker knows (CiA 301, table 26).
const DEVICE_SPECIFIC: u16 = 0xFF00;
/// Bit 0 of the error register.
const GENERIC: u8 = 1;
