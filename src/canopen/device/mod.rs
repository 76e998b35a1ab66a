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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::eds::Eds;
    use proptest::prelude::*;

    /// Doubles what it is asked for; a lost connection is a fault.
    #[derive(Clone, Debug, Default)]
    struct Doubling {
        is_faulty: bool,
    }

    impl Application for Doubling {
        fn refresh(&mut self, dictionary: &mut Dictionary) {
            let doubled = dictionary.i16(Object::TARGET_TORQUE).saturating_mul(2);
            dictionary.set(Object::TORQUE_ACTUAL, &doubled.to_le_bytes());
        }

        fn connection_lost(&mut self, _: &mut Dictionary) -> [u8; 5] {
            self.is_faulty = true;
            [1, 2, 3, 4, 5]
        }

        fn has_fault(&self) -> bool {
            self.is_faulty
        }

        fn reset(&mut self, _: &mut Dictionary) {
            self.is_faulty = false;
        }
    }

    /// A device on a bench: what is said to it, and what it says.
    struct Bench {
        device: Device<Doubling>,
        now: Instant,
    }

    impl Bench {
        /// Booted, as node 3.
        fn new() -> Self {
            let eds = Eds::parse(include_bytes!("../../../eds/frhc_drive.eds")).unwrap();
            let node = NodeId::new(3).unwrap();
            let dictionary = Dictionary::new(&eds, node);
            let device = Device::new(node, dictionary, Duration::ZERO, Doubling::default());
            let mut bench = Self { device, now: Instant::ZERO };
            assert_eq!(bench.pass(0), [Frame::new(0x703, [0])], "the boot-up message");
            bench
        }

        /// Lets so many ms pass.
        fn pass(&mut self, millis: u64) -> Vec<Frame> {
            let until = self.now + Duration::from_millis(millis);
            let mut out = Vec::new();
            while let Some(due) = self.device.deadline().filter(|due| *due <= until) {
                self.now = self.now.max(due);
                self.device.on_time(self.now, &mut out);
            }
            self.now = until;
            out
        }

        fn say(&mut self, frame: Frame) -> Vec<Frame> {
            let mut out = Vec::new();
            self.device.on_frame(self.now, &frame, &mut out);
            out
        }

        fn sdo(&mut self, request: [u8; 8]) -> [u8; 8] {
            let reply = self.say(Frame::new(0x603, request));
            assert_eq!(reply[0].cob_id, 0x583);
            reply[0].data().try_into().unwrap()
        }

        /// Writes up to four bytes; the abort code if it is refused.
        fn write(&mut self, object: Object, value: &[u8]) -> Result<(), AbortCode> {
            let [i0, i1] = object.index.to_le_bytes();
            let mut request = [
                0x23 | u8::try_from(4 - value.len()).unwrap() << 2,
                i0,
                i1,
                object.sub,
                0,
                0,
                0,
                0,
            ];
            request[4..4 + value.len()].copy_from_slice(value);
            let [command, _, _, _, code @ ..] = self.sdo(request);
            if command == 0x60 { Ok(()) } else { Err(AbortCode(u32::from_le_bytes(code))) }
        }

        /// One RPDO1 and one TPDO1 at every SYNC, the RPDO watched for 5 ms, and started.
        fn exchange(&mut self) {
            let writes: [(Object, &[u8]); 12] = [
                (Object::rpdo_communication(1, 1), &[0x03, 0x02, 0, 0x80]),
                (Object::rpdo_mapping(1, 0), &[0]),
                (Object::rpdo_mapping(1, 1), &[0x10, 0, 0x71, 0x60]),
                (Object::rpdo_mapping(1, 0), &[1]),
                (Object::rpdo_communication(1, 2), &[1]),
                (Object::rpdo_communication(1, 5), &[5, 0]),
                (Object::rpdo_communication(1, 1), &[0x03, 0x02, 0, 0]),
                (Object::tpdo_communication(1, 1), &[0x83, 0x01, 0, 0x80]),
                (Object::tpdo_mapping(1, 0), &[0]),
                (Object::tpdo_mapping(1, 1), &[0x10, 0, 0x77, 0x60]),
                (Object::tpdo_mapping(1, 0), &[1]),
                (Object::tpdo_communication(1, 2), &[1]),
            ];
            for (object, value) in writes {
                assert_eq!(self.write(object, value), Ok(()), "{object}");
            }
            for number in 2..=4 {
                self.write(Object::tpdo_communication(number, 1), &[0, 0, 0, 0x80]).unwrap();
            }
            self.write(Object::tpdo_communication(1, 1), &[0x83, 0x01, 0, 0]).unwrap();
            assert_eq!(self.say(Frame::new(0, [1, 3])), []);
        }

        /// The torque its TPDO tells at a SYNC.
        fn sync(&mut self) -> i16 {
            let said = self.say(Frame::new(0x80, []));
            let tpdo = said.iter().find(|frame| frame.cob_id == 0x183).unwrap();
            i16::from_le_bytes(tpdo.data().try_into().unwrap())
        }
    }

    #[test]
    fn an_rpdo_acts_at_the_next_sync() {
        let mut bench = Bench::new();
        bench.exchange();
        assert_eq!(bench.sync(), 0);
        bench.say(Frame::new(0x203, 21_i16.to_le_bytes()));
        assert_eq!(bench.device.dictionary().i16(Object::TARGET_TORQUE), 0, "not yet");
        assert_eq!(bench.sync(), 42);
    }

    #[test]
    fn an_rpdo_that_stays_away_is_told_within_its_timer_and_once() {
        let mut bench = Bench::new();
        bench.exchange();
        assert_eq!(bench.pass(50), [], "it is not watched before the first");
        bench.say(Frame::new(0x203, [0, 0]));
        assert_eq!(bench.pass(4), []);
        let lost = Frame::new(0x83, [0x50, 0x82, 0x11, 1, 2, 3, 4, 5]);
        assert_eq!(bench.pass(1), [lost]);
        assert_eq!(bench.pass(100), []);
    }

    #[test]
    fn a_masters_heartbeat_is_watched_from_the_first_on() {
        let mut bench = Bench::new();
        bench.write(Object::CONSUMER_HEARTBEAT, &[22, 0, 127, 0]).unwrap();
        assert_eq!(bench.pass(100), []);
        bench.say(Frame::new(0x77F, [5]));
        bench.pass(20);
        bench.say(Frame::new(0x77F, [5]));
        assert_eq!(bench.pass(21), []);
        assert_eq!(bench.pass(1)[0].data()[..2], [0x30, 0x81]);
    }

    #[test]
    fn an_rpdo_that_is_too_short_changes_nothing_and_is_told() {
        let mut bench = Bench::new();
        bench.exchange();
        let said = bench.say(Frame::new(0x203, [7]));
        assert_eq!(said[0].data()[..2], [0x10, 0x82]);
        assert_eq!(bench.sync(), 0);
    }

    #[test]
    fn a_mapping_changes_only_while_its_pdo_does_not_exist() {
        let mut bench = Bench::new();
        let refused = Err(AbortCode::ACCESS_UNSUPPORTED);
        assert_eq!(bench.write(Object::rpdo_mapping(1, 0), &[0]), refused);
        bench.write(Object::rpdo_communication(1, 1), &[3, 2, 0, 0x80]).unwrap();
        assert_eq!(bench.write(Object::rpdo_mapping(1, 1), &[0x10, 0, 0x71, 0x60]), refused);
        bench.write(Object::rpdo_mapping(1, 0), &[0]).unwrap();
        for (entry, reason) in [
            ([0x10, 0, 0x77, 0x60], AbortCode::NOT_MAPPABLE), // an actual value is no target
            ([0x08, 0, 0x71, 0x60], AbortCode::NOT_MAPPABLE), // of another length
            ([0x10, 0, 0x99, 0x60], AbortCode::NO_OBJECT),
            ([0x20, 5, 0x18, 0x10], AbortCode::NO_SUB_INDEX),
        ] {
            assert_eq!(bench.write(Object::rpdo_mapping(1, 1), &entry), Err(reason));
        }
        for sub in 1..=3 {
            bench.write(Object::rpdo_mapping(1, sub), &[0x20, 0, 0x7A, 0x60]).unwrap();
        }
        assert_eq!(bench.write(Object::rpdo_mapping(1, 0), &[3]), Err(AbortCode::PDO_TOO_LONG));
        bench.write(Object::rpdo_mapping(1, 0), &[2]).unwrap();
    }

    #[test]
    fn every_wrong_write_has_its_own_reason() {
        let mut bench = Bench::new();
        let nowhere = Object { index: 0x5FFF, sub: 0 };
        for (object, value, reason) in [
            (nowhere, &[0][..], AbortCode::NO_OBJECT),
            (Object { sub: 9, ..Object::VENDOR_ID }, &[0], AbortCode::NO_SUB_INDEX),
            (Object::STATUSWORD, &[0, 0], AbortCode::READ_ONLY),
            (Object::PRODUCER_HEARTBEAT, &[0, 0, 0, 0], AbortCode::LENGTH_TOO_HIGH),
            (Object::PRODUCER_HEARTBEAT, &[0], AbortCode::LENGTH_TOO_LOW),
            (Object::ABORT_CONNECTION, &[4, 0], AbortCode::VALUE_TOO_HIGH),
            (Object::ABORT_CONNECTION, &[0xFF, 0xFF], AbortCode::VALUE_TOO_LOW),
            (Object::rpdo_communication(1, 2), &[245], AbortCode::VALUE_INVALID),
            (Object::rpdo_communication(1, 1), &[4, 2, 0, 0], AbortCode::VALUE_INVALID),
            (Object::ERROR_HISTORY, &[1], AbortCode::VALUE_INVALID),
        ] {
            assert_eq!(bench.write(object, value), Err(reason), "{object}");
        }
    }

    #[test]
    fn a_long_value_is_read_in_segments() {
        let mut bench = Bench::new();
        let begin = bench.sdo([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]);
        let name = b"frhc simulated drive";
        assert_eq!(begin, [0x41, 0x08, 0x10, 0, 20, 0, 0, 0]);
        assert_eq!(name.len(), 20);
        let mut read = Vec::new();
        for (request, command) in [(0x60, 0x00), (0x70, 0x10), (0x60, 0x03)] {
            let segment = bench.sdo([request, 0, 0, 0, 0, 0, 0, 0]);
            assert_eq!(segment[0], command);
            read.extend_from_slice(&segment[1..]);
        }
        assert_eq!(read[..20], name[..]);
        assert_eq!(bench.sdo([0x60, 0, 0, 0, 0, 0, 0, 0])[0], 0x80, "nothing is under way");
    }

    #[test]
    fn a_segmented_write_takes_effect_with_its_last_segment() {
        let mut bench = Bench::new();
        assert_eq!(bench.sdo([0x21, 0x17, 0x10, 0, 2, 0, 0, 0])[0], 0x60);
        assert_eq!(bench.pass(50), []);
        assert_eq!(bench.sdo([0x0B, 25, 0, 0, 0, 0, 0, 0])[0], 0x20);
        assert_eq!(bench.pass(25), [Frame::new(0x703, [127])], "the heartbeat it set");
        assert_eq!(bench.sdo([0x21, 0x17, 0x10, 0, 2, 0, 0, 0])[0], 0x60);
        let wrong_toggle = bench.sdo([0x1B, 25, 0, 0, 0, 0, 0, 0]);
        assert_eq!(wrong_toggle[4..], AbortCode::TOGGLE_NOT_ALTERNATED.0.to_le_bytes());
    }

    #[test]
    fn a_communication_reset_restores_what_it_should_and_no_more() {
        let mut bench = Bench::new();
        bench.write(Object::PRODUCER_HEARTBEAT, &[10, 0]).unwrap();
        bench.write(Object::ABORT_CONNECTION, &[1, 0]).unwrap();
        assert_eq!(bench.say(Frame::new(0, [130, 3])), [Frame::new(0x703, [0])]);
        assert_eq!(bench.pass(100), []);
        assert_eq!(bench.device.dictionary().i16(Object::ABORT_CONNECTION), 1);
        bench.say(Frame::new(0, [129, 0]));
        assert_eq!(bench.device.dictionary().i16(Object::ABORT_CONNECTION), 0);
    }

    #[test]
    fn pdos_are_for_operation_and_sdo_is_for_all_but_stopped() {
        let mut bench = Bench::new();
        bench.exchange();
        bench.say(Frame::new(0, [2, 0]));
        assert_eq!(bench.say(Frame::new(0x80, [])), []);
        assert_eq!(bench.say(Frame::new(0x603, [0x40, 0, 0x10, 0, 0, 0, 0, 0])), []);
        bench.say(Frame::new(0, [128, 0]));
        assert_eq!(bench.sdo([0x40, 0, 0x10, 0, 0, 0, 0, 0])[0], 0x43);
    }

    #[test]
    fn an_error_that_has_gone_is_told_gone() {
        let mut bench = Bench::new();
        bench.exchange();
        bench.say(Frame::new(0x203, [0, 0]));
        bench.pass(5);
        assert_eq!(bench.device.dictionary().unsigned(Object::ERROR_REGISTER), 0x11);
        bench.device.touch(|application| application.is_faulty = false);
        let said = bench.say(Frame::new(0x80, []));
        assert_eq!(said[0], Frame::new(0x83, [0; 8]));
        let newest = Object { sub: 1, ..Object::ERROR_HISTORY };
        assert_eq!(bench.device.dictionary().unsigned(newest), 0x8250);
    }

    proptest! {
        #[test]
        fn no_sequence_of_frames_breaks_it(
            frames in prop::collection::vec(
                (prop::sample::select(vec![0x000_u16, 0x080, 0x203, 0x303, 0x603, 0x77F]),
                 prop::collection::vec(any::<u8>(), 0..=8), 0..20_u64),
                0..60,
            )
        ) {
            let mut bench = Bench::new();
            bench.exchange();
            for (cob_id, data, millis) in frames {
                let said = bench.say(Frame::from_slice(cob_id, &data).unwrap());
                prop_assert!(said.len() <= 8, "{said:?}");
                bench.pass(millis);
            }
        }
    }
}
