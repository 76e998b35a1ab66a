//! Monitor: a tap that receives every complete frame with its sender, and checks the invariants I1 to I13.
//!
//! It decodes frames from the configuration alone, without the node's state. Answers of the console are reported to it, as
//! to an operator. It has no effect on the node.
//!
//! | file           | invariants                                             |
//! |----------------|--------------------------------------------------------|
//! | `torque`       | target torques: I1 to I4, I11                          |
//! | `rhythm`       | times of frames: I5, I7                                |
//! | `spacing`      | distances of SYNCs: I10                                |
//! | `grip`         | engagement by the deadman: I3                          |
//! | `age`          | age of targets on the wire                             |
//! | `order`        | order of boot, enabling and stop: I6, I8, I9, I12, I13 |
//! | `drive_timers` | proof of the timers that stop a drive                  |
//! | `sheet`        | the monitor's own interpretation of the configuration  |
//! | `invariant`    | names of the invariants, and their violations          |

mod age;
mod drive_timers;
mod grip;
mod invariant;
pub mod mode_class;
mod order;
mod rhythm;
mod sheet;
mod spacing;
#[cfg(test)]
mod tests;
mod torque;

pub(super) use age::stale;
pub use invariant::{Invariant, Violation};
pub(super) use order::is_off;
pub use rhythm::Exemption;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use crate::monitor::age::Age;
use crate::monitor::grip::Grip;
use crate::monitor::invariant::{Moment, Violations};
use crate::monitor::mode_class::ModeClass;
use crate::monitor::order::Order;
use crate::monitor::rhythm::Rhythm;
use crate::monitor::sheet::{Command, Sheet};
use crate::monitor::torque::Torque;
use bus::Tap;
use canopen::frame::{Channel, Telegram};
use canopen::master::event::Event;
use canopen::sync;
use config::Config;
use units::numbering::Joint;
use units::time::Instant;

/// Answer of the console to a granted request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Answer to the request to arm.
    Armed,
    /// Reset, and armed as before.
    ResetToArmed,
    /// Disarmed, or reset without arming.
    Disarmed,
}

/// Monitor with the state of its network.
#[derive(Clone, Debug)]
pub struct Monitor {
    sheet: Arc<Sheet>,
    torque: Torque,
    rhythm: Rhythm,
    order: Order,
    age: Age,
    grip: Grip,
    violations: Violations,
    log: Option<Log>,
}

/// Frames and events of the node since the boot.
#[derive(Clone, Debug, Default)]
struct Log {
    frames: Vec<(Instant, Telegram)>,
    /// Events that were not taken yet, with the times at which the node reported them.
    events: VecDeque<(Instant, Event)>,
}

impl Monitor {
    /// Creates the monitor of a network before its first frame.
    pub fn new(config: &Config) -> Self {
        let sheet = Sheet::new(config);
        Self {
            torque: Torque::new(),
            rhythm: Rhythm::new(&sheet),
            order: Order::new(&sheet),
            age: Age::new(config.buses.len()),
            grip: Grip::default(),
            sheet: Arc::new(sheet),
            violations: Violations::default(),
            log: None,
        }
    }

    /// Returns the monitor with a log of every frame and event.
    #[must_use]
    pub fn with_log(self) -> Self {
        Self { log: Some(Log::default()), ..self }
    }

    /// Returns the log of frames; empty without one.
    pub fn frames(&self) -> &[(Instant, Telegram)] {
        self.log.as_ref().map(|log| &*log.frames).unwrap_or_default()
    }

    /// Takes the oldest event of the log, and its time.
    pub fn next_event(&mut self) -> Option<(Instant, Event)> {
        self.log.as_mut()?.events.pop_front()
    }

    /// Takes an answer of the console.
    pub fn on_answer(&mut self, at: Instant, answer: Answer) {
        match answer {
            Answer::Armed => {
                let Self { sheet, violations, torque, .. } = self;
                torque.on_armed(&mut Moment { sheet, at, violations });
            }
            Answer::ResetToArmed => self.torque.resume(),
            Answer::Disarmed => self.torque.on_disarmed(at),
        }
    }

    /// Takes the node's mode after a cycle.
    pub fn on_mode(&mut self, at: Instant, mode: ModeClass) {
        if mode == ModeClass::Stopped {
            self.torque.on_stop(at);
        }
        let Self { sheet, violations, grip, .. } = self;
        grip.on_mode(&mut Moment { sheet, at, violations }, mode);
    }

