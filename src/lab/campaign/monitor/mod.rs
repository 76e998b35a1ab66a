//! A judge on the bus: sees every frame that was complete, and whose it was, and knows what must never be.
//!
//! It decodes by itself, from the configuration alone, and never asks the node; what the console was
//! answered it is told, as an operator would be. Nothing it does can be seen by the node.
//!
//! | file     | laws                                              |
//! |----------|---------------------------------------------------|
//! | `torque` | what is asked of the motors: I1 to I4, I11        |
//! | `rhythm` | when: I5, I7, I10                                 |
//! | `grip`   | when the deadman may engage: I3                   |
//! | `age`    | how late what the node gave away is on the wire   |
//! | `order`  | of whom, and in which order: I6, I8, I9, I12      |
//! | `sheet`  | what the configuration says                       |
//! | `law`    | their names, and what is noted of a breach        |

mod age;
mod grip;
mod law;
mod order;
mod rhythm;
mod sheet;
#[cfg(test)]
mod tests;
mod torque;

pub use law::Breach;
pub use law::Law;
pub use rhythm::Excuse;

use std::sync::Arc;
use std::time::Duration;

use crate::campaign::monitor::age::Age;
use crate::campaign::monitor::grip::Grip;
use crate::campaign::monitor::law::Breaches;
use crate::campaign::monitor::order::Order;
use crate::campaign::monitor::rhythm::Rhythm;
use crate::campaign::monitor::sheet::Sheet;
use crate::campaign::monitor::sheet::Told;
use crate::campaign::monitor::torque::Torque;
use bus::Tap;
use canopen::frame::Channel;
use canopen::frame::Telegram;
use canopen::sync;
use config::Config;
use node::Request;
use node::record::Mode;
use units::time::Instant;

/// The judge, with what it has seen.
#[derive(Clone, Debug)]
pub struct Monitor {
    sheet: Arc<Sheet>,
    torque: Torque,
    rhythm: Rhythm,
    order: Order,
    age: Age,
    grip: Grip,
    breaches: Breaches,
    log: Option<Vec<(Instant, Telegram)>>,
}

impl Monitor {
    /// Of a network on which nothing was said yet.
    pub fn new(config: &Config) -> Self {
        let sheet = Sheet::new(config);
        Self {
            torque: Torque::new(),
            rhythm: Rhythm::new(&sheet, config.buses.len()),
            order: Order::new(&sheet),
            age: Age::new(config.buses.len()),
            grip: Grip::default(),
            sheet: Arc::new(sheet),
            breaches: Breaches::default(),
            log: None,
        }
    }

    /// The same, which also keeps every frame.
    #[must_use]
    pub fn keeping_frames(self) -> Self {
        Self { log: Some(Vec::new()), ..self }
    }

    /// Every frame, if they are kept.
    pub fn frames(&self) -> &[(Instant, Telegram)] {
        self.log.as_deref().unwrap_or_default()
    }

    /// The console was asked this, and the node is in `mode` because of it; `None` if it refused.
    pub fn asked(&mut self, at: Instant, request: Request, mode: Option<Mode>) {
        match (request, mode) {
            (_, None) | (Request::Command(_), _) => {}
            (Request::Arm, Some(_)) => self.torque.armed(at, &mut self.breaches),
            (Request::Reset, Some(Mode::Armed)) => self.torque.go_on(),
            (Request::Disarm | Request::Reset, Some(_)) => self.torque.idle(at),
        }
    }

    /// The node says what mode it is in.
    pub fn told(&mut self, at: Instant, mode: Mode) {
        if mode.is_stopped() {
            self.torque.tripped(at);
        }
        self.grip.told(&self.sheet, at, mode, &mut self.breaches);
    }

    /// Bus or process are broken, so that I5 is nobody's fault.
    pub fn excuse(&mut self, excuse: Excuse) {
        self.rhythm.excuse(excuse);
    }

    /// What was broken, in words: the first few.
    pub fn breaches(&self) -> &[Breach] {
        self.breaches.first()
    }

    /// How often something was broken.
    pub const fn breach_count(&self) -> u64 {
        self.breaches.count()
    }

    /// Targets that were not zero although nothing was armed.
    pub const fn unarmed_frames(&self) -> u64 {
        self.torque.unarmed
    }

    /// Targets on the wire that were not zero, and more than two periods old.
    pub const fn stale_targets(&self) -> u64 {
        self.age.delivered
    }

    /// Returns how old each joint's target in force was when it began to act, on a drive that is on: from the moment
    /// the node gave it away. Zero where it asks for no torque.
    pub const fn acting_ages(&self) -> [Duration; 6] {
        self.age.acting()
    }

    /// Returns whether a target of this age is stale.
    pub fn is_stale(&self, age: Duration) -> bool {
        age > age::stale(self.sheet.period)
    }

    /// Since when every joint is told zero, if it is.
    pub fn all_zero_since(&self) -> Option<Instant> {
        self.torque.all_zero_since()
    }

    /// Cycles between the first and the last joint that was torn from a torque to none.
    pub fn spread(&self) -> Option<u64> {
        self.torque.spread(self.sheet.period)
    }

    /// The largest share of its capacity that a joint is told, 0 to 1.
    pub fn peak(&self) -> f64 {
        self.torque.peak(&self.sheet)
    }

    /// What was seen so far is past; what is known stays.
    pub fn forget(&mut self) {
        self.breaches.forget();
        self.torque.unarmed = 0;
        self.age.delivered = 0;
    }

    fn keep(&mut self, at: Instant, telegram: &Telegram) {
        self.log.iter_mut().for_each(|log| log.push((at, *telegram)));
    }
}

impl Tap for Monitor {
    fn on_wire(&mut self, at: Instant, telegram: &Telegram) {
        self.keep(at, telegram);
        self.order.on_heard(&self.sheet, at, (telegram.channel, &telegram.frame));
        if let Some(Ok(heard)) = self.sheet.inbox.read(telegram) {
            self.torque.on_tpdo(at, &heard);
            self.order.on_tpdo(&heard);
            self.grip.on_tpdo(&heard);
        }
    }

    fn on_taken(&mut self, at: Instant, telegram: &Telegram) {
        let Telegram { channel, frame } = *telegram;
        self.age.on_taken(at, telegram);
        let said = ((channel, &frame), self.order.are_proven(&self.sheet));
        self.rhythm.on_taken(&self.sheet, at, said, &mut self.breaches);
    }

    fn on_sent(&mut self, at: Instant, telegram: &Telegram) {
        self.keep(at, telegram);
        let Self { sheet, torque, rhythm, order, age, breaches, .. } = self;
        let Telegram { channel, frame } = *telegram;
        let since = age.on_sent(at, telegram);
        if frame.cob_id == sync::COB_ID {
            age.on_sync(sheet, at, channel);
            if channel == Channel(0) {
                torque.on_sync();
            }
        }
        rhythm.on_sent(sheet, (at, since), (channel, &frame), breaches);
        order.on_sent(sheet, at, (channel, &frame), breaches);
        let Some((_, rpdo)) = sheet.rpdo(channel, &frame) else { return };
        for told in rpdo.read(&frame) {
            match told {
                Told::Target(joint, target) => {
                    let is_off = order.is_off(joint);
                    age.on_target(sheet, (at, since), (joint, target));
                    torque.on_target(sheet, (at, since), ((joint, target), is_off), breaches);
                    order.on_target(sheet, at, (joint, target), breaches);
                }
                Told::Controlword(joint, word) => {
                    order.on_controlword(sheet, at, (joint, word), breaches);
                }
            }
        }
    }
}
