//! Faults of a scenario, applied between devices and buses, motors and drives, fingers and switches.
//!
//! A fault starts at its time after the first SYNC and ends after its duration, which restores the former state. Each has
//! its own random sequence. Without a running fault, frames pass unchanged and nothing is allocated.
//!
//! The commanded side reads the state of its link with [`Faults::link`].

mod breakable;
mod delay_queue;
pub mod devices;
mod running;
#[cfg(test)]
mod tests;
mod wiring;

pub use breakable::{Breakable, Direction};

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use crate::drivetrain::MotorReading;
use crate::fault::delay_queue::DelayQueue;
use crate::fault::devices::{Devices, present};
use crate::fault::running::{OfDevices, Running};
use canopen::error_codes;
use canopen::frame::Telegram;
use faults::{DeviceFault, Disconnection, Fault, FaultKind, LinkFault};
use units::numbering::Joint;
use units::time::Instant;

/// Start or end of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Notice {
    /// Time after the first SYNC.
    pub at: Duration,
    /// Fault that starts or ends.
    pub fault: Fault,
    /// Set if the fault has ended.
    pub is_over: bool,
}

/// Fault without its target: `unplugged`, and `over: unplugged` at its end.
impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { fault, is_over, .. } = self;
        if *is_over { write!(f, "over: {}", fault.kind) } else { write!(f, "{}", fault.kind) }
    }
}

/// Faults of a scenario's devices and of its link, and those that run.
#[derive(Clone, Debug)]
pub struct Faults {
    script: Vec<Fault>,
    /// Number of faults of the script that have started.
    started: usize,
    seed: u64,
    /// Time of the first SYNC, from which the times of faults count.
    zero: Option<Instant>,
    running: Vec<Running>,
    held: DelayQueue,
    notices: VecDeque<Notice>,
    /// Buffer of frames, kept for its capacity.
    sent: Vec<Telegram>,
    passed: Vec<Telegram>,
}

impl Faults {
    /// Creates the faults of a script, in order of their start, except those of the host, which its bus applies.
    pub fn new(script: &[Fault], seed: u64) -> Self {
        let script: Vec<Fault> =
            script.iter().filter(|fault| !fault.is_of_host()).copied().collect();
        let count = script.len();
        Self {
            script,
            started: 0,
            seed,
            zero: None,
            running: Vec::with_capacity(count),
            held: DelayQueue::default(),
            notices: VecDeque::with_capacity(2 * count),
            sent: Vec::new(),
            passed: Vec::new(),
        }
    }

    /// Sets time zero of the script.
    pub const fn begin(&mut self, now: Instant) {
        self.zero = Some(now);
    }

    /// Takes the oldest start or end of a fault.
    pub fn next_notice(&mut self) -> Option<Notice> {
        self.notices.pop_front()
    }

    /// Returns the time at which [`on_time`](Self::on_time) must next be called.
    pub fn deadline(&self) -> Option<Instant> {
        let next = self.zero.zip(self.script.get(self.started));
        let next = next.map(|(zero, fault)| zero + fault.start);
        let ends = self.running.iter().filter_map(|running| running.until);
        let foreign = self.running.iter().filter_map(|running| running.sends);
        ends.chain(foreign).chain(next).chain(self.held.deadline()).min()
    }

    /// Ends and starts faults whose time has come at `now`, and delivers delayed frames.
    pub fn on_time(&mut self, now: Instant, devices: &mut Devices<'_>, out: &mut Vec<Telegram>) {
        let is_over = |running: &Running| running.until.is_some_and(|until| until <= now);
        while let Some(place) = self.running.iter().position(is_over) {
            let over = self.running.remove(place);
            self.end(now, &over, devices);
        }
        // A fault without an end is removed once its count is used, so that later frames need not be compared with it.
        self.running.retain(|running| running.until.is_some() || !running.is_spent());
        while let Some(fault) = self.next(now) {
            self.start(now, fault, devices, out);
        }
        for running in &mut self.running {
            running.send_foreign(now, out);
        }
        while let Some(delayed) = self.held.take_due(now) {
            let Some(Some(device)) = devices.get_mut(delayed.place.0) else { continue };
            match delayed.direction {
                _ if self.is_disconnected(delayed.place) => {}
                Direction::FromDevice => out.push(delayed.telegram),
                Direction::ToDevice => {
                    self.deliver_passed(now, delayed.place, *device, &delayed.telegram, out);
                }
            }
        }
    }

    /// Returns the measured values of the drive of `joint`; `sensed` are the true ones.
    pub fn sensed(&mut self, joint: Joint, sensed: MotorReading) -> MotorReading {
        self.running.iter_mut().fold(sensed, |sensed, running| running.sensed(joint, sensed))
    }

