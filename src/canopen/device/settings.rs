//! A device follows its objects: what a write by SDO changes in it at once.

use std::time::Duration;

use crate::canopen::device::Application;
use crate::canopen::device::Device;
use crate::canopen::device::access::Objects;
use crate::canopen::device::errors;
use crate::canopen::device::parameter::Place;
use crate::canopen::device::store;
use crate::canopen::frame::COB_ID_MAX;
use crate::canopen::frame::Frame;
use crate::canopen::object::Object;
use crate::time::Instant;

impl<A: Application> Device<A> {
    pub(super) fn serve(&mut self, now: Instant, request: [u8; 8], out: &mut Vec<Frame>) {
        let Self { dictionary, application, manners, .. } = self;
        let mut objects = Objects { dictionary, application, manners, written: None };
        self.sdo.serve(now, request, &mut objects, out);
        if let Some(object) = objects.written {
            self.follow(now, object);
        }
    }

    /// Does as an object says that has just been written.
    pub(super) fn follow(&mut self, now: Instant, object: Object) {
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

    pub(super) fn follow_sync(&mut self) {
        let identifier = self.dictionary.unsigned(Object::SYNC_COB_ID) & u32::from(COB_ID_MAX);
        self.sync_cob_id = u16::try_from(identifier).unwrap_or(0);
        let counts = self.dictionary.entry(Object::SYNC_OVERFLOW);
        self.sync_bytes =
            counts.map(|_| usize::from(self.dictionary.unsigned(Object::SYNC_OVERFLOW) > 0));
    }
}
