//! RPDOs of the drives: target torques and controlwords.
//!
//! Synchronous RPDOs are sent every cycle. Event-driven ones, such as a separate controlword, are sent on change, at most
//! one per bus in every other cycle. A cycle has time for one such frame and the drive's TPDO in reply. More frames
//! would delay the next SYNC, which the host queues behind them regardless of its priority.

use crate::drive::Controlword;
use crate::exchange::ExchangeError;
use crate::exchange::slot::{Slot, slots};
use crate::frame::{Channel, Frame, Telegram};
use crate::layout::{Direction, Pdo, Service};
use crate::object::Object;
use crate::plan::NodePlan;
use units::drive::PerMille;
use units::numbering::NodeIndex;

/// Cycles until an event-driven RPDO is repeated, while its drive has not reached the commanded state.
const REPEAT_CYCLES: u32 = 20;

/// Current content of all transmitted RPDOs.
#[derive(Clone, Debug)]
pub struct RpdoImage {
    cyclic: Vec<Rpdo>,
    event_driven: Vec<Rpdo>,
    /// Fields of each node's target torque, and of its controlword.
    target_torques: Vec<Vec<Place>>,
    controlwords: Vec<Vec<Place>>,
    /// Indices of the event-driven RPDOs of each node.
    event_driven_of: Vec<Vec<usize>>,
    /// Index of the event-driven RPDO with the next turn.
    next: usize,
    /// Set if an event-driven RPDO was sent in the last cycle.
    skips_cycle: bool,
}

/// One RPDO with its current content.
#[derive(Clone, Debug)]
struct Rpdo {
    channel: Channel,
    cob_id: u16,
    service: Service,
    fields: Vec<Field>,
    content: u64,
    /// Content last sent.
    sent: Option<u64>,
    /// Cycles since `sent`.
    age: u32,
}

/// Mapped object of a consumer.
#[derive(Clone, Copy, Debug)]
struct Field {
    node: NodeIndex,
    object: Object,
    slot: Slot,
    /// Set if the node has reached the commanded state.
    is_reached: bool,
}

/// Place of a field in the image, found once: the cycle does not search.
#[derive(Clone, Copy, Debug)]
struct Place {
    is_cyclic: bool,
    rpdo: usize,
    field: usize,
}

