//! Which PDOs a node sends and takes, as data, and the SDO writes that tell it so (CiA 301, 7.5.2.35
//! to 7.5.2.38).
//!
//! Only communication and mapping. What the bytes mean is in [`pdo`](crate::canopen::pdo), what they
//! cost in [`load`](crate::canopen::load). A further layout is one more function here.

use canopen_rs::MappingEntry;
use canopen_rs::NodeId;
use canopen_rs::PdoKind;
use canopen_rs::Value;
use canopen_rs::pdo::PDO_COB_ID_INVALID;
use canopen_rs::pdo::default_cob_id;

use crate::canopen::object::Object;
use crate::canopen::sync::Transmission;

/// Seen from the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// An RPDO: the master sends it.
    Receive,
    /// A TPDO: the node sends it.
    Transmit,
}

/// One object in a PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mapped {
    /// What.
    pub object: Object,
    /// How long, in bits.
    pub bits: u8,
}

/// One PDO of one node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pdo {
    /// Which way it goes.
    pub direction: Direction,
    /// Its number, from 1.
    pub number: u16,
    /// The identifier it has on the bus.
    pub cob_id: u16,
    /// How it is used; `None` switches it off, as drives power up with some of them valid.
    pub service: Option<Service>,
}

/// How a PDO is used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Service {
    /// When it is sent, or acts.
    pub transmission: Transmission,
    /// The least time between two frames, in 100 µs; `None` leaves it alone.
    pub inhibit_100us: Option<u16>,
    /// TPDO: the longest time between two frames. RPDO: how long the node waits for one before it
    /// takes this for a fault. In ms; `None` leaves it alone.
    pub event_timer_ms: Option<u16>,
    /// What is in it, in order.
    pub mapping: Vec<Mapped>,
}

impl Service {
    /// The bytes of its frame.
    pub fn bytes(&self) -> u32 {
        let bits: u32 = self.mapping.iter().map(|mapped| u32::from(mapped.bits)).sum();
        bits.div_ceil(8)
    }
}

/// One RPDO and one TPDO at every SYNC, for any CiA 402 drive; the others off.
///
/// A drive without a fresh RPDO for `rpdo_timer_ms` takes this for a fault (1400h:5). `None` is for
/// drives that have no such timer: only the heartbeat stops those.
pub fn per_drive(node: NodeId, rpdo_timer_ms: Option<u16>) -> Vec<Pdo> {
    let sample = Service {
        transmission: Transmission::EVERY_SYNC,
        inhibit_100us: None,
        event_timer_ms: None,
        mapping: vec![
            Mapped { object: Object::STATUSWORD, bits: 16 },
            Mapped { object: Object::POSITION_ACTUAL, bits: 32 },
            Mapped { object: Object::TORQUE_ACTUAL, bits: 16 },
        ],
    };
    let target = Service {
        transmission: Transmission::EVERY_SYNC,
        inhibit_100us: None,
        event_timer_ms: rpdo_timer_ms,
        mapping: vec![
            Mapped { object: Object::CONTROLWORD, bits: 16 },
            Mapped { object: Object::TARGET_TORQUE, bits: 16 },
        ],
    };
    predefined(node, Some(&sample), Some(&target))
}

/// The switch box: its inputs on every change and every 5 ms; the other PDOs off.
pub fn switches(node: NodeId) -> Vec<Pdo> {
    let inputs = Service {
        transmission: Transmission::EVENT_OF_PROFILE,
        inhibit_100us: Some(10),
        event_timer_ms: Some(5),
        mapping: vec![Mapped { object: Object::DIGITAL_INPUTS, bits: 8 }],
    };
    predefined(node, Some(&inputs), None)
}

/// The COB-ID of a node's TPDO1 in the predefined connection set.
pub fn tpdo1(node: NodeId) -> u16 {
    0x180 + u16::from(node.raw())
}

/// The COB-ID of a node's RPDO1 in the predefined connection set.
pub fn rpdo1(node: NodeId) -> u16 {
    0x200 + u16::from(node.raw())
}

/// The eight PDOs of the predefined connection set, of which at most the first two are used.
fn predefined(node: NodeId, tpdo1: Option<&Service>, rpdo1: Option<&Service>) -> Vec<Pdo> {
    let mut pdos = Vec::new();
    for (direction, kind, first) in [
        (Direction::Transmit, PdoKind::Transmit, tpdo1),
        (Direction::Receive, PdoKind::Receive, rpdo1),
    ] {
        for number in 1..=4_u8 {
            let Some(cob_id) = default_cob_id(kind, number, node) else { continue };
            let service = first.filter(|_| number == 1).cloned();
            pdos.push(Pdo { direction, number: u16::from(number), cob_id, service });
        }
    }
    pdos
}

