//! PDO layouts of nodes: which PDOs of a node are in use, with which objects.
//!
//! [`exchange`](crate::exchange) derives bit positions from a layout, [`load`](crate::load) its bus load. A further
//! layout is one more function here.

mod pdo;

pub use pdo::{Direction, MappedObject, Pdo, Service};

use std::ops::RangeInclusive;

use canopen_rs::pdo::default_cob_id;
use canopen_rs::{NodeId, PdoKind};

use crate::master::check::COB_ID_NO_RTR;
use crate::object::Object;
use crate::sync::TransmissionType;

/// Layout for any CiA 402 drive: one RPDO and one TPDO, cyclic synchronous; all others disabled.
///
/// Without an RPDO for `rpdo_timer_ms`, a drive faults (1400h:5). `None` is for drives without that timer, which stop
/// by the heartbeat only.
pub fn per_drive(node: NodeId, rpdo_timer_ms: Option<u16>) -> Vec<Pdo> {
    let sample = Service::new(
        TransmissionType::EVERY_SYNC,
        &[(Object::STATUSWORD, 16), (Object::POSITION_ACTUAL, 32), (Object::TORQUE_ACTUAL, 16)],
    );
    let target = Service::new(
        TransmissionType::EVERY_SYNC,
        &[(Object::CONTROLWORD, 16), (Object::TARGET_TORQUE, 16)],
    );
    let target = Service { event_timer_ms: rpdo_timer_ms, ..target };
    predefined(node, vec![sample], vec![target])
}

/// TPDO service of the torque demand (6074h) at every tenth SYNC: it shows which target a drive without an RPDO timer
/// has taken.
pub fn torque_demand() -> Service {
    Service::new(TransmissionType(DEMAND_SYNCS), &[(Object::TORQUE_DEMAND, 16)])
}

/// Transmission type of the torque demand.
pub const DEMAND_SYNCS: u8 = 10;

/// Group of drives that share one RPDO of target torques.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Group {
    /// COB-ID of the shared RPDO: RPDO1 of the first drive.
    pub cob_id: u16,
    /// Number of target torques.
    pub size: u8,
    /// Slot of this drive, from 0.
    pub slot: u8,
}

impl Group {
    /// Maximum number of 16-bit targets that leaves time for one more frame beside two groups and six positions, at
    /// 1 kHz and 1 Mbit/s.
    pub const SIZE: usize = 3;

    /// Groups `nodes` by threes, in order.
    pub fn threes(nodes: &[NodeId]) -> Vec<Self> {
        let of = |members: &[NodeId]| {
            let first = members.first().map_or(0, |first| rpdo1(*first));
            let size = u8::try_from(members.len()).unwrap_or(u8::MAX);
            (0..size).map(move |slot| Self { cob_id: first, size, slot }).collect::<Vec<_>>()
        };
        nodes.chunks(Self::SIZE).flat_map(of).collect()
    }
}

/// Layout with shared target torques and short position TPDOs, both cyclic synchronous. Statusword and controlword
/// are sent on change, the torque about every hundredth SYNC. Six drives fit 1 kHz on 1 Mbit/s.
///
/// By dummies (CiA 301, 7.4.7.1), a drive skips the slots of others; its EDS must declare them in `[DummyUsage]`.
/// `place` is the index of the drive on its bus: periods differ by it, so that not all repeat in one cycle.
/// `rpdo_timer_ms` is as in [`per_drive`].
pub fn grouped(node: NodeId, place: usize, group: Group, rpdo_timer_ms: Option<u16>) -> Vec<Pdo> {
    let spread = |periods: &[u8]| periods.iter().copied().cycle().nth(place).unwrap_or(u8::MAX);
    let position = Service::new(TransmissionType::EVERY_SYNC, &[(Object::POSITION_ACTUAL, 32)]);
    let status = Service {
        inhibit_100us: Some(100),
        event_timer_ms: Some(spread(&STATUS_MS).into()),
        ..Service::new(TransmissionType::EVENT_OF_PROFILE, &[(Object::STATUSWORD, 16)])
    };
    let torque_syncs = TransmissionType(spread(&TORQUE_SYNCS));
    let torque = Service::new(torque_syncs, &[(Object::TORQUE_ACTUAL, 16)]);
    let object_of = |slot: u8| {
        let is_own = slot == group.slot;
        if is_own { Object::TARGET_TORQUE } else { Object::DUMMY_INTEGER16 }
    };
    let slots: Vec<_> = (0..group.size).map(|slot| (object_of(slot), 16)).collect();
    let targets = Service {
        event_timer_ms: rpdo_timer_ms,
        ..Service::new(TransmissionType::EVERY_SYNC, &slots)
    };
    let control = Service::new(TransmissionType::EVENT_OF_PROFILE, &[(Object::CONTROLWORD, 16)]);
    let mut pdos = predefined(node, vec![position, status, torque], vec![targets, control]);
    let is_shared = |pdo: &&mut Pdo| pdo.direction == Direction::Receive && pdo.number == 1;
    pdos.iter_mut().filter(is_shared).for_each(|pdo| pdo.cob_id = group.cob_id);
    pdos
}

