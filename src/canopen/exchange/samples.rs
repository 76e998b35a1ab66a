//! What nodes tell: their TPDOs, read into values.

use std::time::Duration;

use crate::canopen::drive::Statusword;
use crate::canopen::exchange::slot::Slot;
use crate::canopen::exchange::slot::content;
use crate::canopen::exchange::slot::slots;
use crate::canopen::frame::Channel;
use crate::canopen::frame::Telegram;
use crate::canopen::layout::Direction;
use crate::canopen::layout::Mapped;
use crate::canopen::layout::Pdo;
use crate::canopen::object::Object;
use crate::canopen::pdo::Counts;
use crate::canopen::pdo::PerMille;
use crate::canopen::pdo::SwitchInputs;
use crate::canopen::pdo::WrongLength;
use crate::canopen::plan::NodePlan;

/// What one TPDO told; `None` for what is not in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Told {
    /// Whose it is: a place in the list of plans.
    pub node: usize,
    /// Where the drive's encoder was at the SYNC, if this is what answers it.
    pub position: Option<Counts>,
    /// The drive's state.
    pub statusword: Option<Statusword>,
    /// The torque it exerts.
    pub torque: Option<PerMille>,
    /// The operator's switches.
    pub inputs: Option<SwitchInputs>,
}

/// Every TPDO that is listened to.
#[derive(Clone, Debug, Default)]
pub struct Inbox {
    tpdos: Vec<Tpdo>,
}

/// One of them.
#[derive(Clone, Debug)]
struct Tpdo {
    channel: Channel,
    cob_id: u16,
    node: usize,
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
        let of = |(node, (channel, plan)): (usize, &(Channel, NodePlan))| {
            let tpdos = plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Transmit);
            tpdos.filter_map(|pdo| Tpdo::new(*channel, node, pdo)).collect::<Vec<_>>()
        };
        Self { tpdos: plans.iter().enumerate().flat_map(of).collect() }
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
    pub fn status_repeated(&self, node: usize) -> Option<Duration> {
        self.of(node).find(|tpdo| tpdo.statusword.is_some())?.repeated
    }

    /// Whether a node tells its state, be it of itself and at least now and then.
    pub(super) fn tells_status(&self, node: usize) -> bool {
        self.of(node).any(|tpdo| {
            tpdo.statusword.is_some() && tpdo.repeated.is_none_or(|repeated| !repeated.is_zero())
        })
    }

    /// Whether a node's position comes at every SYNC.
    pub(super) fn samples(&self, node: usize) -> bool {
        self.of(node).any(|tpdo| tpdo.position.is_some() && tpdo.repeated.is_none())
    }

    fn of(&self, node: usize) -> impl Iterator<Item = &Tpdo> {
        self.tpdos.iter().filter(move |tpdo| tpdo.node == node)
    }
}

impl Tpdo {
    /// `None` if it is off.
    fn new(channel: Channel, node: usize, pdo: &Pdo) -> Option<Self> {
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
            inputs: at(self.inputs).map(|[bits, ..]| SwitchInputs::from_bits(bits)),
        })
    }
}
