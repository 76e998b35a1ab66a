//! Interface of devices to faults: connection, COB-IDs, errors.

use canopen_rs::NodeId;
use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::sdo::{request_cob_id, response_cob_id};

use crate::drive::Drive;
use crate::switches::SwitchBox;
use canopen::frame::{COB_ID_MAX, Channel};
use canopen::nmt;
use canopen::object::Object;
use canopen::sync;
use canopen_device::dictionary::Dictionary;
use canopen_device::station::Station;
use faults::Service;
use units::time::Instant;

/// Device to which faults can be applied.
pub trait Breakable: Station {
    /// Returns the bus of the device.
    fn channel(&self) -> Channel;

    /// Returns the COB-ID of a service in this direction; `None` where the device does not use it.
    fn cob_id(&self, direction: Direction, service: Service) -> Option<u16>;

    /// Disconnects the device from bus and supply.
    fn switch_off(&mut self);

    /// Connects the device to bus and supply: it boots.
    fn switch_on(&mut self, now: Instant);

    /// Sends an emergency message with this error register (1001h), without a change of state.
    fn send_emergency(&mut self, code: u16, register: u8);

    /// Makes a drive enter its state Fault with this error code, 0 for none.
    fn fail_with(&mut self, _code: u16) {}

    /// Sets a drive's safe torque off input.
    fn set_safe_torque_off(&mut self, _is_on: bool) {}

    /// Sets whether a drive's controlwords have no effect.
    fn set_ignores_controlword(&mut self, _ignores: bool) {}

    /// Writes a drive's torque offset (60B2h) at its service port, in ‰ of rated torque.
    fn set_torque_offset(&mut self, _per_mille: i16) {}
}

/// Direction of a frame between a device and its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From the bus to the device.
    ToDevice,
    /// From the device to the bus.
    FromDevice,
}

impl Breakable for Drive {
    fn channel(&self) -> Channel {
        self.channel()
    }

    fn cob_id(&self, direction: Direction, service: Service) -> Option<u16> {
        cob_id(self.node(), self.dictionary(), direction, service)
    }

    fn switch_off(&mut self) {
        self.switch_off();
    }

    fn switch_on(&mut self, now: Instant) {
        self.switch_on(now);
    }

    fn send_emergency(&mut self, code: u16, register: u8) {
        self.report_transient_error(code, register);
    }

    fn fail_with(&mut self, code: u16) {
        self.fail_with(code);
    }

    fn set_safe_torque_off(&mut self, is_on: bool) {
        self.set_safe_torque_off(is_on);
    }

    fn set_ignores_controlword(&mut self, ignores: bool) {
        self.set_ignores_controlword(ignores);
    }

    fn set_torque_offset(&mut self, per_mille: i16) {
        self.set_torque_offset(per_mille);
    }
}

impl Breakable for SwitchBox {
    fn channel(&self) -> Channel {
        self.channel()
    }

    fn cob_id(&self, direction: Direction, service: Service) -> Option<u16> {
        cob_id(self.node(), self.dictionary(), direction, service)
    }

    fn switch_off(&mut self) {
        self.unplug();
    }

    fn switch_on(&mut self, now: Instant) {
        self.switch_on(now);
    }

    fn send_emergency(&mut self, code: u16, register: u8) {
        self.report_transient_error(code, register);
    }
}

/// Returns the COB-ID of a service, as the device's objects have it now.
fn cob_id(
    node: NodeId,
    objects: &Dictionary,
    direction: Direction,
    service: Service,
) -> Option<u16> {
    use Direction::{FromDevice, ToDevice};
    match (direction, service) {
        (FromDevice, Service::Tpdo(number)) => {
            valid(objects, Object::tpdo_communication(number, 1))
        }
        (ToDevice, Service::Rpdo(number)) => valid(objects, Object::rpdo_communication(number, 1)),
        (FromDevice, Service::Emergency) => valid(objects, Object::EMCY_COB_ID),
        (FromDevice, Service::Heartbeat) => Some(heartbeat_cob_id(node)),
        (FromDevice, Service::Sdo) => Some(response_cob_id(node)),
        (ToDevice, Service::Sdo) => Some(request_cob_id(node)),
        // Bit 30 says that the device produces SYNC; it is masked away.
        // Without the object the device consumes the SYNC of the predefined connection set.
        (ToDevice, Service::Sync) => match objects.entry(Object::SYNC_COB_ID) {
            Some(_) => valid(objects, Object::SYNC_COB_ID),
            None => Some(sync::COB_ID),
        },
        (ToDevice, Service::Nmt) => Some(nmt::COB_ID),
        (ToDevice, Service::Tpdo(_) | Service::Emergency | Service::Heartbeat)
        | (FromDevice, Service::Rpdo(_) | Service::Sync | Service::Nmt) => None,
    }
}

/// Returns the COB-ID in an object, unless the object is absent or marks it as invalid (bit 31).
fn valid(objects: &Dictionary, object: Object) -> Option<u16> {
    objects.entry(object)?;
    let raw = objects.unsigned(object);
    let is_used = raw >> 31 == 0;
    u16::try_from(raw & u32::from(COB_ID_MAX)).ok().filter(|_| is_used)
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::eds::Eds;

    #[test]
    fn sync_is_lost_at_80h_where_1005h_is_absent() {
        let eds = Eds::parse(include_bytes!("../../../../eds/drives/elmo-gold.eds")).unwrap();
        let node = NodeId::new(3).unwrap();
        let objects = Dictionary::new(&eds, node);
        assert!(objects.entry(Object::SYNC_COB_ID).is_none());
        let lost = cob_id(node, &objects, Direction::ToDevice, Service::Sync);
        assert_eq!(lost, Some(sync::COB_ID));
    }
}
