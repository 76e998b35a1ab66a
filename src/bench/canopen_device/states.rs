//! NMT states of a device and their transitions (CiA 301, 7.3.2.2): commands, resets, loss of the master.

use canopen_rs::nmt::{encode_heartbeat, heartbeat_cob_id};
use canopen_rs::{NmtCommand, NmtState};

use crate::condition::Condition;
use crate::heartbeat::Heartbeat;
use crate::parameter::Place;
use crate::rpdo::Rpdo;
use crate::tpdo::Tpdo;
use crate::{Application, ConnectionLoss, Device, Reset, mapping};
use canopen::frame::Frame;
use canopen::layout::Direction;
use canopen::object::Object;
use units::time::Instant;

impl<A: Application> Device<A> {
    pub(super) fn on_nmt_command(
        &mut self,
        now: Instant,
        command: NmtCommand,
        out: &mut Vec<Frame>,
    ) {
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

    /// Resets all objects or communication only, and activates the node-id configured by LSS.
    pub(super) fn reset(&mut self, now: Instant, reset: Reset, out: &mut Vec<Frame>) {
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

    /// Handles stop and reset in operational as a loss of the master, without an emergency.
    fn leave_operational(&mut self) {
        if self.state == NmtState::Operational {
            self.react_to(ConnectionLoss::Stopped);
        }
    }

    /// Applies the restored dictionary.
    pub(super) fn initialise(&mut self, reset: Reset) {
        self.state = NmtState::Initialising;
        self.sdo.reset();
        let numbers = |direction| Place::all(&self.dictionary, direction).map(|place| place.number);
        self.rpdos =
            numbers(Direction::Receive).map(|number| Rpdo::new(&self.dictionary, number)).collect();
        self.tpdos = numbers(Direction::Transmit)
            .map(|number| Tpdo::new(&self.dictionary, number))
            .collect();
        self.heartbeat.restart(&self.dictionary);
        self.guarding.restart();
        self.sync.configure(&self.dictionary);
        self.is_late = false;
        self.clock.configure(&self.dictionary);
        self.application.on_reset(&mut self.dictionary, reset);
        self.errors.reset(self.application.error_code(), &mut self.dictionary);
        self.update_filter();
    }

    pub(super) fn boot_up(&mut self, now: Instant, out: &mut Vec<Frame>) {
        let boot_up = encode_heartbeat(NmtState::Initialising);
        out.push(Frame::new(heartbeat_cob_id(self.node), boot_up));
        self.enter(NmtState::PreOperational);
        // The boot-up message counts as the first heartbeat.
        self.heartbeat.configure_producer(
            &self.dictionary,
            now,
            Heartbeat::period(&self.dictionary),
        );
    }

    pub(super) fn enter(&mut self, state: NmtState) {
        if self.state == state {
            return;
        }
        self.state = state;
        self.errors.allow(matches!(state, NmtState::PreOperational | NmtState::Operational));
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

    /// Detects the loss of the master: heartbeat, guarding, RPDOs.
    pub(super) fn watch(&mut self, now: Instant, out: &mut Vec<Frame>) {
        let no_heartbeat = self.heartbeat.detect_loss(now).then_some(Condition::HeartbeatLost);
        let no_guard = self.guarding.detect_loss(now).then_some(Condition::GuardLost);
        for condition in no_heartbeat.into_iter().chain(no_guard) {
            self.lose_connection(condition, ConnectionLoss::Heartbeat);
            self.errors.send(now, out);
            self.apply_error_behaviour();
        }
        let mut is_missed = false;
        for rpdo in &mut self.rpdos {
            is_missed |= rpdo.detect_timeout(now);
        }
        if is_missed {
            self.lose_connection(Condition::RpdoTimeout, ConnectionLoss::RpdoTimeout);
        }
    }

    fn lose_connection(&mut self, condition: Condition, why: ConnectionLoss) {
        let manufacturer = self.react_to(why);
        self.errors.raise(condition, manufacturer, &mut self.dictionary);
        self.is_touched = true;
    }

    /// Clears the conditions of monitors that are no longer lost.
    pub(super) fn update_monitors(&mut self) {
        if !self.heartbeat.is_lost() {
            self.errors.clear(Condition::HeartbeatLost, &mut self.dictionary);
        }
        if !self.guarding.is_lost() {
            self.errors.clear(Condition::GuardLost, &mut self.dictionary);
        }
    }

    /// Applies the error behaviour (1029h:1) after a communication error; by default the device leaves
    /// operational. An RPDO timeout is not such an error (CiA 301, 7.5.2.32).
    fn apply_error_behaviour(&mut self) {
        if self.state != NmtState::Operational {
            return;
        }
        match mapping::byte(&self.dictionary, Object::ERROR_BEHAVIOUR) {
            0 => self.enter(NmtState::PreOperational),
            2 => self.enter(NmtState::Stopped),
            _ => {}
        }
    }
}

/// Objects of the communication profile.
const COMMUNICATION_PROFILE: std::ops::RangeInclusive<u16> = 0x1000..=0x1FFF;
