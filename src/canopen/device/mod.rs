//! A CANopen device (CiA 301) as a pure machine: what is behind every simulated drive.
//!
//! NMT slave, SDO server, PDOs, heartbeat producer and consumer, emergencies, over an object dictionary.
//! What the device does with its objects is an [`Application`]'s. The protocol bytes are written from
//! the standard, apart from the master's codecs, so that the two can judge each other.

mod pdo;
mod rules;
mod sdo_server;

use std::time::Duration;

use crate::canopen::NmtState;
use crate::canopen::NodeId;
use crate::canopen::abort::AbortCode;
use crate::canopen::device::pdo::Pdos;
use crate::canopen::device::pdo::Received;
use crate::canopen::device::rules::INVALID;
use crate::canopen::device::rules::PdoObject;
use crate::canopen::device::sdo_server::Objects;
use crate::canopen::device::sdo_server::SdoServer;
use crate::canopen::dictionary::Dictionary;
use crate::canopen::frame::Frame;
use crate::canopen::object::Object;
use crate::time::Instant;

/// The emergencies of the communication profile (7.2.7.1).
const HEARTBEAT_LOST: u16 = 0x8130;
const RPDO_TOO_SHORT: u16 = 0x8210;
const RPDO_TIMEOUT: u16 = 0x8250;

/// Error register (1001h): generic and communication error.
const GENERIC_AND_COMMUNICATION: u8 = 0x11;

/// Entries of the error history (1003h).
const HISTORY: u8 = 8;

/// What a device does with its objects.
pub trait Application {
    /// Brings objects and device into line: called after writes and at every SYNC, before TPDOs are
    /// sampled.
    fn refresh(&mut self, dictionary: &mut Dictionary);

    /// The master has gone: what 6007h or the like asks for is done at once. The five bytes go into
    /// the emergency.
    fn connection_lost(&mut self, dictionary: &mut Dictionary) -> [u8; 5];

    /// Whether a fault is still there that an emergency has told of.
    fn has_fault(&self) -> bool;

    /// Power-up, or NMT reset node.
    fn reset(&mut self, dictionary: &mut Dictionary);
}

/// A device with its application.
#[derive(Clone, Debug)]
pub struct Device<A> {
    node: NodeId,
    dictionary: Dictionary,
    application: A,
    state: NmtState,
    /// Between SYNC and the TPDOs it asks for.
    latency: Duration,
    sdo: SdoServer,
    pdos: Pdos,
    heartbeat_due: Option<Instant>,
    master_due: Option<Instant>,
    is_in_error: bool,
    /// Whether [`on_time`](Self::on_time) has been called since power-up.
    is_up: bool,
}

impl<A: Application> Device<A> {
    /// A device that boots with the first call of [`on_time`](Self::on_time).
    pub fn new(
        node: NodeId,
        mut dictionary: Dictionary,
        latency: Duration,
        mut application: A,
    ) -> Self {
        application.reset(&mut dictionary);
        Self {
            node,
            dictionary,
            application,
            state: NmtState::Initialising,
            latency,
            sdo: SdoServer::default(),
            pdos: Pdos::default(),
            heartbeat_due: None,
            master_due: None,
            is_in_error: false,
            is_up: false,
        }
    }

    /// Its node-id.
    pub const fn node(&self) -> NodeId {
        self.node
    }

    /// Its NMT state.
    pub const fn state(&self) -> NmtState {
        self.state
    }

    /// What it holds.
    pub const fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    /// What it does.
    pub const fn application(&self) -> &A {
        &self.application
    }

    /// Changes what it does, from outside the network; the objects follow.
    pub fn touch(&mut self, change: impl FnOnce(&mut A)) {
        change(&mut self.application);
        self.application.refresh(&mut self.dictionary);
    }

    /// Takes one received frame; frames to send are appended to `out`.
    pub fn on_frame(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) {
        if !self.is_up {
            return;
        }
        let of_node = u16::from(self.node.raw());
        let sync = self.dictionary.unsigned(Object::SYNC_COB_ID) & rules::IDENTIFIER;
        match (frame.cob_id, frame.data()) {
            (0x000, &[command, target]) if target == 0 || target == self.node.raw() => {
                self.obey(now, command, out);
            }
            (id, _) if u32::from(id) == sync => self.on_sync(now),
            (id, data) if id == 0x600 + of_node => {
                if let Ok(request) = data.try_into() {
                    self.serve(now, request, out);
                }
            }
            (0x701..=0x77F, &[_]) => self.hear_master(now, frame.cob_id),
            _ => self.on_rpdo(now, frame, out),
        }
        self.settle(now, out);
    }