    /// Returns the levels at the terminals of the switch box; `inputs` are those of the switches.
    pub fn inputs(&mut self, inputs: u8) -> u8 {
        self.running.iter_mut().fold(inputs, |inputs, running| running.inputs(inputs))
    }

    /// Returns the worst fault of the link to the commanded side.
    pub fn link(&self) -> Option<LinkFault> {
        let links = self.running.iter().filter_map(|running| {
            let FaultKind::Link(link) = running.fault.kind else { return None };
            Some(link)
        });
        links.max()
    }

    /// Takes the next fault of the script if it is due, with its number.
    fn next(&mut self, now: Instant) -> Option<(u64, Fault)> {
        let fault = *self.script.get(self.started)?;
        let start = self.zero? + fault.start;
        if start > now {
            return None;
        }
        self.started += 1;
        Some((u64::try_from(self.started).unwrap_or(0), fault))
    }

    fn start(
        &mut self,
        now: Instant,
        (number, fault): (u64, Fault),
        devices: &mut Devices<'_>,
        out: &mut Vec<Telegram>,
    ) {
        self.notify(now, fault, false);
        let mut running = Running::new(fault, now, self.seed ^ number.wrapping_mul(STREAM));
        match fault.kind {
            FaultKind::Disconnection(how) => running.disconnect(how, devices),
            FaultKind::Device(what) => {
                apply(now, fault, what, devices);
                if what.is_momentary() {
                    return;
                }
            }
            FaultKind::Imitation { by, service } => running.imitate(by, service, devices),
            FaultKind::ForeignFrame { frame, period: None } => {
                out.extend(fault.target.bus().map(|channel| Telegram { channel, frame }));
                return;
            }
            FaultKind::ForeignFrame { period: Some(_), .. } => running.sends = Some(now),
            FaultKind::Frames(_)
            | FaultKind::Sensor(_)
            | FaultKind::Contact(..)
            | FaultKind::Link(_)
            | FaultKind::SensedForce(_)
            | FaultKind::Bus(_)
            | FaultKind::Host(_) => {}
        }
        self.running.push(running);
    }

    /// Restores what an ended fault had changed, unless another one still does.
    fn end(&mut self, now: Instant, over: &Running, devices: &mut Devices<'_>) {
        let fault = over.fault;
        self.notify(now, fault, true);
        for (place, device) in present(devices) {
            let is_back = over.is_disconnected(place) && !self.is_disconnected(place);
            match fault.kind {
                FaultKind::Disconnection(Disconnection::Unplugged) if is_back => {
                    device.switch_on(now);
                }
                FaultKind::Disconnection(Disconnection::BusOff) if is_back => {
                    device.send_emergency(error_codes::RECOVERED_FROM_BUS_OFF, COMMUNICATION);
                }
                FaultKind::Device(DeviceFault::SafeTorqueOff) if fault.target.has(place) => {
                    device.set_safe_torque_off(false);
                }
                FaultKind::Device(DeviceFault::ControlwordIgnored) if fault.target.has(place) => {
                    device.set_ignores_controlword(false);
                }
                FaultKind::Disconnection(_)
                | FaultKind::Frames(_)
                | FaultKind::Imitation { .. }
                | FaultKind::Device(_)
                | FaultKind::Sensor(_)
                | FaultKind::Contact(..)
                | FaultKind::ForeignFrame { .. }
                | FaultKind::Link(_)
                | FaultKind::SensedForce(_)
                | FaultKind::Bus(_)
                | FaultKind::Host(_) => {}
            }
        }
    }

    fn notify(&mut self, now: Instant, fault: Fault, is_over: bool) {
        let at = now.since(self.zero.unwrap_or(now));
        self.notices.push_back(Notice { at, fault, is_over });
    }
}

/// Applies a fault to the devices that it targets.
fn apply(now: Instant, fault: Fault, what: DeviceFault, devices: &mut Devices<'_>) {
    let targets = present(devices).filter(|(place, _)| fault.target.has(*place));
    for (_, device) in targets {
        match what {
            DeviceFault::Reboot => {
                device.switch_off();
                device.switch_on(now);
            }
            DeviceFault::Emergency { code, register } => device.send_emergency(code, register),
            DeviceFault::DriveFault(code) => device.fail_with(code),
            DeviceFault::SafeTorqueOff => device.set_safe_torque_off(true),
            DeviceFault::ControlwordIgnored => device.set_ignores_controlword(true),
            DeviceFault::TorqueOffset(per_mille) => device.set_torque_offset(per_mille),
        }
    }
}

/// Communication error and generic error, of the error register.
const COMMUNICATION: u8 = 0x11;

/// Separates the random sequences of the faults.
const STREAM: u64 = 0xD1B5_4A32_D192_ED03;
