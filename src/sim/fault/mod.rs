//! What breaks in the simulated world, when a script says so: it stands between devices and buses, between
//! motors and drives, between fingers and switches.
//!
//! Each fault begins at its time after the first SYNC and is over after its span; then all is as before.
//! Chance is drawn for each fault from a sequence of its own. While none runs, every frame passes untouched
//! and nothing is allocated.
//!
//! Not the commanded side: that asks with [`Faults::link`] how it is.

mod breakable;
mod held;
mod running;
#[cfg(test)]
mod tests;
mod wiring;

pub use breakable::Breakable;
pub use breakable::Way;

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use crate::drivetrain::Sensed;
use crate::fault::held::Held;
use crate::fault::running::Running;
use crate::scenario::fault::Cut;
use crate::scenario::fault::Fault;
use crate::scenario::fault::Kind;
use crate::scenario::fault::Link;
use crate::scenario::fault::Trouble;
use canopen::error_codes;
use canopen::frame::Telegram;
use units::numbering::Joint;
use units::numbering::NodeIndex;
use units::time::Instant;

/// The six drives and the switch box.
pub type Devices<'a> = [&'a mut dyn Breakable; 7];

/// A fault has begun, or is over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Notice {
    /// When, after the first SYNC.
    pub at: Duration,
    /// Which.
    pub fault: Fault,
    /// Whether it is over.
    pub is_over: bool,
}

/// What has happened, without whom it befell: `unplugged`, and `over: unplugged` when it is.
impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { fault, is_over, .. } = self;
        if *is_over { write!(f, "over: {}", fault.kind) } else { write!(f, "{}", fault.kind) }
    }
}

/// The faults of a script, and those that run.
#[derive(Clone, Debug)]
pub struct Faults {
    script: Vec<Fault>,
    /// How many of the script have begun.
    begun: usize,
    seed: u64,
    /// The first SYNC.
    zero: Option<Instant>,
    running: Vec<Running>,
    held: Held,
    notices: VecDeque<Notice>,
    /// Frames on their way, kept for their room.
    said: Vec<Telegram>,
    passed: Vec<Telegram>,
}

impl Faults {
    /// Those of a script, with the chances of a seed.
    pub fn new(script: &[Fault], seed: u64) -> Self {
        let room = script.len();
        Self {
            script: script.to_vec(),
            begun: 0,
            seed,
            zero: None,
            running: Vec::with_capacity(room),
            held: Held::default(),
            notices: VecDeque::with_capacity(2 * room),
            said: Vec::new(),
            passed: Vec::new(),
        }
    }

    /// Time zero of the script is now.
    pub const fn begin(&mut self, now: Instant) {
        self.zero = Some(now);
    }

    /// The oldest that was not asked for yet.
    pub fn notice(&mut self) -> Option<Notice> {
        self.notices.pop_front()
    }

    /// When [`turn`](Self::turn) must next be called.
    pub fn deadline(&self) -> Option<Instant> {
        let next = self.zero.zip(self.script.get(self.begun));
        let next = next.map(|(zero, fault)| zero + fault.begins);
        let ends = self.running.iter().filter_map(|running| running.until);
        let speaks = self.running.iter().filter_map(|running| running.speaks);
        ends.chain(speaks).chain(next).chain(self.held.deadline()).min()
    }

    /// Ends and begins what is due at `now`, and lets late frames come.
    pub fn turn(&mut self, now: Instant, devices: &mut Devices<'_>, out: &mut Vec<Telegram>) {
        let is_over = |running: &Running| running.until.is_some_and(|until| until <= now);
        while let Some(place) = self.running.iter().position(is_over) {
            let over = self.running.remove(place);
            self.end(now, &over, devices);
        }
        // Without an end of its own, a fault that applies no more would be matched against every later frame.
        self.running.retain(|running| running.until.is_some() || !running.is_spent());
        while let Some(fault) = self.next(now) {
            self.start(now, fault, devices, out);
        }
        for running in &mut self.running {
            running.speak(now, out);
        }
        while let Some(late) = self.held.take_due(now) {
            let Some(device) = devices.get_mut(late.place.0) else { continue };
            match late.way {
                _ if self.is_cut_off(late.place) => {}
                Way::Said => out.push(late.telegram),
                Way::Heard => self.let_hear(now, late.place, *device, &late.telegram, out),
            }
        }
    }

