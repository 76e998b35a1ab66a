//! Effect of SDO writes on a device.

use std::time::Duration;

use canopen_rs::NmtState;

use crate::access::Objects;
use crate::parameter::Place;
use crate::{Application, Device, history, store};
use canopen::frame::Frame;
use canopen::object::Object;
use units::time::Instant;

impl<A: Application> Device<A> {
    pub(super) fn serve(&mut self, now: Instant, request: [u8; 8], out: &mut Vec<Frame>) {
        let is_operational = self.state() == NmtState::Operational;
        let Self { dictionary, application, misbehaviour, .. } = self;
        let mut objects =
            Objects { dictionary, application, misbehaviour, is_operational, written: None };
        self.sdo.serve(now, request, &mut objects, out);
        if let Some(object) = objects.written {
            self.apply(now, object);
        }
    }

    /// Applies an object after a write.
    fn apply(&mut self, now: Instant, object: Object) {
        self.is_touched = true;
        store::apply(object, &mut self.dictionary);
        match object {
            Object::SYNC_COB_ID | Object::SYNC_WINDOW | Object::SYNC_OVERFLOW => {
                self.sync.configure(&self.dictionary);
            }
            Object::TIME_COB_ID => self.clock.configure(&self.dictionary),
            Object::EMCY_COB_ID | Object::EMCY_INHIBIT_TIME => {
                self.errors.configure(&self.dictionary);
            }
            Object::ERROR_HISTORY => history::clear(&mut self.dictionary),
            Object::GUARD_TIME | Object::LIFE_TIME_FACTOR => {
                self.guarding.forget();
                self.update_monitors();
            }
            Object::PRODUCER_HEARTBEAT => {
                self.heartbeat.configure_producer(&self.dictionary, now, Duration::ZERO);
                self.guarding.forget();
                self.update_monitors();
            }
            Object { index, .. } if index == Object::CONSUMER_HEARTBEAT.index => {
                self.heartbeat.configure_consumers(&self.dictionary);
                self.update_monitors();
            }
            object => {
                if let Some(place) = Place::from_parameter(object) {
                    self.resolve(place);
                    self.update_rpdo_errors();
                }
            }
        }
        self.update_filter();
    }
}