impl RpdoImage {
    pub(super) fn new(plans: &[(Channel, NodePlan)]) -> Result<Self, ExchangeError> {
        let mut rpdos: Vec<Rpdo> = Vec::new();
        for (node, (channel, plan)) in NodeIndex::each(plans) {
            for pdo in plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Receive) {
                let Some(service) = &pdo.service else { continue };
                let matches =
                    |rpdo: &&mut Rpdo| rpdo.channel == *channel && rpdo.cob_id == pdo.cob_id;
                match rpdos.iter_mut().find(matches) {
                    Some(rpdo) => rpdo.add_consumer(&plan.name, node, service)?,
                    None => rpdos.push(Rpdo::new(*channel, node, pdo, service)),
                }
            }
        }
        let (cyclic, event_driven): (Vec<Rpdo>, Vec<Rpdo>) =
            rpdos.into_iter().partition(|rpdo| rpdo.service.transmission.syncs().is_some());
        let places = |object| {
            let of = |(node, _)| places(&cyclic, &event_driven, node, object);
            NodeIndex::each(plans).map(of).collect()
        };
        let (target_torques, controlwords) =
            (places(Object::TARGET_TORQUE), places(Object::CONTROLWORD));
        let event_driven_of = NodeIndex::each(plans)
            .map(|(node, _)| indices(&event_driven, |rpdo| rpdo.is_for(node)))
            .collect();
        Ok(Self {
            cyclic,
            event_driven,
            target_torques,
            controlwords,
            event_driven_of,
            next: 0,
            skips_cycle: false,
        })
    }

    /// Sets the target torque (6071h) of a drive for the next SYNC.
    pub fn set_target_torque(&mut self, node: NodeIndex, torque: PerMille) {
        let value = u16::from_le_bytes(torque.0.to_le_bytes());
        let places = self.target_torques.get(node.0).into_iter().flatten();
        set(&mut self.cyclic, &mut self.event_driven, places, value, true);
    }

    /// Sets the controlword (6040h) of a drive. `is_reached`: the drive already is in the commanded state.
    pub fn set_controlword(&mut self, node: NodeIndex, word: Controlword, is_reached: bool) {
        let places = self.controlwords.get(node.0).into_iter().flatten();
        set(&mut self.cyclic, &mut self.event_driven, places, word.0, is_reached);
    }

    /// Returns whether a changed event-driven RPDO of a drive has not been sent yet.
    pub fn is_waiting(&self, node: NodeIndex) -> bool {
        let mut own = self.event_driven_of.get(node.0).into_iter().flatten();
        own.any(|index| {
            self.event_driven.get(*index).is_some_and(|rpdo| rpdo.sent != Some(rpdo.content))
        })
    }

    /// Appends the synchronous RPDOs in the order of the nodes.
    pub fn append_synchronous(&self, out: &mut Vec<Telegram>) {
        out.extend(self.cyclic.iter().filter_map(Rpdo::telegram));
    }

    /// Returns the synchronous RPDO to send when its target torques are stale. It is unchanged if they are zero, and has zero
    /// torque if a controlword disables operation; otherwise `None`.
    pub fn without_stale_torque(&self, telegram: &Telegram) -> Option<Telegram> {
        let rpdo = self.cyclic_of(telegram)?;
        match (rpdo.has_torque(), rpdo.enables()) {
            (false, _) => Some(*telegram),
            (true, true) => None,
            (true, false) => rpdo.telegram_of(rpdo.without_torque()),
        }
    }

    /// Returns whether a synchronous RPDO has a target torque other than zero.
    pub fn has_torque(&self, telegram: &Telegram) -> bool {
        self.cyclic_of(telegram).is_some_and(Rpdo::has_torque)
    }

    /// Returns the synchronous RPDO with zero target torques and its other content.
    pub fn zeroed(&self, telegram: &Telegram) -> Option<Telegram> {
        let rpdo = self.cyclic_of(telegram)?;
        rpdo.telegram_of(rpdo.without_torque())
    }

    /// Returns the nodes with a target torque in a synchronous RPDO.
    pub fn nodes_with_torque(&self, telegram: &Telegram) -> impl Iterator<Item = NodeIndex> + '_ {
        let rpdo = self.cyclic_of(telegram).into_iter();
        let fields = rpdo.flat_map(|rpdo| &rpdo.fields);
        fields.filter(|field| field.object == Object::TARGET_TORQUE).map(|field| field.node)
    }

    fn cyclic_of(&self, telegram: &Telegram) -> Option<&Rpdo> {
        let matches =
            |rpdo: &&Rpdo| (rpdo.channel, rpdo.cob_id) == (telegram.channel, telegram.frame.cob_id);
        self.cyclic.iter().find(matches)
    }

    /// Appends the event-driven RPDOs that are due: at most one per bus, and none in the cycle after one. With
    /// `hold_enabling`, RPDOs that enable operation wait. Call it once per cycle.
    pub fn append_event_driven(&mut self, hold_enabling: bool, out: &mut Vec<Telegram>) {
        self.event_driven.iter_mut().for_each(|rpdo| rpdo.age = rpdo.age.saturating_add(1));
        if std::mem::take(&mut self.skips_cycle) {
            return;
        }
        let first = out.len();
        let count = self.event_driven.len();
        for index in (self.next..count).chain(0..self.next) {
            let Some(rpdo) = self.event_driven.get_mut(index) else { continue };
            let is_bus_taken = out.iter().skip(first).any(|sent| sent.channel == rpdo.channel);
            if rpdo.is_due() && !is_bus_taken && !(hold_enabling && rpdo.enables()) {
                rpdo.sent = Some(rpdo.content);
                rpdo.age = 0;
                out.extend(rpdo.telegram());
                self.next = index + 1;
                self.skips_cycle = true;
            }
        }
    }

    /// Marks all event-driven RPDOs as not sent, after a restart of the drives.
    pub fn restart(&mut self) {
        self.event_driven.iter_mut().for_each(|rpdo| rpdo.sent = None);
    }

    /// Returns the number of event-driven RPDOs on a node's bus if its controlword is in one of them, else 0.
    pub(super) fn controlword_turns(&self, node: NodeIndex) -> u32 {
        let has_word =
            |rpdo: &&Rpdo| rpdo.fields_of(Object::CONTROLWORD).any(|field| field.node == node);
        let Some(channel) = self.event_driven.iter().find(has_word).map(|rpdo| rpdo.channel) else {
            return 0;
        };
        let count = self.event_driven.iter().filter(|rpdo| rpdo.channel == channel).count();
        u32::try_from(count).unwrap_or(u32::MAX)
    }

    /// Returns the number of RPDOs on a bus, synchronous and event-driven.
    pub fn frames_on(&self, channel: Channel) -> u32 {
        let all = self.cyclic.iter().chain(&self.event_driven);
        let count = all.filter(|rpdo| rpdo.channel == channel).count();
        u32::try_from(count).unwrap_or(u32::MAX)
    }

    /// Returns the number of data bytes of each synchronous RPDO on a bus.
    pub fn bytes_on(&self, channel: Channel) -> impl Iterator<Item = u32> + '_ {
        let rpdos = self.cyclic.iter().filter(move |rpdo| rpdo.channel == channel);
        rpdos.map(|rpdo| rpdo.service.bytes())
    }

    pub(super) fn maps(&self, node: NodeIndex, object: Object) -> bool {
        let mut fields = self.cyclic.iter().chain(&self.event_driven).flat_map(|rpdo| &rpdo.fields);
        fields.any(|field| field.node == node && field.object == object)
    }
}

