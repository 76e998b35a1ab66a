//! SYNC and PDOs of an operational device (CiA 301, 7.2.2 and 7.2.5): order of actions, and errors.

use canopen_rs::NmtState;

use crate::condition::Condition;
use crate::parameter::Place;
use crate::rpdo::{Reception, Rpdo};
use crate::tpdo::Tpdo;
use crate::{Application, Device, clock};
use canopen::frame::Frame;
use canopen::layout::Direction;
use canopen::sync::Sync;
use units::time::Instant;

impl<A: Application> Device<A> {
    /// Applies changed parameters of a PDO.
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

    /// Takes a SYNC, a TIME or an RPDO in operational.
    pub(super) fn on_process_frame(&mut self, now: Instant, frame: &Frame) {
        if self.sync.is_sync(frame) {
            self.take_sync(now, frame);
        } else if !self.clock.on_frame(now, frame) {
            self.on_rpdo(now, frame);
        }
    }

    /// Takes a SYNC; one of the wrong length is reported and ignored (CiA 301, 7.5.2.22).
    fn take_sync(&mut self, now: Instant, frame: &Frame) {
        let Self { sync, errors, dictionary, .. } = self;
        if sync.take(now, frame) {
            errors.clear(Condition::SyncLength, dictionary);
            self.on_sync(now, Sync { counter: frame.data().first().copied() });
        } else {
            errors.raise(Condition::SyncLength, [0; 5], dictionary);
        }
    }

    fn on_sync(&mut self, now: Instant, sync: Sync) {
        if !std::mem::take(&mut self.is_late) {
            self.errors.clear(Condition::SyncWindow, &mut self.dictionary);
        }
        for place in 0..self.rpdos.len() {
            let Some(rpdo) = self.rpdos.get_mut(place) else { continue };
            if let Some(content) = rpdo.on_sync() {
                self.act(place, content);
            }
        }
        self.application.on_sync(&mut self.dictionary);
        clock::stamp(now, &mut self.dictionary);
        self.update_application_error();
        for tpdo in &mut self.tpdos {
            tpdo.on_sync(sync, now + self.latency, &self.dictionary);
        }
        self.is_touched = true;
    }

    fn on_rpdo(&mut self, now: Instant, frame: &Frame) {
        let is_open = self.sync.is_open(now);
        let mut is_mine = false;
        for place in 0..self.rpdos.len() {
            let Some(rpdo) = self.rpdos.get_mut(place) else { continue };
            let Some(received) = rpdo.on_frame(now, is_open, frame) else { continue };
            is_mine = true;
            match received {
                Reception::Acts(content) => self.act(place, content),
                Reception::Late => self.miss_window(),
                Reception::Held | Reception::Ignored => {}
            }
        }
        if is_mine {
            self.update_rpdo_errors();
        }
    }

    /// Sends the TPDOs that are due in operational.
    pub(super) fn send_tpdos(&mut self, now: Instant, out: &mut Vec<Frame>) {
        let is_open = self.sync.is_open(now);
        let mut is_in_time = true;
        for tpdo in &mut self.tpdos {
            is_in_time &= tpdo.on_time(now, is_open, &self.dictionary, out);
        }
        if !is_in_time {
            self.miss_window();
        }
    }

    /// Reports a discarded synchronous PDO, until a window passes without one (CiA 301, 7.5.2.7).
    fn miss_window(&mut self) {
        self.is_late = true;
        self.errors.raise(Condition::SyncWindow, [0; 5], &mut self.dictionary);
    }

    /// Sets or clears the error conditions of all RPDOs together.
    pub(super) fn update_rpdo_errors(&mut self) {
        for condition in [Condition::RpdoTooShort, Condition::RpdoTooLong, Condition::RpdoTimeout] {
            if self.rpdos.iter().any(|rpdo| rpdo.conditions().has(condition)) {
                self.errors.raise(condition, [0; 5], &mut self.dictionary);
            } else {
                self.errors.clear(condition, &mut self.dictionary);
            }
        }
    }

    /// Applies `content` of the RPDO at `place`: sets all objects, then informs the application.
    fn act(&mut self, place: usize, content: u64) {
        let Some(rpdo) = self.rpdos.get(place) else { return };
        rpdo.mapping().scatter(content, &mut self.dictionary);
        for object in rpdo.mapping().objects() {
            self.application.written(&mut self.dictionary, object);
        }
        self.is_touched = true;
    }

    /// Returns whether an event-driven TPDO may have changed.
    pub(super) fn must_compare(&self) -> bool {
        self.is_touched
            && self.state == NmtState::Operational
            && self.tpdos.iter().any(Tpdo::is_event_driven)
    }
}
