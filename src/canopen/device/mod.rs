//! A CANopen slave (CiA 301), driven by its object dictionary: NMT, SDO server, PDOs, emergencies and
//! heartbeats.
//!
//! What the device *does* is its [`Application`]'s: a drive, a switch box. A pure machine with three
//! verbs; what happens every cycle allocates nothing.

mod access;
mod application;
mod errors;
mod guarding;
mod heartbeat;
#[cfg(test)]
mod laws;
mod lss;
mod mapping;
mod parameter;
mod rpdo;
mod sdo_server;
mod store;
mod tpdo;

pub use application::Application;
pub use application::ConnectionLoss;
pub use application::Reset;

use std::time::Duration;

use canopen_rs::NmtCommand;
use canopen_rs::NmtState;
use canopen_rs::NodeId;
use canopen_rs::nmt::encode_heartbeat;
use canopen_rs::nmt::heartbeat_cob_id;

use crate::canopen::device::access::Objects;
use crate::canopen::device::errors::Condition;
use crate::canopen::device::errors::Errors;
use crate::canopen::device::guarding::Guarding;
use crate::canopen::device::heartbeat::Heartbeat;
use crate::canopen::device::lss::Layer;
use crate::canopen::device::parameter::Place;
use crate::canopen::device::rpdo::Received;
use crate::canopen::device::rpdo::Rpdo;
use crate::canopen::device::sdo_server::SdoServer;
use crate::canopen::device::tpdo::Tpdo;
use crate::canopen::dictionary::Dictionary;
use crate::canopen::frame::COB_ID_MAX;
use crate::canopen::frame::Frame;
use crate::canopen::layout::Direction;
use crate::canopen::nmt::Order;
use crate::canopen::object::Object;
use crate::time::Instant;

/// One slave.
#[derive(Clone, Debug)]
pub struct Device<A> {
    node: NodeId,
    layer: Layer,
    dictionary: Dictionary,
    application: A,
    state: NmtState,
    latency: Duration,
    sync_cob_id: u16,
    /// Of a SYNC: one where they are counted, any number where the device knows no counting.
    sync_bytes: Option<usize>,
    sdo: SdoServer,
    rpdos: Vec<Rpdo>,
    tpdos: Vec<Tpdo>,
    errors: Errors,
    heartbeat: Heartbeat,
    guarding: Guarding,
    /// The application's objects may have changed since they were last looked at.
    is_touched: bool,
}

impl<A: Application> Device<A> {
    /// A device that is switched on: it boots up with the first call of [`on_time`](Self::on_time).
    ///
    /// Its synchronous TPDOs are sent `latency` after the SYNC they were sampled at.
    pub fn new(node: NodeId, dictionary: Dictionary, application: A, latency: Duration) -> Self {
        let mut device = Self {
            node,
            layer: Layer::new(node, &dictionary),
            state: NmtState::Initialising,
            latency,
            sync_cob_id: 0,
            sync_bytes: None,
            sdo: SdoServer::new(node),
            rpdos: Vec::new(),
            tpdos: Vec::new(),
            errors: Errors::default(),
            heartbeat: Heartbeat::default(),
            guarding: Guarding::default(),
            is_touched: false,
            dictionary,
            application,
        };
        device.initialise(Reset::Node);
        device
    }

    /// Its node-id, or the last it had: LSS may take it away.
    pub const fn node(&self) -> NodeId {
        self.node
    }

    /// Its NMT state, initialising until it has booted up.
    pub const fn state(&self) -> NmtState {
        self.state
    }

    /// Its application.
    pub const fn application(&self) -> &A {
        &self.application
    }

    /// Its objects.
    pub const fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    /// Something happens to the application from outside, such as a moved shaft; event-driven TPDOs
    /// tell of it with the next [`on_time`](Self::on_time).
    pub fn touch(&mut self, happens: impl FnOnce(&mut A, &mut Dictionary)) {
        happens(&mut self.application, &mut self.dictionary);
        self.is_touched = true;
    }

