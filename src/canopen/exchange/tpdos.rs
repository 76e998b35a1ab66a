//! TPDOs of the nodes, decoded into values.

use std::time::Duration;

use crate::drive::Statusword;
use crate::exchange::slot::{Slot, content, slots};
use crate::frame::{Channel, Telegram};
use crate::layout::{Direction, MappedObject, Pdo};
use crate::object::Object;
use crate::pdo::WrongLength;
use crate::plan::NodePlan;
use units::drive::{Counts, PerMille};
use units::numbering::NodeIndex;

/// Content of one received TPDO; `None` for objects that it does not map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TpdoSample {
    /// Producer of the TPDO.
    pub node: NodeIndex,
    /// Position actual value (6064h), sampled at the SYNC.
    pub position: Option<Counts>,
    /// Statusword (6041h).
    pub statusword: Option<Statusword>,
    /// Torque actual value (6077h).
    pub torque: Option<PerMille>,
    /// Torque demand (6074h): the target that the drive has taken.
    pub demand: Option<PerMille>,
    /// First eight digital inputs (6000h:1).
    pub inputs: Option<u8>,
    /// Analogue input (6401h), the first that is mapped.
    pub analogue: Option<i16>,
}

/// Mappings of all received TPDOs.
#[derive(Clone, Debug)]
pub struct TpdoMap {
    tpdos: Vec<Tpdo>,
}

/// Mapping of one TPDO.
#[derive(Clone, Debug)]
struct Tpdo {
    channel: Channel,
    cob_id: u16,
    node: NodeIndex,
    bytes: usize,
    /// Event timer; `None` if the TPDO is synchronous.
    event_timer: Option<Duration>,
    /// Minimum time between two; zero if the TPDO is synchronous.
    inhibit: Duration,
    position: Option<Slot>,
    statusword: Option<Slot>,
    torque: Option<Slot>,
    demand: Option<Slot>,
    inputs: Option<Slot>,
    analogue: Option<Slot>,
}

impl TpdoMap {
    pub(super) fn new(plans: &[(Channel, NodePlan)]) -> Self {
        let of = |(node, (channel, plan)): (NodeIndex, &(Channel, NodePlan))| {
            let tpdos = plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Transmit);
            tpdos.filter_map(|pdo| Tpdo::new(*channel, node, pdo)).collect::<Vec<_>>()
        };
        Self { tpdos: NodeIndex::each(plans).flat_map(of).collect() }
    }

    /// Decodes a frame; `None` if it is not one of these TPDOs.
    ///
    /// # Errors
    /// When the frame and its mapping differ in length.
    pub fn read(&self, telegram: &Telegram) -> Option<Result<TpdoSample, WrongLength>> {
        let Telegram { channel, frame } = telegram;
        let matches = |tpdo: &&Tpdo| tpdo.channel == *channel && tpdo.cob_id == frame.cob_id;
        self.tpdos.iter().find(matches).map(|tpdo| tpdo.read(frame.data()))
    }

    /// Returns the event timer of the TPDO with a node's statusword; `None` if it is synchronous.
    pub fn status_repeated(&self, node: NodeIndex) -> Option<Duration> {
        self.tpdos_of(node).find(|tpdo| tpdo.statusword.is_some())?.event_timer
    }

    /// Returns whether a node sends its torque demand (6074h).
    pub fn has_demand(&self, node: NodeIndex) -> bool {
        self.tpdos_of(node).any(|tpdo| tpdo.demand.is_some())
    }

    /// Returns the inhibit time of the TPDO with a node's statusword; zero if it is synchronous.
    pub(super) fn status_inhibit(&self, node: NodeIndex) -> Duration {
        let tpdo = self.tpdos_of(node).find(|tpdo| tpdo.statusword.is_some());
        tpdo.map_or(Duration::ZERO, |tpdo| tpdo.inhibit)
    }

    /// Returns whether a node sends its statusword periodically, by SYNC or by event timer.
    pub(super) fn has_status(&self, node: NodeIndex) -> bool {
        self.tpdos_of(node).any(|tpdo| {
            tpdo.statusword.is_some() && tpdo.event_timer.is_none_or(|timer| !timer.is_zero())
        })
    }

    /// Returns whether a node sends its position in a synchronous TPDO.
    pub(super) fn has_sync_position(&self, node: NodeIndex) -> bool {
        self.tpdos_of(node).any(|tpdo| tpdo.position.is_some() && tpdo.event_timer.is_none())
    }

    fn tpdos_of(&self, node: NodeIndex) -> impl Iterator<Item = &Tpdo> {
        self.tpdos.iter().filter(move |tpdo| tpdo.node == node)
    }
}

