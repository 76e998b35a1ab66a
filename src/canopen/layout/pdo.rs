//! One PDO of a node, and the SDO writes that configure it (CiA 301, 7.5.2.35 to 7.5.2.38).

use canopen_rs::Value;
use canopen_rs::pdo::PDO_COB_ID_INVALID;

use crate::master::check::COB_ID_NO_RTR;
use crate::object::Object;
use crate::sync::TransmissionType;

/// Direction of a PDO, as seen from the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// RPDO: sent by the master.
    Receive,
    /// TPDO: sent by the node.
    Transmit,
}

/// Object mapped into a PDO, with its length (CiA 301, 7.5.2.36).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MappedObject {
    /// Index and sub-index of the object; a [dummy](Object::is_dummy) for bits that the node skips.
    pub object: Object,
    /// Length in bits.
    pub bits: u8,
}

impl MappedObject {
    /// Returns the entry of a mapping parameter: index, sub-index and length in bits (CiA 301, 7.5.2.36).
    pub const fn entry(&self) -> u32 {
        let [high, low] = self.object.index.to_be_bytes();
        u32::from_be_bytes([high, low, self.object.sub, self.bits])
    }
}

/// PDO of a node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pdo {
    /// Direction of the frame: RPDO or TPDO.
    pub direction: Direction,
    /// Number, from 1.
    pub number: u16,
    /// COB-ID of the frame, 11 bits, without the flags of 1400h:1 and 1800h:1.
    pub cob_id: u16,
    /// Set if bit 30 of its COB-ID entry stays set: a TPDO that may not be requested by RTR.
    pub has_no_rtr: bool,
    /// Configuration; `None` disables the PDO, as drives power up with some enabled.
    pub service: Option<Service>,
}

/// Configuration of a PDO.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Service {
    /// Transmission type.
    pub transmission: TransmissionType,
    /// Inhibit time, in 100 µs; `None` leaves the drive's value.
    pub inhibit_100us: Option<u16>,
    /// Event timer in ms: maximum period of a TPDO, timeout of an RPDO. `None` leaves the drive's value.
    pub event_timer_ms: Option<u16>,
    /// Mapped objects, in order.
    pub mapping: Vec<MappedObject>,
}

impl Service {
    /// Returns a service that maps these objects, each with its bits, and leaves inhibit time and event timer as they are.
    pub fn new(transmission: TransmissionType, mapping: &[(Object, u8)]) -> Self {
        let mapped =
            mapping.iter().map(|(object, bits)| MappedObject { object: *object, bits: *bits });
        Self { transmission, inhibit_100us: None, event_timer_ms: None, mapping: mapped.collect() }
    }

    /// Length of the frame, in bytes.
    pub fn bytes(&self) -> u32 {
        let bits: u32 = self.mapping.iter().map(|mapped| u32::from(mapped.bits)).sum();
        bits.div_ceil(8)
    }
}

impl Pdo {
    /// Sub-index `sub` of the communication parameter.
    pub const fn communication(&self, sub: u8) -> Object {
        match self.direction {
            Direction::Receive => Object::rpdo_communication(self.number, sub),
            Direction::Transmit => Object::tpdo_communication(self.number, sub),
        }
    }

    /// Sub-index `sub` of the mapping parameter.
    pub const fn mapping(&self, sub: u8) -> Object {
        match self.direction {
            Direction::Receive => Object::rpdo_mapping(self.number, sub),
            Direction::Transmit => Object::tpdo_mapping(self.number, sub),
        }
    }

    /// Writes that configure the PDO, in the order of CiA 301 (7.5.2.36): disable, clear the mapping, map, count,
    /// transmission, enable.
    pub fn writes(&self) -> Vec<(Object, Value)> {
        let bit_30 = if self.has_no_rtr { COB_ID_NO_RTR } else { 0 };
        let cob_id = u32::from(self.cob_id) | bit_30;
        let mut writes =
            vec![(self.communication(1), Value::Unsigned32(PDO_COB_ID_INVALID | cob_id))];
        let Some(service) = &self.service else { return writes };
        writes.push((self.mapping(0), Value::Unsigned8(0)));
        let mut entries = 0;
        for mapped in &service.mapping {
            entries += 1;
            writes.push((self.mapping(entries), Value::Unsigned32(mapped.entry())));
        }
        writes.push((self.mapping(0), Value::Unsigned8(entries)));
        writes.push((self.communication(2), Value::Unsigned8(service.transmission.0)));
        writes.extend(service.inhibit_100us.map(|t| (self.communication(3), Value::Unsigned16(t))));
        writes
            .extend(service.event_timer_ms.map(|t| (self.communication(5), Value::Unsigned16(t))));
        writes.push((self.communication(1), Value::Unsigned32(cob_id)));
        writes
    }
}
