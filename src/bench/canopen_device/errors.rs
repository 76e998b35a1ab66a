//! Errors of a device: emergencies (CiA 301, 7.2.7) and error register (1001h).
//!
//! An emergency is sent once when an error occurs, and `0000h` once the last one is gone. Emergencies within
//! the inhibit time (1015h) are queued. The reaction is the application's.

use std::collections::VecDeque;
use std::time::Duration;

use canopen_rs::EmergencyMessage;
use canopen_rs::emcy::ErrorRegister;

use crate::condition::{Condition, Conditions};
use crate::dictionary::Dictionary;
use crate::history;
use crate::parameter::cob_id;
use canopen::frame::Frame;
use canopen::object::Object;
use units::time::Instant;

/// Present errors, and emergencies to be sent.
#[derive(Clone, Debug, Default)]
pub(super) struct Errors {
    conditions: Conditions,
    /// Error code of the application, 0 for none.
    code: u16,
    /// Last reported error code.
    reported: u16,
    /// COB-ID of emergencies; `None` while they are disabled.
    cob_id: Option<u16>,
    /// Set if the NMT state allows emergencies.
    may_send: bool,
    /// Minimum time between two emergencies.
    inhibit: Duration,
    /// Earliest time of the next emergency.
    inhibited: Instant,
    waiting: VecDeque<Frame>,
}

/// Maximum queued emergencies. More drop the oldest one; the error history still has it.
const MAX_QUEUED: usize = 16;

impl Errors {
    /// Applies COB-ID (1014h) and inhibit time (1015h).
    pub(super) fn configure(&mut self, dictionary: &Dictionary) {
        self.cob_id = cob_id(dictionary.unsigned(Object::EMCY_COB_ID));
        let inhibit = u64::from(dictionary.unsigned(Object::EMCY_INHIBIT_TIME));
        self.inhibit = Duration::from_micros(100 * inhibit);
    }

    /// Sets whether the NMT state allows emergencies; queued ones are dropped if not.
    pub(super) fn allow(&mut self, may_send: bool) {
        self.may_send = may_send;
        if !may_send {
            self.waiting.clear();
        }
    }

    /// Sets a condition and reports it if it is new, with `manufacturer` in the manufacturer's bytes.
    pub(super) fn raise(
        &mut self,
        condition: Condition,
        manufacturer: [u8; 5],
        dictionary: &mut Dictionary,
    ) {
        if !self.conditions.has(condition) {
            self.conditions.set(condition, true);
            self.report(condition.code(), manufacturer, dictionary);
        }
    }

    /// Ends a condition. If no condition remains, sends an EMCY with error code 0 (error reset).
    pub(super) fn clear(&mut self, condition: Condition, dictionary: &mut Dictionary) {
        if !self.conditions.has(condition) {
            return;
        }
        self.conditions.set(condition, false);
        if self.conditions.is_empty() {
            self.report(0, [0; 5], dictionary);
        } else {
            dictionary.set(Object::ERROR_REGISTER, &[self.register()]);
        }
    }

    /// Sets the application's error, 0 for none. The code reported last is not repeated.
    pub(super) fn set_application_error(&mut self, code: u16, dictionary: &mut Dictionary) {
        if code == self.code {
            return;
        }
        self.code = code;
        if code == 0 {
            self.clear(Condition::Application, dictionary);
        } else {
            self.conditions.set(Condition::Application, true);
            if self.reported == code {
                dictionary.set(Object::ERROR_REGISTER, &[self.register()]);
            } else {
                self.report(code, [0; 5], dictionary);
            }
        }
    }

    /// Reports a transient error: in an emergency and in the history, but not in 1001h. `register` gives its
    /// class.
    pub(super) fn report_transient_error(
        &mut self,
        code: u16,
        register: u8,
        dictionary: &mut Dictionary,
    ) {
        history::remember(code, dictionary);
        self.queue(code, self.register() | register, [0; 5]);
    }

    /// Returns whether the application's error has changed.
    pub(super) const fn has_changed(&self, code: u16) -> bool {
        self.code != code
    }

    /// Resets all but the application's error, which is not reported again.
    pub(super) fn reset(&mut self, code: u16, dictionary: &mut Dictionary) {
        *self = Self { code, ..Self::default() };
        self.conditions.set(Condition::Application, code != 0);
        self.configure(dictionary);
        dictionary.set(Object::ERROR_REGISTER, &[self.register()]);
    }

    /// Sends the queued emergencies that are due.
    pub(super) fn send(&mut self, now: Instant, out: &mut Vec<Frame>) {
        while self.inhibited <= now {
            let Some(frame) = self.waiting.pop_front() else { return };
            out.push(frame);
            self.inhibited = now + self.inhibit;
        }
    }

    /// Time of the next queued emergency.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.waiting.front().map(|_| self.inhibited)
    }

    fn report(&mut self, code: u16, manufacturer: [u8; 5], dictionary: &mut Dictionary) {
        self.reported = code;
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
        if self.waiting.len() == MAX_QUEUED {
            self.waiting.pop_front();
        }
        self.waiting.push_back(Frame::new(cob_id, message.encode()));
    }

    /// Error register (1001h): classes of all present errors.
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