    /// Does what is due at `now`.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if !self.is_up {
            self.is_up = true;
            self.boot(now, out);
        }
        if self.heartbeat_due.is_some_and(|due| due <= now) {
            self.beat(now, out);
        }
        if self.master_due.take_if(|due| *due <= now).is_some() {
            self.lose_master(HEARTBEAT_LOST, out);
        }
        if self.state == NmtState::Operational && self.pdos.is_overdue(now) {
            self.lose_master(RPDO_TIMEOUT, out);
        }
        self.settle(now, out);
    }

    /// When [`on_time`](Self::on_time) must next be called.
    pub fn deadline(&self) -> Option<Instant> {
        if !self.is_up {
            return Some(Instant::ZERO);
        }
        let pdos = if self.state == NmtState::Operational { self.pdos.deadline() } else { None };
        [self.heartbeat_due, self.master_due, pdos].into_iter().flatten().min()
    }

    /// An NMT command (7.3.2.1).
    fn obey(&mut self, now: Instant, command: u8, out: &mut Vec<Frame>) {
        match command {
            1 => self.enter(NmtState::Operational),
            2 => {
                self.leave_operational();
                self.enter(NmtState::Stopped);
            }
            128 => self.enter(NmtState::PreOperational),
            129 => {
                self.leave_operational();
                self.dictionary.restore(0x1000..=0x9FFF);
                self.application.reset(&mut self.dictionary);
                self.boot(now, out);
            }
            130 => {
                self.leave_operational();
                self.dictionary.restore(0x1000..=0x1FFF);
                self.boot(now, out);
            }
            _ => {}
        }
    }

    fn enter(&mut self, state: NmtState) {
        if state != self.state {
            self.state = state;
            self.sdo.reset();
            self.pdos = Pdos::of(&self.dictionary);
        }
    }

    /// Stopped or reset while in operation is a connection lost, without an emergency (6007h).
    fn leave_operational(&mut self) {
        if self.state == NmtState::Operational {
            self.application.connection_lost(&mut self.dictionary);
        }
    }

    /// The boot-up message, then pre-operational.
    fn boot(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.state = NmtState::Initialising;
        self.is_in_error = false;
        self.master_due = None;
        self.heartbeat_due = None;
        out.push(Frame::new(0x700 + u16::from(self.node.raw()), [0]));
        self.enter(NmtState::PreOperational);
        self.set_up(now);
    }

    /// Follows the dictionary where it sets up the device itself.
    fn set_up(&mut self, now: Instant) {
        self.pdos = Pdos::of(&self.dictionary);
        self.heartbeat_due = self.heartbeat_period().map(|period| now + period);
    }

    fn heartbeat_period(&self) -> Option<Duration> {
        let period = self.dictionary.unsigned(Object::PRODUCER_HEARTBEAT);
        (period > 0).then(|| Duration::from_millis(u64::from(period)))
    }

    fn beat(&mut self, now: Instant, out: &mut Vec<Frame>) {
        let state = match self.state {
            NmtState::Initialising => 0,
            NmtState::Stopped => 4,
            NmtState::Operational => 5,
            NmtState::PreOperational => 127,
        };
        out.push(Frame::new(0x700 + u16::from(self.node.raw()), [state]));
        self.heartbeat_due = self.heartbeat_period().map(|period| now + period);
    }

    /// A heartbeat that is watched (1016h) is heard: from the first one on, it must go on.
    fn hear_master(&mut self, now: Instant, cob_id: u16) {
        let [t0, t1, node, _] = self.dictionary.unsigned(Object::CONSUMER_HEARTBEAT).to_le_bytes();
        let timeout = Duration::from_millis(u64::from(u16::from_le_bytes([t0, t1])));
        if node != 0 && !timeout.is_zero() && cob_id == 0x700 + u16::from(node) {
            self.master_due = Some(now + timeout);
        }
    }

    fn serve(&mut self, now: Instant, request: [u8; 8], out: &mut Vec<Frame>) {
        if self.state == NmtState::Stopped || self.state == NmtState::Initialising {
            return;
        }
        let mut objects = Service { dictionary: &mut self.dictionary, written: None };
        let reply = self.sdo.answer(request, &mut objects);
        let written = objects.written;
        if let Some(object) = written {
            self.application.refresh(&mut self.dictionary);
            if PdoObject::of(object.index).is_some() || object == Object::PRODUCER_HEARTBEAT {
                self.set_up(now);
            }
            if object == Object::CONSUMER_HEARTBEAT {
                self.master_due = None;
            }
        }
        out.extend(reply.map(|reply| Frame::new(0x580 + u16::from(self.node.raw()), reply)));
    }

    fn on_sync(&mut self, now: Instant) {
        if self.state != NmtState::Operational {
            return;
        }
        self.pdos.apply(&mut self.dictionary);
        self.application.refresh(&mut self.dictionary);
        self.pdos.sample(now, self.latency, &self.dictionary);
    }

    fn on_rpdo(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) {
        if self.state != NmtState::Operational {
            return;
        }
        match self.pdos.on_frame(now, frame, &mut self.dictionary) {
            Some(Received::Applied) => self.application.refresh(&mut self.dictionary),
            Some(Received::TooShort) => self.emergency(RPDO_TOO_SHORT, [0; 5], out),
            Some(Received::Waits) | None => {}
        }
    }

    fn lose_master(&mut self, code: u16, out: &mut Vec<Frame>) {
        let bytes = self.application.connection_lost(&mut self.dictionary);
        self.emergency(code, bytes, out);
    }

    /// Sends an emergency and keeps it in mind (1001h, 1003h).
    fn emergency(&mut self, code: u16, bytes: [u8; 5], out: &mut Vec<Frame>) {
        self.is_in_error = true;
        self.dictionary.set(Object::ERROR_REGISTER, &[GENERIC_AND_COMMUNICATION]);
        self.remember(code);
        self.tell(code, GENERIC_AND_COMMUNICATION, bytes, out);
    }

    fn tell(&self, code: u16, register: u8, bytes: [u8; 5], out: &mut Vec<Frame>) {
        let cob_id = self.dictionary.unsigned(Object::EMCY_COB_ID);
        if cob_id & INVALID == 0 {
            let [c0, c1] = code.to_le_bytes();
            let [a, b, c, d, e] = bytes;
            let cob_id = u16::try_from(cob_id & rules::IDENTIFIER).unwrap_or(0);
            out.push(Frame::new(cob_id, [c0, c1, register, a, b, c, d, e]));
        }
    }

    /// The newest error first in the history.
    fn remember(&mut self, code: u16) {
        let entry = |sub| Object { sub, ..Object::ERROR_HISTORY };
        for sub in (1..HISTORY).rev() {
            let older = self.dictionary.unsigned(entry(sub)).to_le_bytes();
            self.dictionary.set(entry(sub + 1), &older);
        }
        self.dictionary.set(entry(1), &u32::from(code).to_le_bytes());
        let [count, ..] = self.dictionary.unsigned(Object::ERROR_HISTORY).to_le_bytes();
        self.dictionary.set(Object::ERROR_HISTORY, &[count.saturating_add(1).min(HISTORY)]);
    }

    /// After everything: errors that have gone are told gone, and what is due is sent.
    fn settle(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if self.is_in_error && !self.application.has_fault() {
            self.is_in_error = false;
            self.dictionary.set(Object::ERROR_REGISTER, &[0]);
            self.tell(0, 0, [0; 5], out);
        }
        if self.state == NmtState::Operational {
            self.pdos.refresh(now, &self.dictionary);
            self.pdos.send(now, &self.dictionary, out);
        }
    }
}

/// The dictionary as the SDO server serves it.
struct Service<'a> {
    dictionary: &'a mut Dictionary,
    written: Option<Object>,
}

impl Objects for Service<'_> {
    fn read(&self, object: Object) -> Result<&[u8], AbortCode> {
        rules::exists(self.dictionary, object)?;
        let entry = self.dictionary.entry(object).ok_or(AbortCode::NO_OBJECT)?;
        if entry.access.is_readable() { Ok(entry.value()) } else { Err(AbortCode::WRITE_ONLY) }
    }

    fn may_write(&self, object: Object) -> Result<(), AbortCode> {
        rules::exists(self.dictionary, object)?;
        let entry = self.dictionary.entry(object).ok_or(AbortCode::NO_OBJECT)?;
        if entry.access.is_writable() { Ok(()) } else { Err(AbortCode::READ_ONLY) }
    }

    fn write(&mut self, object: Object, value: &[u8]) -> Result<(), AbortCode> {
        rules::takes(self.dictionary, object, value)?;
        self.dictionary.set(object, value);
        self.written = Some(object);
        Ok(())
    }
}