/// Event timers of the statuswords in a group, in ms: about 50.
const STATUS_MS: [u8; 6] = [47, 49, 50, 51, 53, 59];

/// Transmission types of the torques in a group: about every hundredth SYNC.
const TORQUE_SYNCS: [u8; 6] = [97, 99, 100, 101, 103, 107];

/// Layout of the switch box: inputs on change and every 5 ms; all other PDOs disabled. An analogue input, by its number,
/// follows the digital ones in the same frame, so that it is never newer or older than the deadman.
pub fn switches(node: NodeId, analogue: Option<u8>) -> Vec<Pdo> {
    let mut objects = vec![(Object::DIGITAL_INPUTS, 8)];
    objects.extend(analogue.map(|number| (Object::analogue_input(number), 16)));
    let inputs = Service {
        inhibit_100us: Some(10),
        event_timer_ms: Some(5),
        ..Service::new(TransmissionType::EVENT_OF_PROFILE, &objects)
    };
    predefined(node, vec![inputs], vec![])
}

/// Disables PDOs that `exists` beside a layout: drives power up with some of them enabled.
pub fn switch_off_others(pdos: &mut Vec<Pdo>, exists: impl Fn(Object) -> bool) {
    for number in 1..=MAX_PDOS {
        for direction in [Direction::Transmit, Direction::Receive] {
            let is_planned = |pdo: &Pdo| (pdo.direction, pdo.number) == (direction, number);
            let other = Pdo { direction, number, cob_id: 0, has_no_rtr: false, service: None };
            if exists(other.communication(1)) && !pdos.iter().any(is_planned) {
                pdos.push(other);
            }
        }
    }
}

/// Keeps bit 30 of the COB-IDs as the device has it, by the default of its data sheet: some accept no other.
pub fn keep_bit_30(pdos: &mut [Pdo], default: impl Fn(Object) -> Option<u32>) {
    for pdo in pdos {
        pdo.has_no_rtr =
            default(pdo.communication(1)).is_some_and(|cob_id| cob_id & COB_ID_NO_RTR != 0);
    }
}

/// Maximum number of PDOs per direction (CiA 301, 7.5.1).
pub const MAX_PDOS: u16 = 512;

/// Mapping parameters of all RPDOs and all TPDOs.
pub const MAPPINGS: [RangeInclusive<u16>; 2] = [
    Object::rpdo_mapping(1, 0).index..=Object::rpdo_mapping(MAX_PDOS, 0).index,
    Object::tpdo_mapping(1, 0).index..=Object::tpdo_mapping(MAX_PDOS, 0).index,
];

/// COB-ID of RPDO1 in the predefined connection set.
pub fn rpdo1(node: NodeId) -> u16 {
    0x200 + u16::from(node.raw())
}

/// Eight PDOs of the predefined connection set, the first ones configured as given.
fn predefined(node: NodeId, tpdos: Vec<Service>, rpdos: Vec<Service>) -> Vec<Pdo> {
    let mut pdos = Vec::new();
    for (direction, kind, services) in [
        (Direction::Transmit, PdoKind::Transmit, tpdos),
        (Direction::Receive, PdoKind::Receive, rpdos),
    ] {
        let mut services = services.into_iter();
        for number in 1..=4_u8 {
            let Some(cob_id) = default_cob_id(kind, number, node) else { continue };
            let service = services.next();
            let number = number.into();
            pdos.push(Pdo { direction, number, cob_id, has_no_rtr: false, service });
        }
    }
    pdos
}