    /// What the drive of `joint` senses of its motor, which does `sensed`.
    pub fn sensed(&mut self, joint: Joint, sensed: Sensed) -> Sensed {
        self.running.iter_mut().fold(sensed, |sensed, running| running.sensed(joint, sensed))
    }

    /// The levels at the switch box's terminals, when its switches give `inputs`.
    pub fn inputs(&mut self, inputs: u8) -> u8 {
        self.running.iter_mut().fold(inputs, |inputs, running| running.inputs(inputs))
    }

    /// How the commanded side is reached.
    pub fn link(&self) -> Link {
        let links = self.running.iter().filter_map(|running| match running.fault.kind {
            Kind::Link(link) => Some(link),
            Kind::Cut(_)
            | Kind::Frames(_)
            | Kind::Impersonated { .. }
            | Kind::Trouble(_)
            | Kind::Sense(_)
            | Kind::Contact(..)
            | Kind::Stranger { .. } => None,
        });
        links.max().unwrap_or_default()
    }

    /// The next fault of the script, if it begins by `now`, and its number.
    fn next(&mut self, now: Instant) -> Option<(u64, Fault)> {
        let fault = *self.script.get(self.begun)?;
        let begins = self.zero? + fault.begins;
        if begins > now {
            return None;
        }
        self.begun += 1;
        Some((u64::try_from(self.begun).unwrap_or(0), fault))
    }

    fn start(
        &mut self,
        now: Instant,
        (number, fault): (u64, Fault),
        devices: &mut Devices<'_>,
        out: &mut Vec<Telegram>,
    ) {
        self.note(now, fault, false);
        let mut running = Running::new(fault, now, self.seed ^ number.wrapping_mul(STREAM));
        match fault.kind {
            Kind::Cut(cut) => running.cut(cut, devices),
            Kind::Trouble(trouble) => {
                self.afflict(now, fault, trouble, devices);
                if trouble != Trouble::SafeTorqueOff {
                    return;
                }
            }
            Kind::Impersonated { by, service } => running.impersonate(by, service, devices),
            Kind::Stranger { frame, every: None } => {
                out.extend(fault.whom.bus().map(|channel| Telegram { channel, frame }));
                return;
            }
            Kind::Stranger { every: Some(_), .. } => running.speaks = Some(now),
            Kind::Frames(_) | Kind::Sense(_) | Kind::Contact(..) | Kind::Link(_) => {}
        }
        self.running.push(running);
    }

    /// All is as before.
    fn end(&mut self, now: Instant, over: &Running, devices: &mut Devices<'_>) {
        let fault = over.fault;
        self.note(now, fault, true);
        for (place, device) in NodeIndex::each(devices) {
            let is_back = over.is_cut_off(place) && !self.is_cut_off(place);
            match fault.kind {
                Kind::Cut(Cut::Plug) if is_back => device.switch_on(now),
                Kind::Cut(Cut::BusOff) if is_back => {
                    device
                        .report_transient_error(error_codes::RECOVERED_FROM_BUS_OFF, COMMUNICATION);
                }
                Kind::Trouble(Trouble::SafeTorqueOff) if fault.whom.has(place) => {
                    device.set_safe_torque_off(false);
                }
                Kind::Cut(_)
                | Kind::Frames(_)
                | Kind::Impersonated { .. }
                | Kind::Trouble(_)
                | Kind::Sense(_)
                | Kind::Contact(..)
                | Kind::Stranger { .. }
                | Kind::Link(_) => {}
            }
        }
    }

    /// Something befalls devices themselves.
    fn afflict(&mut self, now: Instant, fault: Fault, trouble: Trouble, devices: &mut Devices<'_>) {
        let befallen = NodeIndex::each(devices).filter(|(place, _)| fault.whom.has(*place));
        for (_, device) in befallen {
            match trouble {
                Trouble::Reboots => {
                    device.switch_off();
                    device.switch_on(now);
                }
                Trouble::Emergency { code, register } => {
                    device.report_transient_error(code, register);
                }
                Trouble::Fails(code) => device.fail_with(code),
                Trouble::SafeTorqueOff => device.set_safe_torque_off(true),
            }
        }
    }

    fn note(&mut self, now: Instant, fault: Fault, is_over: bool) {
        let at = now.since(self.zero.unwrap_or(now));
        self.notices.push_back(Notice { at, fault, is_over });
    }
}

/// Communication error and generic error, of the error register.
const COMMUNICATION: u8 = 0x11;

/// Sets the chances of one fault apart from those of another.
const STREAM: u64 = 0xD1B5_4A32_D192_ED03;
