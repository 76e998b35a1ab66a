//! What is wrong with a device, told by emergencies (CiA 301, 7.2.7) and in the error register (1001h).
//!
//! An error is told once when it comes; `0000h` once the last one is gone. Between two emergencies lies
//! their inhibit time (1015h): what comes sooner waits its turn. What a device does about an error is its
//! application's business.

use std::collections::VecDeque;
use std::time::Duration;

use canopen_rs::EmergencyMessage;
use canopen_rs::emcy::ErrorRegister;

use crate::device::condition::Condition;
use crate::device::condition::Conditions;
use crate::device::history;
use crate::device::parameter::cob_id;
use crate::dictionary::Dictionary;
use crate::frame::Frame;
use crate::object::Object;
use units::time::Instant;

/// Everything that is wrong now, and what is still to be told of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Errors {
    conditions: Conditions,
    /// Of the application, 0 for none.
    code: u16,
    /// Told last.
    told: u16,
    /// Where emergencies go, `None` while they are off.
    cob_id: Option<u16>,
    /// Whether the NMT state allows them.
    may_send: bool,
    /// Between two emergencies.
    inhibit: Duration,
    /// Not before.
    inhibited: Instant,
    waiting: VecDeque<Frame>,
}

/// How many emergencies wait at most. Of more the oldest is not told; the history has it.
const MOST_WAITING: usize = 16;

impl Errors {
    /// Reads where emergencies go (1014h), and how often (1015h).
    pub(super) fn configure(&mut self, dictionary: &Dictionary) {
        self.cob_id = cob_id(dictionary.unsigned(Object::EMCY_COB_ID));
        let inhibit = u64::from(dictionary.unsigned(Object::EMCY_INHIBIT_TIME));
        self.inhibit = Duration::from_micros(100 * inhibit);
    }

    /// Whether the NMT state allows emergencies. Where it does not, none waits for another.
    pub(super) fn allow(&mut self, may_send: bool) {
        self.may_send = may_send;
        if !may_send {
            self.waiting.clear();
        }
    }

    /// Something is wrong; told if it was not before. `manufacturer` is for the manufacturer's bytes.
    pub(super) fn raise(
        &mut self,
        condition: Condition,
        manufacturer: [u8; 5],
        dictionary: &mut Dictionary,
    ) {
        if !self.conditions.has(condition) {
            self.conditions.set(condition, true);
            self.tell(condition.code(), manufacturer, dictionary);
        }
    }

    /// Something is right again.
    pub(super) fn settle(&mut self, condition: Condition, dictionary: &mut Dictionary) {
        if !self.conditions.has(condition) {
            return;
        }
        self.conditions.set(condition, false);
        if self.conditions.is_empty() {
            self.tell(0, [0; 5], dictionary);
        } else {
            dictionary.set(Object::ERROR_REGISTER, &[self.register()]);
        }
    }

    /// The application has this error, or none with code 0. What has just been told is not repeated.
    pub(super) fn of_application(&mut self, code: u16, dictionary: &mut Dictionary) {
        if code == self.code {
            return;
        }
        self.code = code;
        if code == 0 {
            self.settle(Condition::Application, dictionary);
        } else {
            self.conditions.set(Condition::Application, true);
            if self.told == code {
                dictionary.set(Object::ERROR_REGISTER, &[self.register()]);
            } else {
                self.tell(code, [0; 5], dictionary);
            }
        }
    }

    /// Something was wrong and is no more: told, and in the history, but not in 1001h. `register` says of
    /// what class it was.
    pub(super) fn report_transient_error(
        &mut self,
        code: u16,
        register: u8,
        dictionary: &mut Dictionary,
    ) {
        history::remember(code, dictionary);
        self.queue(code, self.register() | register, [0; 5]);
    }

    /// Whether an application with this error, or none with code 0, has something to tell.
    pub(super) const fn is_news(&self, code: u16) -> bool {
        self.code != code
    }

    /// After a reset: all is forgotten but the application's error, of which no word is said.
    pub(super) fn reset(&mut self, code: u16, dictionary: &mut Dictionary) {
        *self = Self { code, ..Self::default() };
        self.conditions.set(Condition::Application, code != 0);
        self.configure(dictionary);
        dictionary.set(Object::ERROR_REGISTER, &[self.register()]);
    }

    /// Sends the emergencies whose time has come.
    pub(super) fn send(&mut self, now: Instant, out: &mut Vec<Frame>) {
        while self.inhibited <= now {
            let Some(frame) = self.waiting.pop_front() else { return };
            out.push(frame);
            self.inhibited = now + self.inhibit;
        }
    }

    /// When an emergency that waits may go.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.waiting.front().map(|_| self.inhibited)
    }

    fn tell(&mut self, code: u16, manufacturer: [u8; 5], dictionary: &mut Dictionary) {
        self.told = code;
        let register = self.register();
        dictionary.set(Object::ERROR_REGISTER, &[register]);
        if code != 0 {
            history::remember(code, dictionary);
        }
        self.queue(code, register, manufacturer);
    }

    fn queue(&mut self, code: u16, register: u8, manufacturer: [u8; 5]) {
        let message = EmergencyMessage {
            error_code: code,
            error_register: ErrorRegister(register),
            vendor_specific: manufacturer,
        };
        let Some(cob_id) = self.cob_id.filter(|_| self.may_send) else { return };
        if self.waiting.len() == MOST_WAITING {
            self.waiting.pop_front();
        }
        self.waiting.push_back(Frame::new(cob_id, message.encode()));
    }

    /// The classes of all errors there are now (1001h).
    const fn register(&self) -> u8 {
        let class = match self.code >> 8 {
            0x20..=0x2F => CURRENT,
            0x30..=0x3F => VOLTAGE,
            0x40..=0x4F => TEMPERATURE,
            0x81 | 0x82 => COMMUNICATION,
            0x70..=0x80 | 0x83..=0x8F | 0xF0 => DEVICE_PROFILE,
            0xFF => MANUFACTURER,
            _ => 0,
        };
        if self.conditions.is_empty() {
            0
        } else if self.conditions.is_of_communication() {
            GENERIC | COMMUNICATION | class
        } else {
            GENERIC | class
        }
    }
}

const GENERIC: u8 = 0x01;
const CURRENT: u8 = 0x02;
const VOLTAGE: u8 = 0x04;
const TEMPERATURE: u8 = 0x08;
const COMMUNICATION: u8 = 0x10;
const DEVICE_PROFILE: u8 = 0x20;
const MANUFACTURER: u8 = 0x80;