impl Rpdo {
    fn new(channel: Channel, node: NodeIndex, pdo: &Pdo, service: &Service) -> Self {
        Self {
            channel,
            cob_id: pdo.cob_id,
            service: service.clone(),
            fields: fields(node, service).collect(),
            content: 0,
            sent: None,
            age: 0,
        }
    }

    /// Adds the objects of another consumer.
    fn add_consumer(
        &mut self,
        name: &str,
        node: NodeIndex,
        service: &Service,
    ) -> Result<(), ExchangeError> {
        let cob_id = self.cob_id;
        if (service.bytes(), service.transmission)
            != (self.service.bytes(), self.service.transmission)
        {
            return Err(ExchangeError::Mismatch { name: name.to_owned(), cob_id });
        }
        for field in fields(node, service) {
            if self.fields.iter().any(|other| other.slot.overlaps(field.slot)) {
                let (name, object) = (name.to_owned(), field.object);
                return Err(ExchangeError::Overlap { name, object, cob_id });
            }
            self.fields.push(field);
        }
        Ok(())
    }

    /// Returns whether the RPDO has an object of `node`.
    fn is_for(&self, node: NodeIndex) -> bool {
        self.fields.iter().any(|field| field.node == node)
    }

    fn set(&mut self, field: usize, value: u16, is_reached: bool) {
        if let Some(field) = self.fields.get_mut(field) {
            self.content = field.slot.write(self.content, value);
            field.is_reached = is_reached;
        }
    }

    /// Returns whether a target torque is not zero.
    fn has_torque(&self) -> bool {
        let mut torques = self.fields_of(Object::TARGET_TORQUE);
        torques.any(|field| field.slot.read(self.content) != [0; 8])
    }