    /// Takes one received frame; frames to send are appended to `out`.
    pub fn on_frame(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) {
        if lss::is_request(frame) {
            self.on_lss(now, frame, out);
            return;
        }
        if self.state == NmtState::Initialising || self.layer.silence().is_some() {
            return;
        }
        if frame.is_remote() {
            self.on_question(now, frame, out);
            return;
        }
        if let Some(order) = Order::decode(frame) {
            if order.node.is_none_or(|node| node == self.node) {
                self.obey(now, order.command, out);
            }
        } else if self.heartbeat.on_frame(now, frame) {
            self.errors.settle(Condition::HeartbeatLost, &mut self.dictionary, out);
        } else if let Some(request) = self.sdo.request(frame) {
            if self.state != NmtState::Stopped {
                self.serve(now, request, out);
            }
        } else if self.state == NmtState::Operational {
            if frame.cob_id == self.sync_cob_id {
                self.take_sync(now, frame, out);
            } else {
                self.on_rpdo(now, frame, out);
            }
        }
        self.catch_up(now, out);
    }

    /// Does what is due at `now`.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.layer.wake(now);
        self.run_application(now);
        if self.layer.silence().is_some() {
            return;
        }
        if self.state == NmtState::Initialising {
            self.boot_up(now, out);
        }
        if self.heartbeat.is_lost(now) || self.guarding.is_lost(now) {
            self.lose_connection(Condition::HeartbeatLost, ConnectionLoss::Heartbeat, out);
            self.behave_on_error();
        }
        let mut is_missed = false;
        for rpdo in &mut self.rpdos {
            is_missed |= rpdo.is_missed(now);
        }
        if is_missed {
            self.lose_connection(Condition::RpdoTimeout, ConnectionLoss::RpdoTimeout, out);
        }
        self.sdo.on_time(now, out);
        self.catch_up(now, out);
    }

    /// When [`on_time`](Self::on_time) must next be called.
    pub fn deadline(&self) -> Option<Instant> {
        let application = self.application.deadline();
        if let Some(silence) = self.layer.silence() {
            return silence.end().into_iter().chain(application).min();
        }
        let is_due = self.state == NmtState::Initialising
            || self.must_look()
            || self.errors.is_news(self.application.error_code());
        let now = is_due.then_some(Instant::ZERO);
        let rpdos = self.rpdos.iter().filter_map(Rpdo::deadline);
        let tpdos = self.tpdos.iter().filter_map(Tpdo::deadline);
        let watches = [self.heartbeat.deadline(), self.guarding.deadline(), self.sdo.deadline()];
        let watches = watches.into_iter().flatten();
        rpdos.chain(tpdos).chain(now).chain(application).chain(watches).min()
    }

    fn run_application(&mut self, now: Instant) {
        if self.application.deadline().is_some_and(|due| due <= now) {
            self.application.on_time(now, &mut self.dictionary);
            self.is_touched = true;
        }
    }

    /// A remote frame: only its master's question whether it is alive has an answer.
    fn on_question(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) {
        let answer = self.guarding.answer(now, frame, self.node, self.state, &self.dictionary);
        if answer.is_some() {
            self.errors.settle(Condition::HeartbeatLost, &mut self.dictionary, out);
        }
        out.extend(answer);
    }

    fn obey(&mut self, now: Instant, command: NmtCommand, out: &mut Vec<Frame>) {
        match command {
            NmtCommand::StartRemoteNode => self.enter(NmtState::Operational),
            NmtCommand::EnterPreOperational => self.enter(NmtState::PreOperational),
            NmtCommand::StopRemoteNode => {
                self.leave_operational();
                self.enter(NmtState::Stopped);
            }
            NmtCommand::ResetCommunication | NmtCommand::ResetNode => {
                let is_node = command == NmtCommand::ResetNode;
                let reset = if is_node { Reset::Node } else { Reset::Communication };
                self.reset(now, reset, out);
            }
        }
    }

    /// Everything, or communication, begins anew, with the node-id LSS has configured.
    fn reset(&mut self, now: Instant, reset: Reset, out: &mut Vec<Frame>) {
        self.leave_operational();
        self.layer.reset();
        self.adopt_node();
        self.dictionary.restore(match reset {
            Reset::Communication => COMMUNICATION_PROFILE,
            Reset::Node => 0..=u16::MAX,
        });
        self.initialise(reset);
        if self.is_configured() {
            self.boot_up(now, out);
        }
    }

    /// To be stopped or reset in operation is to lose the master; nothing is told of it.
    fn leave_operational(&mut self) {
        if self.state == NmtState::Operational {
            let why = ConnectionLoss::Stopped;
            self.application.on_connection_lost(&mut self.dictionary, why);
        }
    }

    /// Everything follows the dictionary, which has its defaults.
    fn initialise(&mut self, reset: Reset) {
        self.state = NmtState::Initialising;
        self.sdo.reset();
        let numbers = |direction| Place::all(&self.dictionary, direction).map(|place| place.number);
        self.rpdos =
            numbers(Direction::Receive).map(|number| Rpdo::new(&self.dictionary, number)).collect();
        self.tpdos = numbers(Direction::Transmit)
            .map(|number| Tpdo::new(&self.dictionary, number))
            .collect();
        self.heartbeat.watch(&self.dictionary);
        self.guarding.restart();
        self.follow_sync();
        self.application.on_reset(&mut self.dictionary, reset);
        self.errors.reset(self.application.error_code(), &mut self.dictionary);
    }

    fn boot_up(&mut self, now: Instant, out: &mut Vec<Frame>) {
        let boot_up = encode_heartbeat(NmtState::Initialising);
        out.push(Frame::new(heartbeat_cob_id(self.node), boot_up));
        self.enter(NmtState::PreOperational);
        // The boot-up message stands for the first heartbeat.
        self.heartbeat.produce(&self.dictionary, now, Heartbeat::period(&self.dictionary));
    }

    fn enter(&mut self, state: NmtState) {
        if self.state == state {
            return;
        }
        self.state = state;
        self.errors.may_send = matches!(state, NmtState::PreOperational | NmtState::Operational);
        if state == NmtState::Operational {
            self.tpdos.iter_mut().for_each(Tpdo::start);
        } else {
            self.tpdos.iter_mut().for_each(Tpdo::stop);
            self.rpdos.iter_mut().for_each(Rpdo::stop);
        }
        if state == NmtState::Stopped {
            self.sdo.reset();
        }
    }

    fn serve(&mut self, now: Instant, request: [u8; 8], out: &mut Vec<Frame>) {
        let Self { dictionary, application, .. } = self;
        let mut objects = Objects { dictionary, application, written: None };
        self.sdo.serve(now, request, &mut objects, out);
        if let Some(object) = objects.written {
            self.follow(now, object);
        }
    }

    /// Does as an object says that has just been written.
    fn follow(&mut self, now: Instant, object: Object) {
        self.is_touched = true;
        store::follow(object, &mut self.dictionary);
        match object {
            Object::SYNC_COB_ID | Object::SYNC_OVERFLOW => self.follow_sync(),
            Object::EMCY_COB_ID => self.errors.configure(&self.dictionary),
            Object::ERROR_HISTORY => errors::clear_history(&mut self.dictionary),
            Object::CONSUMER_HEARTBEAT => self.heartbeat.watch(&self.dictionary),
            Object::PRODUCER_HEARTBEAT => {
                self.heartbeat.produce(&self.dictionary, now, Duration::ZERO);
            }
            object => {
                if let Some(place) = Place::of(object) {
                    self.resolve(place);
                }
            }
        }
    }

    /// A PDO follows its parameters.
    fn resolve(&mut self, changed: Place) {
        match changed.direction {
            Direction::Receive => {
                let of = |rpdo: &&mut Rpdo| rpdo.place() == changed;
                if let Some(rpdo) = self.rpdos.iter_mut().find(of) {
                    *rpdo = Rpdo::new(&self.dictionary, changed.number);
                }
            }
            Direction::Transmit => {
                let of = |tpdo: &&mut Tpdo| tpdo.place() == changed;
                if let Some(tpdo) = self.tpdos.iter_mut().find(of) {
                    *tpdo = Tpdo::new(&self.dictionary, changed.number);
                    if self.state == NmtState::Operational {
                        tpdo.start();
                    }
                }
            }
        }
    }

    fn follow_sync(&mut self) {
        let identifier = self.dictionary.unsigned(Object::SYNC_COB_ID) & u32::from(COB_ID_MAX);
        self.sync_cob_id = u16::try_from(identifier).unwrap_or(0);
        let counts = self.dictionary.entry(Object::SYNC_OVERFLOW);
        self.sync_bytes =
            counts.map(|_| usize::from(self.dictionary.unsigned(Object::SYNC_OVERFLOW) > 0));
    }

    /// A SYNC of another length is none, and that is told (CiA 301, 7.5.2.22).
    fn take_sync(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) {
        let Self { errors, dictionary, .. } = self;
        if self.sync_bytes.is_none_or(|bytes| bytes == frame.data().len()) {
            errors.settle(Condition::SyncLength, dictionary, out);
            self.on_sync(now, out);
        } else {
            errors.raise(Condition::SyncLength, errors::SYNC_LENGTH, [0; 5], dictionary, out);
        }
    }

    fn on_sync(&mut self, now: Instant, out: &mut Vec<Frame>) {
        for place in 0..self.rpdos.len() {
            let Some(rpdo) = self.rpdos.get_mut(place) else { continue };
            if let Some(content) = rpdo.on_sync() {
                self.act(place, content);
            }
        }
        self.application.on_sync(&mut self.dictionary);
        self.tell_of_application(out);
        for tpdo in &mut self.tpdos {
            tpdo.on_sync(now + self.latency, &self.dictionary);
        }
        self.is_touched = true;
    }

    fn on_rpdo(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) {
        for place in 0..self.rpdos.len() {
            let Some(rpdo) = self.rpdos.get_mut(place) else { continue };
            let Some(received) = rpdo.on_frame(now, frame) else { continue };
            let Self { errors, dictionary, .. } = self;
            if received == Received::WrongLength {
                let (condition, code) = (Condition::WrongLength, errors::WRONG_LENGTH);
                errors.raise(condition, code, [0; 5], dictionary, out);
                continue;
            }
            errors.settle(Condition::WrongLength, dictionary, out);
            errors.settle(Condition::RpdoTimeout, dictionary, out);
            if let Received::Acts(content) = received {
                self.act(place, content);
            }
        }
    }

    /// The RPDO at `place` says `content`: first every object has its part, then the application is told.
    fn act(&mut self, place: usize, content: u64) {
        let Some(rpdo) = self.rpdos.get(place) else { return };
        rpdo.mapping().scatter(content, &mut self.dictionary);
        for object in rpdo.mapping().objects() {
            self.application.written(&mut self.dictionary, object);
        }
        self.is_touched = true;
    }

    fn lose_connection(&mut self, condition: Condition, why: ConnectionLoss, out: &mut Vec<Frame>) {
        let manufacturer = self.application.on_connection_lost(&mut self.dictionary, why);
        self.errors.raise(condition, why.error_code(), manufacturer, &mut self.dictionary, out);
        self.is_touched = true;
    }

    /// Leaves operational after a lost heartbeat, unless told otherwise (1029h:1).
    fn behave_on_error(&mut self) {
        if self.state != NmtState::Operational {
            return;
        }
        match mapping::byte(&self.dictionary, Object::ERROR_BEHAVIOUR) {
            0 => self.enter(NmtState::PreOperational),
            2 => self.enter(NmtState::Stopped),
            _ => {}
        }
    }

    /// Tells when the application has another error than before, or none any more.
    fn tell_of_application(&mut self, out: &mut Vec<Frame>) {
        let code = self.application.error_code();
        self.errors.of_application(code, &mut self.dictionary, out);
    }

    /// What may follow from anything that has happened.
    fn catch_up(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.tell_of_application(out);
        if self.must_look() {
            for tpdo in &mut self.tpdos {
                tpdo.look(&self.dictionary);
            }
        }
        self.is_touched = false;
        if self.state == NmtState::Operational {
            for tpdo in &mut self.tpdos {
                tpdo.on_time(now, &self.dictionary, out);
            }
        }
        out.extend(self.heartbeat.due(now, self.node, self.state));
    }

    /// Whether an event-driven TPDO may have something to tell.
    fn must_look(&self) -> bool {
        self.is_touched
            && self.state == NmtState::Operational
            && self.tpdos.iter().any(Tpdo::is_event_driven)
    }
}

/// The objects of the communication profile.
const COMMUNICATION_PROFILE: std::ops::RangeInclusive<u16> = 0x1000..=0x1FFF;