#[cfg(test)]
mod tests {
    use canopen_rs::Value;
    use canopen_rs::pdo::PDO_COB_ID_INVALID;

    use super::*;

    fn node() -> NodeId {
        NodeId::new(3).unwrap()
    }

    fn used(pdos: &[Pdo]) -> Vec<(u16, Service)> {
        pdos.iter().filter_map(|pdo| Some((pdo.cob_id, pdo.service.clone()?))).collect()
    }

    fn group() -> Group {
        Group { cob_id: 0x201, size: 3, slot: 2 }
    }

    fn layouts() -> [Vec<Pdo>; 3] {
        [per_drive(node(), Some(5)), grouped(node(), 2, group(), Some(5)), switches(node(), None)]
    }

    #[test]
    fn frame_lengths_match_the_layout() {
        let lengths = layouts().map(|pdos| {
            used(&pdos).iter().map(|(cob_id, pdo)| (*cob_id, pdo.bytes())).collect::<Vec<_>>()
        });
        let [per_drive, grouped, switches] = lengths;
        assert_eq!(per_drive, [(0x183, 8), (0x203, 4)]);
        assert_eq!(grouped, [(0x183, 4), (0x283, 2), (0x383, 2), (0x201, 6), (0x303, 2)]);
        assert_eq!(switches, [(0x183, 1)]);
        let with_analogue = switches_with(2);
        assert_eq!(with_analogue, [(0x183, 3)], "behind the digital inputs");
    }

    fn switches_with(number: u8) -> Vec<(u16, u32)> {
        let pdos = switches(node(), Some(number));
        let services = used(&pdos);
        let last = services[0].1.mapping[1];
        assert_eq!((last.object.to_string().as_str(), last.bits), ("6401h:2", 16));
        services.iter().map(|(cob_id, pdo)| (*cob_id, pdo.bytes())).collect()
    }

    #[test]
    fn drives_are_grouped_by_threes_in_order() {
        let nodes: Vec<NodeId> = [7, 2, 9, 4].map(|raw| NodeId::new(raw).unwrap()).into();
        let groups = Group::threes(&nodes);
        let found: Vec<_> = groups.iter().map(|g| (g.cob_id, g.size, g.slot)).collect();
        assert_eq!(found, [(0x207, 3, 0), (0x207, 3, 1), (0x207, 3, 2), (0x204, 1, 0)]);
    }

    #[test]
    fn repetitions_of_all_drives_never_coincide() {
        for periods in [STATUS_MS, TORQUE_SYNCS].map(|periods| periods.map(u32::from)) {
            let at_once = |time: &u32| periods.iter().filter(|p| time.is_multiple_of(**p)).count();
            assert_eq!((1..1_000_000).map(|time| at_once(&time)).max(), Some(3));
        }
    }

    #[test]
    fn further_pdos_of_the_drive_are_disabled() {
        let mut pdos = per_drive(node(), None);
        let has = [Object::rpdo_communication(6, 1), Object::tpdo_communication(512, 1)];
        switch_off_others(&mut pdos, |object| has.contains(&object) || object.index == 0x1400);
        let more: Vec<_> = pdos[8..].iter().flat_map(Pdo::writes).collect();
        let off = Value::Unsigned32(PDO_COB_ID_INVALID);
        assert_eq!(more, [(has[0], off), (has[1], off)]);
    }

    #[test]
    fn unused_pdos_are_disabled() {
        for pdos in layouts() {
            assert_eq!(pdos.len(), 8);
            for pdo in pdos.iter().filter(|pdo| pdo.service.is_none()) {
                let off = 0x8000_0000 | u32::from(pdo.cob_id);
                assert_eq!(pdo.writes(), [(pdo.communication(1), Value::Unsigned32(off))]);
            }
        }
    }

    #[test]
    fn pdo_is_configured_in_the_order_of_the_standard() {
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
    fn mapping_changes_only_while_its_pdo_is_disabled() {
        for pdo in layouts().concat() {
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
    fn drive_without_rpdo_timer_gets_none() {
        let writes: Vec<_> = per_drive(node(), None).iter().flat_map(Pdo::writes).collect();
        assert!(writes.iter().all(|(object, _)| object.sub != 5 || object.index >= 0x1600));
    }
}
