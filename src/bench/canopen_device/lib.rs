//! CANopen device (CiA 301) driven by its object dictionary: NMT slave, SDO server, PDOs, emergencies and error
//! control.
//!
//! The function of the device is its [`Application`]: a drive, a switch box. A pure machine with three verbs;
//! cyclic operation allocates nothing.
#![forbid(unsafe_code)]

mod access;
mod application;
mod clock;
mod condition;
mod consumed;
mod deadline;
pub mod dictionary;
mod errors;
mod filter;
mod guarding;
mod heartbeat;
mod history;
pub mod lss;
mod mapping;
mod misbehaviour;
mod parameter;
mod process;
mod rpdo;
mod sdo_server;
mod settings;
mod states;
pub mod station;
mod store;
mod sync;
#[cfg(test)]
mod tests;
mod tpdo;

pub use application::{Application, ConnectionLoss, Reset};
pub use misbehaviour::Misbehaviour;

use std::time::Duration;

use canopen_rs::{NmtState, NodeId};

use crate::clock::Clock;
use crate::dictionary::Dictionary;
use crate::errors::Errors;
use crate::filter::AcceptanceFilter;
use crate::guarding::Guarding;
use crate::heartbeat::Heartbeat;
use crate::lss::layer::{self, Layer};
use crate::rpdo::Rpdo;
use crate::sdo_server::SdoServer;
use crate::sync::SyncConsumer;
use crate::tpdo::Tpdo;
use canopen::frame::Frame;
use canopen::nmt::Order;
use units::time::Instant;

/// CANopen device (CiA 301): an application behind a dictionary and all services of its node-id.
#[derive(Clone, Debug)]
pub struct Device<A> {
    node: NodeId,
    layer: Layer,
    dictionary: Dictionary,
    application: A,
    state: NmtState,
    latency: Duration,
    sync: SyncConsumer,
    /// Set if a synchronous PDO was discarded since the last SYNC.
    is_late: bool,
    clock: Clock,
    sdo: SdoServer,
    rpdos: Vec<Rpdo>,
    tpdos: Vec<Tpdo>,
    errors: Errors,
    heartbeat: Heartbeat,
    guarding: Guarding,
    misbehaviour: Misbehaviour,
    /// Objects may have changed since event-driven TPDOs were last compared.
    is_touched: bool,
    filter: AcceptanceFilter,
    /// Time of the next call of [`on_time`](Self::on_time), updated with every change.
    due: Option<Instant>,
}

impl<A: Application> Device<A> {
    /// Returns a device after power-up; it boots up with the first call of [`on_time`](Self::on_time).
    ///
    /// Synchronous TPDOs are sent `latency` after the SYNC at which they were sampled.
    pub fn new(node: NodeId, dictionary: Dictionary, application: A, latency: Duration) -> Self {
        let mut device = Self {
            node,
            layer: Layer::new(node, &dictionary),
            state: NmtState::Initialising,
            latency,
            sync: SyncConsumer::default(),
            is_late: false,
            clock: Clock::default(),
            sdo: SdoServer::new(node),
            rpdos: Vec::new(),
            tpdos: Vec::new(),
            errors: Errors::default(),
            heartbeat: Heartbeat::default(),
            guarding: Guarding::default(),
            misbehaviour: Misbehaviour::default(),
            is_touched: false,
            filter: AcceptanceFilter::default(),
            due: None,
            dictionary,
            application,
        };
        device.initialise(Reset::Node);
        device.update_deadline();
        device
    }

    /// Node-id, or the last one if LSS has removed it.
    pub const fn node(&self) -> NodeId {
        self.node
    }

    /// NMT state; initialising until the boot-up message is sent.
    pub const fn state(&self) -> NmtState {
        self.state
    }

    /// Returns the behaviour above the communication.
    pub const fn application(&self) -> &A {
        &self.application
    }

    /// Object dictionary.
    pub const fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    /// Time of day by the last TIME message (1012h), since 1 January 1970; `None` before the first one.
    pub fn since_1970(&self, now: Instant) -> Option<Duration> {
        self.clock.since_1970(now)
    }