    /// Returns whether no controlword disables operation; also true without a controlword.
    fn enables(&self) -> bool {
        let mut words = self.fields_of(Object::CONTROLWORD);
        words.all(|field| {
            let [low, high, ..] = field.slot.read(self.content);
            Controlword(u16::from_le_bytes([low, high])).enables()
        })
    }

    /// Returns the content with zero target torques.
    fn without_torque(&self) -> u64 {
        let torques = self.fields_of(Object::TARGET_TORQUE);
        torques.fold(self.content, |content, field| field.slot.write(content, 0))
    }

    fn fields_of(&self, object: Object) -> impl Iterator<Item = &Field> {
        self.fields.iter().filter(move |field| field.object == object)
    }

    /// Returns whether the content has changed, or must be repeated.
    fn is_due(&self) -> bool {
        let is_reached = self.fields.iter().all(|field| field.is_reached);
        self.sent != Some(self.content) || !is_reached && self.age >= REPEAT_CYCLES
    }

    fn telegram(&self) -> Option<Telegram> {
        self.telegram_of(self.content)
    }

    fn telegram_of(&self, content: u64) -> Option<Telegram> {
        let bytes = content.to_le_bytes();
        let length = usize::try_from(self.service.bytes()).ok()?;
        let frame = Frame::from_slice(self.cob_id, bytes.get(..length)?)?;
        Some(Telegram { channel: self.channel, frame })
    }
}

/// Sets the fields at these places.
fn set<'a>(
    cyclic: &mut [Rpdo],
    event_driven: &mut [Rpdo],
    places: impl Iterator<Item = &'a Place>,
    value: u16,
    is_reached: bool,
) {
    for place in places {
        let rpdos = if place.is_cyclic { &mut *cyclic } else { &mut *event_driven };
        if let Some(rpdo) = rpdos.get_mut(place.rpdo) {
            rpdo.set(place.field, value, is_reached);
        }
    }
}

fn places(cyclic: &[Rpdo], event_driven: &[Rpdo], node: NodeIndex, object: Object) -> Vec<Place> {
    let in_rpdos = |rpdos: &[Rpdo], is_cyclic| -> Vec<Place> {
        let of = |(rpdo, it): (usize, &Rpdo)| {
            let matches = |field: &Field| field.node == node && field.object == object;
            let fields = indices(&it.fields, matches).into_iter();
            fields.map(move |field| Place { is_cyclic, rpdo, field }).collect::<Vec<_>>()
        };
        rpdos.iter().enumerate().flat_map(of).collect()
    };
    let (first, second) = (in_rpdos(cyclic, true), in_rpdos(event_driven, false));
    first.into_iter().chain(second).collect()
}

fn indices<T>(items: &[T], matches: impl Fn(&T) -> bool) -> Vec<usize> {
    let items = items.iter().enumerate();
    items.filter(|(_, item)| matches(item)).map(|(index, _)| index).collect()
}

