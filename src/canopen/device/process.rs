//! What a device does with SYNC and its PDOs in operational (CiA 301, 7.2.2 and 7.2.5): in which order they
//! act, and what is told when they are wrong.

use canopen_rs::NmtState;

use crate::device::Application;
use crate::device::Device;
use crate::device::clock;
use crate::device::condition::Condition;
use crate::device::parameter::Place;
use crate::device::rpdo::Received;
use crate::device::rpdo::Rpdo;
use crate::device::tpdo::Tpdo;
use crate::frame::Frame;
use crate::layout::Direction;
use crate::sync::Sync;
use units::time::Instant;

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

    /// A SYNC, a TIME or an RPDO, in operational.
    pub(super) fn on_process_frame(&mut self, now: Instant, frame: &Frame) {
        if self.sync.hears(frame) {
            self.take_sync(now, frame);
        } else if !self.clock.on_frame(now, frame) {
            self.on_rpdo(now, frame);
        }
    }

    /// A SYNC of another length is none, and that is told (CiA 301, 7.5.2.22).
    fn take_sync(&mut self, now: Instant, frame: &Frame) {
        let Self { sync, errors, dictionary, .. } = self;
        if sync.take(now, frame) {
            errors.settle(Condition::SyncLength, dictionary);
            self.on_sync(now, Sync { counter: frame.data().first().copied() });
        } else {
            errors.raise(Condition::SyncLength, [0; 5], dictionary);
        }
    }

    fn on_sync(&mut self, now: Instant, sync: Sync) {
        if !std::mem::take(&mut self.is_late) {
            self.errors.settle(Condition::SyncWindow, &mut self.dictionary);
        }
        for place in 0..self.rpdos.len() {
            let Some(rpdo) = self.rpdos.get_mut(place) else { continue };
            if let Some(content) = rpdo.on_sync() {
                self.act(place, content);
            }
        }
        self.application.on_sync(&mut self.dictionary);
        clock::stamp(now, &mut self.dictionary);
        self.tell_of_application();
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
                Received::Acts(content) => self.act(place, content),
                Received::Late => self.miss_window(),
                Received::Held | Received::Passed => {}
            }
        }
        if is_mine {
            self.tell_of_rpdos();
        }
    }

    /// Sends the TPDOs that are due, in operational.
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

    /// A synchronous PDO was discarded; told until a window passes without (CiA 301, 7.5.2.7).
    fn miss_window(&mut self) {
        self.is_late = true;
        self.errors.raise(Condition::SyncWindow, [0; 5], &mut self.dictionary);
    }

    /// What is wrong with one RPDO or more is told; what is wrong with none any more is over.
    pub(super) fn tell_of_rpdos(&mut self) {
        for condition in [Condition::RpdoTooShort, Condition::RpdoTooLong, Condition::RpdoTimeout] {
            if self.rpdos.iter().any(|rpdo| rpdo.wrong().has(condition)) {
                self.errors.raise(condition, [0; 5], &mut self.dictionary);
            } else {
                self.errors.settle(condition, &mut self.dictionary);
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

    /// Whether an event-driven TPDO may have something to tell.
    pub(super) fn must_look(&self) -> bool {
        self.is_touched
            && self.state == NmtState::Operational
            && self.tpdos.iter().any(Tpdo::is_event_driven)
    }
}