    /// Changes the application from outside, such as a moved shaft. Event-driven TPDOs follow with the next
    /// [`on_time`](Self::on_time).
    pub fn touch(&mut self, change: impl FnOnce(&mut A, &mut Dictionary)) {
        change(&mut self.application, &mut self.dictionary);
        self.is_touched = true;
        self.update_deadline();
    }

    /// Reports a transient error: the next [`on_time`](Self::on_time) sends an emergency with `register`, and
    /// the error history records it.
    pub fn report_transient_error(&mut self, code: u16, register: u8) {
        self.errors.report_transient_error(code, register, &mut self.dictionary);
        self.update_deadline();
    }

    /// Takes one received frame; frames to send are appended to `out`.
    #[inline]
    pub fn on_frame(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) {
        if self.filter.passes(frame) || self.is_due(now) {
            self.take(now, frame, out);
        }
    }

    /// Performs the actions due at `now`.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.take_time(now, out);
        self.update_deadline();
    }

    /// Takes a frame that passes the filter, and sends the frames due at `now`.
    fn take(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) {
        let is_communicating = self.take_frame(now, frame, out);
        self.update_deadline();
        if is_communicating && self.is_due(now) {
            self.send_pending(now, out);
            self.update_deadline();
        }
    }

    /// Takes a frame of any COB-ID. Returns whether frames that follow from it may be sent.
    fn take_frame(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) -> bool {
        if layer::is_request(frame) {
            self.on_lss(now, frame, out);
            return false;
        }
        if self.state == NmtState::Initialising || self.layer.silence().is_some() {
            return false;
        }
        if frame.is_remote() {
            self.on_remote_frame(now, frame, out);
        } else if let Some(order) = Order::decode(frame) {
            if order.node.is_none_or(|node| node == self.node) {
                self.on_nmt_command(now, order.command, out);
            }
        } else if self.heartbeat.on_frame(now, frame) {
            self.update_monitors();
        } else if let Some(request) = self.sdo.request(frame) {
            if self.state != NmtState::Stopped {
                self.serve(now, request, out);
            }
        } else if self.state == NmtState::Operational {
            self.on_process_frame(now, frame);
        } else if self.state == NmtState::PreOperational {
            self.clock.on_frame(now, frame);
        }
        true
    }

    fn take_time(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.layer.wake(now);
        self.run_application(now);
        if self.layer.silence().is_some() {
            return;
        }
        if self.state == NmtState::Initialising {
            self.boot_up(now, out);
        }
        self.watch(now, out);
        self.sdo.on_time(now, out);
        self.send_pending(now, out);
    }

    fn run_application(&mut self, now: Instant) {
        if self.application.deadline().is_some_and(|due| due <= now) {
            self.application.on_time(now, &mut self.dictionary);
            self.is_touched = true;
        }
    }

    /// Answers a remote frame: guarding, or a request of a TPDO.
    fn on_remote_frame(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) {
        if let Some(answer) =
            self.guarding.answer(now, frame, self.node, self.state, &self.dictionary)
        {
            self.update_monitors();
            self.errors.send(now, out);
            out.push(answer);
        } else if self.state == NmtState::Operational {
            let answers = self.tpdos.iter().filter_map(|it| it.on_request(frame, &self.dictionary));
            out.extend(answers);
        }
    }

    /// Reports a change of the application's error.
    fn update_application_error(&mut self) {
        let code = self.application.error_code();
        self.errors.set_application_error(code, &mut self.dictionary);
    }

    /// Sends everything that follows from the last event. Without a [deadline](Self::deadline) until `now` there is
    /// nothing to send.
    fn send_pending(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.update_application_error();
        if self.must_compare() {
            for tpdo in &mut self.tpdos {
                tpdo.compare(&self.dictionary);
            }
        }
        self.is_touched = false;
        self.errors.send(now, out);
        if self.state == NmtState::Operational {
            self.send_tpdos(now, out);
        }
        self.errors.send(now, out);
        out.extend(self.heartbeat.due(now, self.node, self.state));
    }
}