/// Returns the objects that a node maps, without dummy entries.
fn fields(node: NodeIndex, service: &Service) -> impl Iterator<Item = Field> + '_ {
    slots(service)
        .filter(|(mapped, _)| !mapped.object.is_dummy())
        .map(move |(mapped, slot)| Field { node, object: mapped.object, slot, is_reached: false })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NodeId;
    use crate::exchange::resolve;
    use crate::layout::{self, Group};
    use crate::testing::plans::elbow;

    fn plans(layout: impl Fn(NodeId, Group) -> Vec<Pdo>) -> Vec<(Channel, NodePlan)> {
        let nodes = [1, 2, 3, 4].map(|raw| NodeId::new(raw).unwrap());
        let plan = |(node, group): (&NodeId, &Group)| {
            let pdos = layout(*node, *group);
            (Channel(0), NodePlan { node: *node, pdos, ..elbow() })
        };
        nodes.iter().zip(&Group::threes(&nodes)).map(plan).collect()
    }

    fn grouped() -> RpdoImage {
        let plans = plans(|node, group| layout::grouped(node, 0, group, Some(5)));
        resolve(&plans).unwrap().rpdos
    }

    fn text(send: impl FnOnce(&mut Vec<Telegram>)) -> String {
        let mut out = Vec::new();
        send(&mut out);
        let frames: Vec<_> = out.iter().map(|telegram| telegram.frame.to_string()).collect();
        frames.join(" ")
    }

    #[test]
    fn group_shares_one_rpdo() {
        let mut rpdos = grouped();
        for (node, torque) in [(0, 1), (1, -2), (2, 0x1234), (3, 5)] {
            rpdos.set_target_torque(NodeIndex(node), PerMille(torque));
        }
        assert_eq!(text(|out| rpdos.append_synchronous(out)), "201#0100FEFF3412 204#0500");
    }

    #[test]
    fn per_drive_rpdo_carries_controlword_and_torque() {
        let mut rpdos = resolve(&plans(|node, _| layout::per_drive(node, None))).unwrap().rpdos;
        rpdos.set_target_torque(NodeIndex(1), PerMille(-1));
        rpdos.set_controlword(NodeIndex(1), Controlword::ENABLE_OPERATION, false);
        let frames = "201#00000000 202#0F00FFFF 203#00000000 204#00000000";
        assert_eq!(text(|out| rpdos.append_synchronous(out)), frames);
        assert_eq!(text(|out| rpdos.append_event_driven(false, out)), "");
        assert!(!rpdos.is_waiting(NodeIndex(1)));
    }

    #[test]
    fn event_driven_rpdos_are_limited_per_bus() {
        let mut plans = plans(|node, group| layout::grouped(node, 0, group, Some(5)));
        plans.iter_mut().skip(2).for_each(|(channel, _)| *channel = Channel(1));
        let mut rpdos = resolve(&plans).unwrap().rpdos;
        (0..4).for_each(|node| rpdos.set_controlword(NodeIndex(node), Controlword::SHUTDOWN, true));
        let cycles: Vec<_> =
            (0..5).map(|_| text(|out| rpdos.append_event_driven(false, out))).collect();
        assert_eq!(cycles.join("|"), "301#0600 303#0600||304#0600 302#0600||");
    }

    #[test]
    fn event_driven_rpdos_take_turns_every_other_cycle() {
        let mut rpdos = grouped();
        (0..4).for_each(|node| rpdos.set_controlword(NodeIndex(node), Controlword::SHUTDOWN, true));
        let cycles: Vec<_> =
            (0..9).map(|_| text(|out| rpdos.append_event_driven(false, out))).collect();
        assert_eq!(cycles.join("|"), "301#0600||302#0600||303#0600||304#0600||");
        rpdos.set_controlword(NodeIndex(2), Controlword::SWITCH_ON, true);
        rpdos.set_controlword(NodeIndex(0), Controlword::SWITCH_ON, true);
        assert!(rpdos.is_waiting(NodeIndex(2)) && !rpdos.is_waiting(NodeIndex(1)));
        let cycles: Vec<_> =
            (0..4).map(|_| text(|out| rpdos.append_event_driven(false, out))).collect();
        assert_eq!(cycles.join("|"), "301#0700||303#0700|");
    }

    #[test]
    fn late_torques_are_dropped_unless_zero() {
        let mut rpdos = grouped();
        rpdos.set_target_torque(NodeIndex(1), PerMille(-1));
        let mut out = Vec::new();
        rpdos.append_synchronous(&mut out);
        let sent: Vec<_> =
            out.iter().map(|telegram| rpdos.without_stale_torque(telegram)).collect();
        assert_eq!(sent, [None, Some(out[1])], "one torque drops the RPDO of its group");
        assert_eq!(rpdos.nodes_with_torque(&out[0]).collect::<Vec<_>>(), [0, 1, 2].map(NodeIndex));
        assert_eq!(
            rpdos.without_stale_torque(&Telegram { channel: Channel(1), ..out[1] }),
            None,
            "unknown"
        );
    }

    #[test]
    fn late_disabling_controlword_is_sent_with_zero_torque() {
        let mut rpdos = resolve(&plans(|node, _| layout::per_drive(node, None))).unwrap().rpdos;
        let words = [Controlword::ENABLE_OPERATION, Controlword::SHUTDOWN];
        for (node, word) in NodeIndex::each(words) {
            rpdos.set_target_torque(node, PerMille(300));
            rpdos.set_controlword(node, word, true);
        }
        let mut out = Vec::new();
        rpdos.append_synchronous(&mut out);
        assert_eq!(rpdos.without_stale_torque(&out[0]), None);
        assert_eq!(rpdos.without_stale_torque(&out[1]).unwrap().frame.to_string(), "202#06000000");
    }

    #[test]
    fn late_enabling_controlword_waits() {
        let mut rpdos = grouped();
        rpdos.set_controlword(NodeIndex(0), Controlword::ENABLE_OPERATION, true);
        rpdos.set_controlword(NodeIndex(2), Controlword::DISABLE_VOLTAGE, true);
        let cycles: Vec<_> =
            (0..8).map(|_| text(|out| rpdos.append_event_driven(true, out))).collect();
        let waits = !cycles.iter().any(|frames| frames.starts_with("301"));
        assert!(waits && cycles.contains(&"303#0000".to_owned()), "{cycles:?}");
        assert!(rpdos.is_waiting(NodeIndex(0)));
        assert_eq!(text(|out| rpdos.append_event_driven(false, out)), "301#0F00");
    }

    #[test]
    fn controlword_is_repeated_until_its_state_is_reached() {
        let mut rpdos = grouped();
        (0..4).for_each(|node| {
            rpdos.set_controlword(NodeIndex(node), Controlword::SHUTDOWN, node != 1);
        });
        (0..4).for_each(|_| {
            assert_ne!(text(|out| rpdos.append_event_driven(false, out)), "");
            assert_eq!(text(|out| rpdos.append_event_driven(false, out)), "");
        });
        let later: Vec<_> =
            (0..60).map(|_| text(|out| rpdos.append_event_driven(false, out))).collect();
        assert_eq!(later.iter().filter(|frames| *frames == "302#0600").count(), 3);
        assert!(later.iter().all(|frames| frames.is_empty() || frames == "302#0600"));
        rpdos.restart();
        assert!((0..4).all(|node| rpdos.is_waiting(NodeIndex(node))));
    }

    #[test]
    fn conflicting_mappings_of_a_shared_rpdo_are_reported() {
        let same = |node, group: Group| layout::grouped(node, 0, Group { slot: 0, ..group }, None);
        let message = "joint 3 (elbow): 6071h in 201h overlaps an object of another node";
        assert_eq!(resolve(&plans(same)).unwrap_err().to_string(), message);
        let longer = |node: NodeId, group: Group| {
            let size = if node.raw() == 2 { 4 } else { group.size };
            layout::grouped(node, 0, Group { size, ..group }, None)
        };
        let message =
            "joint 3 (elbow): 201h has another length or transmission type at another node";
        assert_eq!(resolve(&plans(longer)).unwrap_err().to_string(), message);
    }

    #[test]
    fn unmapped_required_object_is_reported() {
        for (cob_id, object) in
            [(0x303, "6040h"), (0x201, "6071h"), (0x183, "6064h"), (0x283, "6041h")]
        {
            let cut = |node: NodeId, group| {
                let mut pdos = layout::grouped(node, 0, group, None);
                let matches = |pdo: &&mut Pdo| node.raw() == 3 && pdo.cob_id == cob_id;
                pdos.iter_mut().filter(matches).for_each(|pdo| pdo.service = None);
                pdos
            };
            let message = format!("joint 3 (elbow): {object} is in none of its PDOs");
            assert_eq!(resolve(&plans(cut)).unwrap_err().to_string(), message);
        }
    }
}
