//! What nodes tell: their TPDOs, read into values.

use std::time::Duration;

use crate::drive::Statusword;
use crate::exchange::slot::Slot;
use crate::exchange::slot::content;
use crate::exchange::slot::slots;
use crate::frame::Channel;
use crate::frame::Telegram;
use crate::layout::Direction;
use crate::layout::Mapped;
use crate::layout::Pdo;
use crate::object::Object;
use crate::pdo::WrongLength;
use crate::plan::NodePlan;
use units::drive::Counts;
use units::drive::PerMille;
use units::numbering::NodeIndex;

/// What one TPDO told; `None` for what is not in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Told {
    /// Whose it is.
    pub node: NodeIndex,
    /// Where the drive's encoder was at the SYNC, if this is what answers it.
    pub position: Option<Counts>,
    /// The drive's state.
    pub statusword: Option<Statusword>,
    /// The torque it exerts.
    pub torque: Option<PerMille>,
    /// First eight digital inputs (6000h:1).
    pub inputs: Option<u8>,
}

/// Every TPDO that is listened to.
#[derive(Clone, Debug)]
pub struct Inbox {
    tpdos: Vec<Tpdo>,
}

/// One of them.
#[derive(Clone, Debug)]
struct Tpdo {
    channel: Channel,
    cob_id: u16,
    node: NodeIndex,
    bytes: usize,
    /// The longest time between two of them; `None` if SYNC asks for each.
    repeated: Option<Duration>,
    position: Option<Slot>,
    statusword: Option<Slot>,
    torque: Option<Slot>,
    inputs: Option<Slot>,
}

impl Inbox {
    pub(super) fn new(plans: &[(Channel, NodePlan)]) -> Self {
        let of = |(node, (channel, plan)): (NodeIndex, &(Channel, NodePlan))| {
            let tpdos = plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Transmit);
            tpdos.filter_map(|pdo| Tpdo::new(*channel, node, pdo)).collect::<Vec<_>>()
        };
        Self { tpdos: NodeIndex::each(plans).flat_map(of).collect() }
    }

    /// Reads a frame; `None` if it is none of these.
    ///
    /// # Errors
    /// When it is not as long as its mapping.
    pub fn read(&self, telegram: &Telegram) -> Option<Result<Told, WrongLength>> {
        let Telegram { channel, frame } = telegram;
        let is_it = |tpdo: &&Tpdo| tpdo.channel == *channel && tpdo.cob_id == frame.cob_id;
        self.tpdos.iter().find(is_it).map(|tpdo| tpdo.read(frame.data()))
    }

    /// The longest time between two words of a node's state, if SYNC does not ask for them.
    pub fn status_repeated(&self, node: NodeIndex) -> Option<Duration> {
        self.of(node).find(|tpdo| tpdo.statusword.is_some())?.repeated
    }

    /// Whether a node tells its state, be it of itself and at least now and then.
    pub(super) fn tells_status(&self, node: NodeIndex) -> bool {
        self.of(node).any(|tpdo| {
            tpdo.statusword.is_some() && tpdo.repeated.is_none_or(|repeated| !repeated.is_zero())
        })
    }

    /// Whether a node's position comes at every SYNC.
    pub(super) fn samples(&self, node: NodeIndex) -> bool {
        self.of(node).any(|tpdo| tpdo.position.is_some() && tpdo.repeated.is_none())
    }

    fn of(&self, node: NodeIndex) -> impl Iterator<Item = &Tpdo> {
        self.tpdos.iter().filter(move |tpdo| tpdo.node == node)
    }
}

impl Tpdo {
    /// `None` if it is off.
    fn new(channel: Channel, node: NodeIndex, pdo: &Pdo) -> Option<Self> {
        let service = pdo.service.as_ref()?;
        let place = |object: Object, bits: u8| {
            let wanted = Mapped { object, bits };
            slots(service).find_map(|(mapped, slot)| (mapped == wanted).then_some(slot))
        };
        let timer = Duration::from_millis(u64::from(service.event_timer_ms.unwrap_or(0)));
        Some(Self {
            channel,
            cob_id: pdo.cob_id,
            node,
            bytes: usize::try_from(service.bytes()).unwrap_or(usize::MAX),
            repeated: service.transmission.syncs().is_none().then_some(timer),
            position: place(Object::POSITION_ACTUAL, 32),
            statusword: place(Object::STATUSWORD, 16),
            torque: place(Object::TORQUE_ACTUAL, 16),
            inputs: place(Object::DIGITAL_INPUTS, 8),
        })
    }