impl Tpdo {
    /// Returns `None` if the PDO is not valid.
    fn new(channel: Channel, node: NodeIndex, pdo: &Pdo) -> Option<Self> {
        let service = pdo.service.as_ref()?;
        let slot_of = |object: Object, bits: u8| {
            let expected = MappedObject { object, bits };
            slots(service).find_map(|(mapped, slot)| (mapped == expected).then_some(slot))
        };
        let analogue = slots(service)
            .find(|(mapped, _)| mapped.object.is_analogue_input() && mapped.bits == 16);
        let timer = Duration::from_millis(u64::from(service.event_timer_ms.unwrap_or(0)));
        let is_event_driven = service.transmission.syncs().is_none();
        let inhibit = Duration::from_micros(100) * u32::from(service.inhibit_100us.unwrap_or(0));
        Some(Self {
            channel,
            cob_id: pdo.cob_id,
            node,
            bytes: usize::try_from(service.bytes()).unwrap_or(usize::MAX),
            event_timer: is_event_driven.then_some(timer),
            inhibit: if is_event_driven { inhibit } else { Duration::ZERO },
            position: slot_of(Object::POSITION_ACTUAL, 32),
            statusword: slot_of(Object::STATUSWORD, 16),
            torque: slot_of(Object::TORQUE_ACTUAL, 16),
            demand: slot_of(Object::TORQUE_DEMAND, 16),
            inputs: slot_of(Object::DIGITAL_INPUTS, 8),
            analogue: analogue.map(|(_, slot)| slot),
        })
    }

