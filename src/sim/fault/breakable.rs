//! A device as those see it who break it: its plug, its identifiers, its power stage.

use canopen_rs::NodeId;
use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::sdo::request_cob_id;
use canopen_rs::sdo::response_cob_id;

use crate::drive::Drive;
use crate::scenario::fault::Service;
use crate::switches::SwitchBox;
use canopen::dictionary::Dictionary;
use canopen::frame::COB_ID_MAX;
use canopen::frame::Channel;
use canopen::nmt;
use canopen::object::Object;
use canopen::station::Station;
use units::time::Instant;

/// A device that can be broken.
pub trait Breakable: Station {
    /// Its bus.
    fn channel(&self) -> Channel;

    /// The identifier on which it says or hears something now; `None` if it does not.
    fn cob_id(&self, way: Way, service: Service) -> Option<u16>;

    /// Its plug is pulled, with bus and supply.
    fn switch_off(&mut self);

    /// It has bus and supply, and boots up.
    fn switch_on(&mut self, now: Instant);

    /// It tells of an error, of the class `register` (1001h), and nothing follows.
    fn report_transient_error(&mut self, code: u16, register: u8);

    /// It fails with an error code, 0 for none, if it has anything to fail.
    fn fail_with(&mut self, _code: u16) {}

    /// Its safe torque off is asked for, or no longer, if it has torque.
    fn set_safe_torque_off(&mut self, _is_on: bool) {}
}

/// Where a frame is going.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// From the bus to the device.
    Heard,
    /// From the device to the bus.
    Said,
}

impl Breakable for Drive {
    fn channel(&self) -> Channel {
        self.channel()
    }

    fn cob_id(&self, way: Way, service: Service) -> Option<u16> {
        cob_id(self.node(), self.dictionary(), way, service)
    }

    fn switch_off(&mut self) {
        self.switch_off();
    }

    fn switch_on(&mut self, now: Instant) {
        self.switch_on(now);
    }

    fn report_transient_error(&mut self, code: u16, register: u8) {
        self.report_transient_error(code, register);
    }

    fn fail_with(&mut self, code: u16) {
        self.fail_with(code);
    }

    fn set_safe_torque_off(&mut self, is_on: bool) {
        self.set_safe_torque_off(is_on);
    }
}

impl Breakable for SwitchBox {
    fn channel(&self) -> Channel {
        self.channel()
    }

    fn cob_id(&self, way: Way, service: Service) -> Option<u16> {
        cob_id(self.node(), self.dictionary(), way, service)
    }

    fn switch_off(&mut self) {
        self.unplug();
    }

    fn switch_on(&mut self, now: Instant) {
        self.switch_on(now);
    }

    fn report_transient_error(&mut self, code: u16, register: u8) {
        self.report_transient_error(code, register);
    }
}

/// The identifier of a service, as the device's objects have it now.
fn cob_id(node: NodeId, objects: &Dictionary, way: Way, service: Service) -> Option<u16> {
    match (way, service) {
        (Way::Said, Service::Tpdo(number)) => valid(objects, Object::tpdo_communication(number, 1)),
        (Way::Heard, Service::Rpdo(number)) => {
            valid(objects, Object::rpdo_communication(number, 1))
        }
        (Way::Said, Service::Emergency) => valid(objects, Object::EMCY_COB_ID),
        (Way::Said, Service::Heartbeat) => Some(heartbeat_cob_id(node)),
        (Way::Said, Service::Sdo) => Some(response_cob_id(node)),
        (Way::Heard, Service::Sdo) => Some(request_cob_id(node)),
        (Way::Heard, Service::Sync) => {
            // Bit 30 says that it sends it.
            valid(objects, Object::SYNC_COB_ID)
        }
        (Way::Heard, Service::Nmt) => Some(nmt::COB_ID),
        (Way::Heard, Service::Tpdo(_) | Service::Emergency | Service::Heartbeat)
        | (Way::Said, Service::Rpdo(_) | Service::Sync | Service::Nmt) => None,
    }
}

/// An identifier, unless its object is not there or says that it is not used (bit 31).
fn valid(objects: &Dictionary, object: Object) -> Option<u16> {
    objects.entry(object)?;
    let raw = objects.unsigned(object);
    let is_used = raw >> 31 == 0;
    u16::try_from(raw & u32::from(COB_ID_MAX)).ok().filter(|_| is_used)
}