    /// Exempts a bus or the process from I5.
    pub fn exempt(&mut self, exemption: Exemption) {
        self.rhythm.exempt(exemption);
    }

    /// Returns the first violations.
    pub fn violations(&self) -> &[Violation] {
        self.violations.first()
    }

    /// Returns the number of violations.
    pub const fn violation_count(&self) -> u64 {
        self.violations.count()
    }

    /// Returns the number of non-zero targets without arming.
    pub const fn unarmed_frames(&self) -> u64 {
        self.torque.unarmed
    }

    /// Returns the number of non-zero targets that were more than two periods old on the wire.
    pub const fn stale_targets(&self) -> u64 {
        self.age.delivered
    }

    /// Returns for each joint the age of its target, since the node sent it, when it began to act. Zero for a target of
    /// zero.
    pub const fn acting_ages(&self) -> [Duration; 6] {
        self.age.acting()
    }

    /// Returns whether a target of this age is stale.
    pub fn is_stale(&self, age: Duration) -> bool {
        age > stale(self.sheet.period)
    }

    /// Returns the last target sent to a joint, in ‰ of rated torque.
    pub fn target(&self, joint: Joint) -> i16 {
        self.order.target(joint)
    }

    /// Returns the time since which every target is zero.
    pub fn all_zero_since(&self) -> Option<Instant> {
        self.torque.all_zero_since()
    }

    /// Returns the cycles between the first and the last joint whose torque was cut to zero.
    pub fn spread(&self) -> Option<u64> {
        self.torque.spread(self.sheet.period)
    }

    /// Returns the largest target as a share of its joint's capacity, 0 to 1.
    pub fn peak(&self) -> f64 {
        self.torque.peak(&self.sheet)
    }

    /// Clears violations and counts, but not the state of the network.
    pub fn forget(&mut self) {
        self.violations.forget();
        self.torque.unarmed = 0;
        self.age.delivered = 0;
    }

    fn keep(&mut self, at: Instant, telegram: &Telegram) {
        self.log.iter_mut().for_each(|log| log.frames.push((at, *telegram)));
    }
}

impl Tap for Monitor {
    fn on_wire(&mut self, at: Instant, telegram: &Telegram) {
        self.keep(at, telegram);
        self.rhythm.on_wire(at, telegram);
        self.order.on_wire(&self.sheet, at, telegram);
        if let Some(Ok(sample)) = self.sheet.tpdos.read(telegram) {
            self.torque.on_tpdo(at, &sample);
            // A stopped process discards frames that arrive meanwhile.
            let is_received = !self.rhythm.is_process_exempt(at);
            self.order.on_tpdo(at, &sample, is_received);
            self.grip.on_tpdo(&sample);
        }
    }

    /// Takes an event into the log; without one the node keeps it.
    fn on_event(&mut self, at: Instant, event: Event) -> Option<Event> {
        let Some(log) = &mut self.log else { return Some(event) };
        log.events.push_back((at, event));
        None
    }

    fn on_taken(&mut self, at: Instant, telegram: &Telegram) {
        let Self { sheet, violations, rhythm, order, age, .. } = self;
        age.on_taken(at, telegram);
        let is_driven = order.are_driven(sheet);
        rhythm.on_taken(&mut Moment { sheet, at, violations }, telegram, is_driven);
    }

    fn on_sent(&mut self, at: Instant, telegram: &Telegram) {
        self.keep(at, telegram);
        let Self { sheet, torque, rhythm, order, age, violations, .. } = self;
        let Telegram { channel, frame } = *telegram;
        let since = age.on_sent(at, telegram);
        rhythm.on_wire(at, telegram);
        if frame.cob_id == sync::COB_ID {
            age.on_sync(sheet, at, channel);
            if channel == Channel(0) {
                torque.on_sync();
            }
        }
        let moment = &mut Moment { sheet, at, violations };
        rhythm.on_sent(moment, since, telegram);
        order.on_sent(moment, telegram);
        let Some((_, rpdo)) = sheet.rpdo(channel, &frame) else { return };
        for command in rpdo.read(&frame) {
            match command {
                Command::Target(joint, target) => {
                    let is_off = order.is_off(joint);
                    age.on_target(sheet, (at, since), (joint, target));
                    torque.on_target(moment, since, (joint, target), is_off);
                    order.on_target(moment, joint, target);
                }
                Command::Controlword(joint, word) => {
                    order.on_controlword(moment, joint, word);
                }
            }
        }
    }
}