impl Pdo {
    /// Sub-index `sub` of its communication parameter.
    pub const fn communication(&self, sub: u8) -> Object {
        match self.direction {
            Direction::Receive => Object::rpdo_communication(self.number, sub),
            Direction::Transmit => Object::tpdo_communication(self.number, sub),
        }
    }

    /// Sub-index `sub` of its mapping parameter.
    pub const fn mapping(&self, sub: u8) -> Object {
        match self.direction {
            Direction::Receive => Object::rpdo_mapping(self.number, sub),
            Direction::Transmit => Object::tpdo_mapping(self.number, sub),
        }
    }

    /// The writes that set it up, in the order CiA 301 demands (7.5.2.36): off, mapping emptied,
    /// entries, their number, when it is sent, and only then on.
    pub fn writes(&self) -> Vec<(Object, Value)> {
        let cob_id = u32::from(self.cob_id);
        let mut writes =
            vec![(self.communication(1), Value::Unsigned32(PDO_COB_ID_INVALID | cob_id))];
        let Some(service) = &self.service else { return writes };
        writes.push((self.mapping(0), Value::Unsigned8(0)));
        let mut entries = 0;
        for Mapped { object, bits } in &service.mapping {
            entries += 1;
            let entry = MappingEntry::new(object.index, object.sub, *bits).to_u32();
            writes.push((self.mapping(entries), Value::Unsigned32(entry)));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::pdo::DriveSample;
    use crate::canopen::pdo::DriveTarget;
    use crate::canopen::pdo::SwitchInputs;

    fn node() -> NodeId {
        NodeId::new(3).unwrap()
    }

    fn used(pdos: &[Pdo]) -> Vec<(u16, Service)> {
        pdos.iter().filter_map(|pdo| Some((pdo.cob_id, pdo.service.clone()?))).collect()
    }

    #[test]
    fn a_layout_is_as_long_as_its_codec() {
        let drive = used(&per_drive(node(), Some(5)));
        assert_eq!(drive.iter().map(|(cob_id, _)| *cob_id).collect::<Vec<_>>(), [0x183, 0x203]);
        let bytes = drive.iter().map(|(_, pdo)| pdo.bytes()).collect::<Vec<_>>();
        let sample = DriveSample::default().encode().len();
        let target = DriveTarget::default().encode().len();
        assert_eq!(bytes, [u32::try_from(sample).unwrap(), u32::try_from(target).unwrap()]);
        let switches = used(&switches(node()));
        assert_eq!(switches[0].0, 0x183);
        assert_eq!(
            usize::try_from(switches[0].1.bytes()),
            Ok(SwitchInputs::default().encode().len())
        );
    }

    #[test]
    fn whatever_is_not_used_is_switched_off() {
        for pdos in [per_drive(node(), None), switches(node())] {
            assert_eq!(pdos.len(), 8);
            for pdo in pdos.iter().filter(|pdo| pdo.service.is_none()) {
                let off = 0x8000_0000 | u32::from(pdo.cob_id);
                assert_eq!(pdo.writes(), [(pdo.communication(1), Value::Unsigned32(off))]);
            }
        }
    }

    #[test]
    fn a_pdo_is_set_up_in_the_order_of_the_standard() {
        let pdos = per_drive(node(), Some(5));
        let writes: Vec<_> = pdos[4].writes().iter().map(|(o, v)| format!("{o} {v:?}")).collect();
        assert_eq!(
            writes,
            [
                "1400h:1 Unsigned32(2147484163)",
                "1600h Unsigned8(0)",
                "1600h:1 Unsigned32(1614807056)",
                "1600h:2 Unsigned32(1618018320)",
                "1600h Unsigned8(2)",
                "1400h:2 Unsigned8(1)",
                "1400h:5 Unsigned16(5)",
                "1400h:1 Unsigned32(515)",
            ]
        );
    }

    #[test]
    fn a_mapping_changes_only_while_its_pdo_is_off() {
        for pdo in [per_drive(node(), Some(5)), switches(node())].concat() {
            let writes = pdo.writes();
            let cob_ids: Vec<_> =
                writes.iter().filter(|(o, _)| *o == pdo.communication(1)).collect();
            assert!(matches!(writes[0].1, Value::Unsigned32(raw) if raw & 0x8000_0000 != 0));
            if pdo.service.is_some() {
                assert_eq!(cob_ids.len(), 2);
                assert_eq!(
                    writes.last(),
                    Some(&(pdo.communication(1), Value::Unsigned32(u32::from(pdo.cob_id))))
                );
            }
        }
    }

    #[test]
    fn a_drive_without_the_timer_is_not_asked_for_it() {
        let writes: Vec<_> = per_drive(node(), None).iter().flat_map(Pdo::writes).collect();
        assert!(writes.iter().all(|(object, _)| object.sub != 5 || object.index >= 0x1600));
    }
}
