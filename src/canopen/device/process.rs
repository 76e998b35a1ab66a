//! What a device does with SYNC and its PDOs in operational (CiA 301, 7.2.2 and 7.2.5): in which order they
//! act, and what is told when they are wrong.

use canopen_rs::NmtState;

use crate::canopen::device::Application;
use crate::canopen::device::Device;
use crate::canopen::device::errors;
use crate::canopen::device::errors::Condition;
use crate::canopen::device::parameter::Place;
use crate::canopen::device::rpdo::Received;
use crate::canopen::device::rpdo::Rpdo;
use crate::canopen::device::tpdo::Tpdo;
use crate::canopen::frame::Frame;
use crate::canopen::layout::Direction;
use crate::time::Instant;

impl<A: Application> Device<A> {
    /// A PDO follows its parameters.
    pub(super) fn resolve(&mut self, changed: Place) {
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

    /// A SYNC of another length is none, and that is told (CiA 301, 7.5.2.22).
    pub(super) fn take_sync(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) {
        let Self { errors, dictionary, .. } = self;
        if self.sync_bytes.is_none_or(|bytes| bytes == frame.data().len()) {
            errors.settle(Condition::SyncLength, dictionary, out);
            self.on_sync(now, out);
        } else {
            errors.raise(Condition::SyncLength, errors::SYNC_LENGTH, [0; 5], dictionary, out);
        }
    }

    pub(super) fn on_sync(&mut self, now: Instant, out: &mut Vec<Frame>) {
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

    pub(super) fn on_rpdo(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) {
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
    pub(super) fn act(&mut self, place: usize, content: u64) {
        let Some(rpdo) = self.rpdos.get(place) else { return };
        rpdo.mapping().scatter(content, &mut self.dictionary);
        for object in rpdo.mapping().objects() {
            self.application.written(&mut self.dictionary, object);
        }
        self.is_touched = true;
    }

    /// Whether an event-driven TPDO may have something to tell.
    pub(super) fn must_look(&self) -> bool {
        self.is_touched
            && self.state == NmtState::Operational
            && self.tpdos.iter().any(Tpdo::is_event_driven)
    }
}