    fn read(&self, data: &[u8]) -> Result<TpdoSample, WrongLength> {
        if data.len() != self.bytes {
            return Err(WrongLength { node: self.node, expected: self.bytes, found: data.len() });
        }
        let content = content(data);
        let at = |slot: Option<Slot>| slot.map(|slot| slot.read(content));
        let per_mille = |slot| at(slot).map(|[a, b, ..]| PerMille(i16::from_le_bytes([a, b])));
        Ok(TpdoSample {
            node: self.node,
            position: at(self.position)
                .map(|[a, b, c, d, ..]| Counts(i32::from_le_bytes([a, b, c, d]))),
            statusword: at(self.statusword)
                .map(|[a, b, ..]| Statusword(u16::from_le_bytes([a, b]))),
            torque: per_mille(self.torque),
            demand: per_mille(self.demand),
            inputs: at(self.inputs).map(|[bits, ..]| bits),
            analogue: at(self.analogue).map(|[a, b, ..]| i16::from_le_bytes([a, b])),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NodeId;
    use crate::exchange::resolve;
    use crate::frame::Frame;
    use crate::layout::{self, Group};
    use crate::sync::TransmissionType;
    use crate::testing::plans::elbow;

    /// Nodes 1 and 2 on bus 1: statusword, torque and position in one TPDO, or grouped.
    fn tpdos(is_grouped: bool) -> TpdoMap {
        let nodes = [1, 2].map(|raw| NodeId::new(raw).unwrap());
        let plan = |(node, group): (&NodeId, &Group)| {
            let pdos = match is_grouped {
                true => layout::grouped(*node, 0, *group, Some(5)),
                false => layout::per_drive(*node, None),
            };
            (Channel(1), NodePlan { node: *node, pdos, ..elbow() })
        };
        let plans: Vec<_> = nodes.iter().zip(&Group::threes(&nodes)).map(plan).collect();
        resolve(&plans).unwrap().tpdos
    }

    fn read(tpdos: &TpdoMap, cob_id: u16, data: &[u8]) -> Option<Result<TpdoSample, WrongLength>> {
        let frame = Frame::from_slice(cob_id, data).unwrap();
        tpdos.read(&Telegram { channel: Channel(1), frame })
    }

    #[test]
    fn tpdo_of_its_length_is_decoded_little_endian() {
        let data = [0x37, 0x12, 0xFE, 0xFF, 0xFF, 0xFF, 0x9C, 0xFF];
        let sample = read(&tpdos(false), 0x182, &data).unwrap().unwrap();
        assert_eq!((sample.node, sample.inputs), (NodeIndex(1), None));
        assert_eq!(sample.statusword, Some(Statusword(0x1237)));
        assert_eq!(sample.position, Some(Counts(-2)));
        assert_eq!(sample.torque, Some(PerMille(-100)));
    }

    #[test]
    fn analogue_input_behind_the_digital_ones_is_signed() {
        let node = NodeId::new(16).unwrap();
        let plan = NodePlan { node, pdos: layout::switches(node, Some(3)), ..elbow() };
        let tpdos = TpdoMap::new(&[(Channel(1), plan)]);
        let sample = read(&tpdos, 0x190, &[0b0010, 0x18, 0xFC]).unwrap().unwrap();
        assert_eq!((sample.inputs, sample.analogue), (Some(2), Some(-1_000)));
        assert!(read(&tpdos, 0x190, &[0b0010]).unwrap().is_err(), "without the input");
    }

    #[test]
    fn tpdo_of_any_other_length_is_refused() {
        for (is_grouped, expected) in [(false, 8), (true, 4)] {
            for found in (0..=8).filter(|found| *found != expected) {
                let data = vec![0; found];
                let refused = read(&tpdos(is_grouped), 0x181, &data);
                let node = NodeIndex(0);
                assert_eq!(refused, Some(Err(WrongLength { node, expected, found })));
            }
        }
    }

    #[test]
    fn frame_of_another_bus_or_identifier_is_ignored() {
        assert_eq!(read(&tpdos(false), 0x183, &[0; 8]), None);
        let frame = Frame::from_slice(0x181, &[0; 8]).unwrap();
        assert_eq!(tpdos(false).read(&Telegram { channel: Channel(0), frame }), None);
    }

    #[test]
    fn event_driven_position_is_not_a_synchronous_one() {
        let node = NodeId::new(1).unwrap();
        let mut plan = NodePlan { node, pdos: layout::per_drive(node, None), ..elbow() };
        for service in plan.pdos.iter_mut().filter_map(|pdo| pdo.service.as_mut()) {
            service.transmission = TransmissionType::EVENT_OF_PROFILE;
        }
        let tpdos = TpdoMap::new(&[(Channel(1), plan)]);
        assert!(
            !tpdos.has_sync_position(NodeIndex(0))
                && tpdos.tpdos_of(NodeIndex(0)).any(|tpdo| tpdo.position.is_some())
        );
    }

    #[test]
    fn statusword_in_a_tpdo_of_its_own_has_an_event_timer() {
        assert_eq!(tpdos(false).status_repeated(NodeIndex(0)), None);
        assert!(
            tpdos(false).has_status(NodeIndex(1)) && tpdos(false).has_sync_position(NodeIndex(1))
        );
        assert!(tpdos(true).status_repeated(NodeIndex(0)).is_some());
        assert!(
            tpdos(true).has_status(NodeIndex(0)) && tpdos(true).has_sync_position(NodeIndex(0))
        );
        assert!(
            !tpdos(true).has_status(NodeIndex(2)) && !tpdos(true).has_sync_position(NodeIndex(2)),
            "no such node"
        );
    }
}
