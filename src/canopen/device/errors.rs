//! What is wrong with a device, told by emergencies (CiA 301, 7.2.7), in the error register (1001h) and
//! in the history (1003h).
//!
//! An error is told once when it comes; `0000h` once the last one is gone. What a device does about an
//! error is its application's business.

use canopen_rs::EmergencyMessage;
use canopen_rs::emcy::ErrorRegister;

use crate::canopen::device::mapping::byte;
use crate::canopen::device::parameter::cob_id;
use crate::canopen::dictionary::Dictionary;
use crate::canopen::frame::Frame;
use crate::canopen::object::Object;

/// The master does not communicate any more.
pub(super) const COMMUNICATION_LOST: u16 = 0x8100;
/// No heartbeat of the master for too long.
pub(super) const HEARTBEAT_LOST: u16 = 0x8130;
/// A PDO of another length than its mapping.
pub(super) const WRONG_LENGTH: u16 = 0x8210;
/// A SYNC with a counter where none is expected, or without one.
pub(super) const SYNC_LENGTH: u16 = 0x8240;
/// No RPDO for too long.
pub(super) const RPDO_TIMEOUT: u16 = 0x8250;

/// What may be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Condition {
    HeartbeatLost,
    RpdoTimeout,
    WrongLength,
    SyncLength,
    /// Of the application.
    Application,
}

impl Condition {
    const fn bit(self) -> u8 {
        match self {
            Self::HeartbeatLost => 1,
            Self::RpdoTimeout => 2,
            Self::WrongLength => 4,
            Self::Application => 8,
            Self::SyncLength => 16,
        }
    }
}

/// Everything that is wrong now.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Errors {
    conditions: u8,
    /// Of the application, 0 for none.
    code: u16,
    /// Told last.
    told: u16,
    /// Where emergencies go, `None` while they are off.
    cob_id: Option<u16>,
    /// Whether the NMT state allows them.
    pub(super) may_send: bool,
}

impl Errors {
    /// Reads where emergencies go (1014h).
    pub(super) fn configure(&mut self, dictionary: &Dictionary) {
        self.cob_id = cob_id(dictionary.unsigned(Object::EMCY_COB_ID));
    }

    /// Something is wrong; told if it was not before. `manufacturer` is for the manufacturer's bytes.
    pub(super) fn raise(
        &mut self,
        condition: Condition,
        code: u16,
        manufacturer: [u8; 5],
        dictionary: &mut Dictionary,
        out: &mut Vec<Frame>,
    ) {
        if self.conditions & condition.bit() == 0 {
            self.conditions |= condition.bit();
            self.tell(code, manufacturer, dictionary, out);
        }
    }

    /// Something is right again.
    pub(super) fn settle(
        &mut self,
        condition: Condition,
        dictionary: &mut Dictionary,
        out: &mut Vec<Frame>,
    ) {
        if self.conditions & condition.bit() == 0 {
            return;
        }
        self.conditions &= !condition.bit();
        if self.conditions == 0 {
            self.tell(0, [0; 5], dictionary, out);
        } else {
            dictionary.set(Object::ERROR_REGISTER, &[self.register()]);
        }
    }

    /// The application has this error, or none with code 0. What has just been told is not repeated.
    pub(super) fn of_application(
        &mut self,
        code: u16,
        dictionary: &mut Dictionary,
        out: &mut Vec<Frame>,
    ) {
        if code == self.code {
            return;
        }
        self.code = code;
        if code == 0 {
            self.settle(Condition::Application, dictionary, out);
        } else {
            self.conditions |= Condition::Application.bit();
            if self.told == code {
                dictionary.set(Object::ERROR_REGISTER, &[self.register()]);
            } else {
                self.tell(code, [0; 5], dictionary, out);
            }
        }
    }

    /// Whether an application with this error, or none with code 0, has something to tell.
    pub(super) const fn is_news(&self, code: u16) -> bool {
        self.code != code
    }

    /// After a reset: all is forgotten but the application's error, of which no word is said.
    pub(super) fn reset(&mut self, code: u16, dictionary: &mut Dictionary) {
        let conditions = if code == 0 { 0 } else { Condition::Application.bit() };
        *self = Self { conditions, code, ..Self::default() };
        self.configure(dictionary);
        dictionary.set(Object::ERROR_REGISTER, &[self.register()]);
    }

    fn tell(
        &mut self,
        code: u16,
        manufacturer: [u8; 5],
        dictionary: &mut Dictionary,
        out: &mut Vec<Frame>,
    ) {
        self.told = code;
        let register = self.register();
        dictionary.set(Object::ERROR_REGISTER, &[register]);
        if code != 0 {
            remember(code, dictionary);
        }
        let message = EmergencyMessage {
            error_code: code,
            error_register: ErrorRegister(register),
            vendor_specific: manufacturer,
        };
        let frame = |cob_id| Frame::new(cob_id, message.encode());
        out.extend(self.cob_id.filter(|_| self.may_send).map(frame));
    }

    /// The classes of all errors there are now (1001h).
    const fn register(&self) -> u8 {
        let communication = self.conditions & !Condition::Application.bit() != 0;
        let class = match self.code >> 8 {
            0x20..=0x2F => CURRENT,
            0x30..=0x3F => VOLTAGE,
            0x40..=0x4F => TEMPERATURE,
            0x81 | 0x82 => COMMUNICATION,
            0x70..=0x80 | 0x83..=0x8F | 0xF0 => DEVICE_PROFILE,
            0xFF => MANUFACTURER,
            _ => 0,
        };
        match (self.conditions, communication) {
            (0, _) => 0,
            (_, true) => GENERIC | COMMUNICATION | class,
            (_, false) => GENERIC | class,
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

/// Puts an error at the head of the history, as far as there is one; the oldest falls out.
fn remember(code: u16, dictionary: &mut Dictionary) {
    let count = byte(dictionary, Object::ERROR_HISTORY);
    let (mut next, mut sub) = (u32::from(code), 1);
    while let Some(place) = history(dictionary, sub) {
        let pushed_on = dictionary.unsigned(place);
        dictionary.set(place, &next.to_le_bytes());
        if sub > count {
            dictionary.set(Object::ERROR_HISTORY, &[sub]);
            return;
        }
        next = pushed_on;
        sub = sub.saturating_add(1);
    }
}

/// Forgets every error of the past.
pub(super) fn clear_history(dictionary: &mut Dictionary) {
    dictionary.set(Object::ERROR_HISTORY, &[0]);
    let mut sub = 1;
    while let Some(place) = history(dictionary, sub) {
        dictionary.set(place, &[0; 4]);
        sub = sub.saturating_add(1);
    }
}

/// The `sub`-th error of the past, up to 254.
fn history(dictionary: &Dictionary, sub: u8) -> Option<Object> {
    let place = Object { sub, ..Object::ERROR_HISTORY };
    dictionary.entry(place).filter(|_| sub < u8::MAX).map(|_| place)
}