    fn read(&self, data: &[u8]) -> Result<Told, WrongLength> {
        if data.len() != self.bytes {
            return Err(WrongLength { node: self.node, expected: self.bytes, found: data.len() });
        }
        let content = content(data);
        let at = |slot: Option<Slot>| slot.map(|slot| slot.read(content));
        Ok(Told {
            node: self.node,
            position: at(self.position)
                .map(|[a, b, c, d, ..]| Counts(i32::from_le_bytes([a, b, c, d]))),
            statusword: at(self.statusword)
                .map(|[a, b, ..]| Statusword(u16::from_le_bytes([a, b]))),
            torque: at(self.torque).map(|[a, b, ..]| PerMille(i16::from_le_bytes([a, b]))),
            inputs: at(self.inputs).map(|[bits, ..]| bits),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NodeId;
    use crate::exchange::resolve;
    use crate::frame::Frame;
    use crate::layout;
    use crate::layout::Group;
    use crate::sync::Transmission;
    use crate::testing::plans::elbow;

    /// Nodes 1 and 2 on bus 1: state, torque and position in one TPDO, or grouped with the state apart.
    fn inbox(is_grouped: bool) -> Inbox {
        let nodes = [1, 2].map(|raw| NodeId::new(raw).unwrap());
        let plan = |(node, group): (&NodeId, &Group)| {
            let pdos = match is_grouped {
                true => layout::grouped(*node, 0, *group, Some(5)),
                false => layout::per_drive(*node, None),
            };
            (Channel(1), NodePlan { node: *node, pdos, ..elbow() })
        };
        let plans: Vec<_> = nodes.iter().zip(&Group::threes(&nodes)).map(plan).collect();
        resolve(&plans).unwrap().inbox
    }

    fn read(inbox: &Inbox, cob_id: u16, data: &[u8]) -> Option<Result<Told, WrongLength>> {
        let frame = Frame::from_slice(cob_id, data).unwrap();
        inbox.read(&Telegram { channel: Channel(1), frame })
    }

    #[test]
    fn tpdo_of_its_length_is_read_little_endian() {
        let data = [0x37, 0x12, 0xFE, 0xFF, 0xFF, 0xFF, 0x9C, 0xFF];
        let told = read(&inbox(false), 0x182, &data).unwrap().unwrap();
        assert_eq!((told.node, told.inputs), (NodeIndex(1), None));
        assert_eq!(told.statusword, Some(Statusword(0x1237)));
        assert_eq!(told.position, Some(Counts(-2)));
        assert_eq!(told.torque, Some(PerMille(-100)));
    }

    #[test]
    fn tpdo_of_any_other_length_is_refused() {
        for (is_grouped, expected) in [(false, 8), (true, 4)] {
            for found in (0..=8).filter(|found| *found != expected) {
                let data = vec![0; found];
                let refused = read(&inbox(is_grouped), 0x181, &data);
                let node = NodeIndex(0);
                assert_eq!(refused, Some(Err(WrongLength { node, expected, found })));
            }
        }
    }

    #[test]
    fn frame_of_another_bus_or_identifier_is_not_read() {
        assert_eq!(read(&inbox(false), 0x183, &[0; 8]), None);
        let frame = Frame::from_slice(0x181, &[0; 8]).unwrap();
        assert_eq!(inbox(false).read(&Telegram { channel: Channel(0), frame }), None);
    }

    #[test]
    fn position_that_no_sync_asks_for_is_no_sample() {
        let node = NodeId::new(1).unwrap();
        let mut plan = NodePlan { node, pdos: layout::per_drive(node, None), ..elbow() };
        for service in plan.pdos.iter_mut().filter_map(|pdo| pdo.service.as_mut()) {
            service.transmission = Transmission::EVENT_OF_PROFILE;
        }
        let inbox = Inbox::new(&[(Channel(1), plan)]);
        assert!(
            !inbox.samples(NodeIndex(0))
                && inbox.of(NodeIndex(0)).any(|tpdo| tpdo.position.is_some())
        );
    }

    #[test]
    fn state_apart_is_repeated_and_with_the_position_it_is_not() {
        assert_eq!(inbox(false).status_repeated(NodeIndex(0)), None);
        assert!(inbox(false).tells_status(NodeIndex(1)) && inbox(false).samples(NodeIndex(1)));
        assert!(inbox(true).status_repeated(NodeIndex(0)).is_some());
        assert!(inbox(true).tells_status(NodeIndex(0)) && inbox(true).samples(NodeIndex(0)));
        assert!(
            !inbox(true).tells_status(NodeIndex(2)) && !inbox(true).samples(NodeIndex(2)),
            "there is none"
        );
    }
}
