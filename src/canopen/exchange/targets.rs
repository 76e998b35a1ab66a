//! What drives are told: their RPDOs, made of targets.
//!
//! What acts at the SYNC is sent every cycle. What acts on arrival, such as a controlword that has its
//! own frame, is sent when it has changed, one frame every other cycle and bus. Behind the targets there
//! is room for one such frame and the drive's answer to it; more would keep the next SYNC waiting, which
//! leaves the host behind them, whatever its priority.

use crate::drive::Controlword;
use crate::exchange::ExchangeError;
use crate::exchange::slot::Slot;
use crate::exchange::slot::slots;
use crate::frame::Channel;
use crate::frame::Frame;
use crate::frame::Telegram;
use crate::layout::Direction;
use crate::layout::Pdo;
use crate::layout::Service;
use crate::object::Object;
use crate::plan::NodePlan;
use units::drive::PerMille;
use units::numbering::NodeIndex;

/// A frame that acts on arrival is repeated after so many cycles while its drive does not follow.
const REPEAT: u32 = 20;

/// Every RPDO that is sent.
#[derive(Clone, Debug)]
pub struct Outbox {
    cyclic: Vec<Rpdo>,
    on_change: Vec<Rpdo>,
    /// Which of those on change comes first the next time.
    turn: usize,
    /// One was sent in the last cycle.
    rests: bool,
}

/// One of them, and what it says at present.
#[derive(Clone, Debug)]
struct Rpdo {
    channel: Channel,
    cob_id: u16,
    service: Service,
    fields: Vec<Field>,
    content: u64,
    /// What it said when it was last sent.
    sent: Option<u64>,
    /// Cycles since then.
    age: u32,
}

/// What is in it for whom.
#[derive(Clone, Copy, Debug)]
struct Field {
    node: NodeIndex,
    object: Object,
    slot: Slot,
    /// The node already is where this leads.
    is_followed: bool,
}

impl Outbox {
    pub(super) fn new(plans: &[(Channel, NodePlan)]) -> Result<Self, ExchangeError> {
        let mut rpdos: Vec<Rpdo> = Vec::new();
        for (node, (channel, plan)) in NodeIndex::each(plans) {
            for pdo in plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Receive) {
                let Some(service) = &pdo.service else { continue };
                let is_it =
                    |rpdo: &&mut Rpdo| rpdo.channel == *channel && rpdo.cob_id == pdo.cob_id;
                match rpdos.iter_mut().find(is_it) {
                    Some(rpdo) => rpdo.share(&plan.name, node, service)?,
                    None => rpdos.push(Rpdo::new(*channel, node, pdo, service)),
                }
            }
        }
        let (cyclic, on_change) =
            rpdos.into_iter().partition(|rpdo| rpdo.service.transmission.syncs().is_some());
        Ok(Self { cyclic, on_change, turn: 0, rests: false })
    }

    /// The torque a drive is to exert from the next SYNC on.
    pub fn exert(&mut self, node: NodeIndex, torque: PerMille) {
        let value = u16::from_le_bytes(torque.0.to_le_bytes());
        self.rpdos().for_each(|rpdo| rpdo.set(node, Object::TARGET_TORQUE, value, true));
    }

    /// Where a drive's power stage is led, and whether it already is there.
    pub fn lead(&mut self, node: NodeIndex, word: Controlword, is_followed: bool) {
        self.rpdos().for_each(|rpdo| rpdo.set(node, Object::CONTROLWORD, word.0, is_followed));
    }

    /// Whether something that acts on arrival has not been sent to a drive yet.
    pub fn is_waiting(&self, node: NodeIndex) -> bool {
        let is_for = |rpdo: &&Rpdo| rpdo.fields.iter().any(|field| field.node == node);
        self.on_change.iter().filter(is_for).any(|rpdo| rpdo.sent != Some(rpdo.content))
    }

    /// Appends what acts at the next SYNC, in the order of the nodes.
    pub fn cyclic(&self, out: &mut Vec<Telegram>) {
        out.extend(self.cyclic.iter().filter_map(Rpdo::telegram));
    }

    /// Returns what of a [cyclic](Self::cyclic) frame may be sent when its torques are too old: all of it if
    /// they are zero; zeros in their place if it takes power away; otherwise nothing.
    pub fn late(&self, telegram: &Telegram) -> Option<Telegram> {
        let rpdo = self.cyclic_of(telegram)?;
        match (rpdo.pushes(), rpdo.enables()) {
            (false, _) => Some(*telegram),
            (true, true) => None,
            (true, false) => rpdo.telegram_of(rpdo.without_torque()),
        }
    }

    /// Returns the nodes that take a torque from a cyclic frame.
    pub fn pushed_by(&self, telegram: &Telegram) -> impl Iterator<Item = NodeIndex> + '_ {
        let rpdo = self.cyclic_of(telegram).into_iter();
        let fields = rpdo.flat_map(|rpdo| &rpdo.fields);
        fields.filter(|field| field.object == Object::TARGET_TORQUE).map(|field| field.node)
    }

    fn cyclic_of(&self, telegram: &Telegram) -> Option<&Rpdo> {
        let is_it =
            |rpdo: &&Rpdo| (rpdo.channel, rpdo.cob_id) == (telegram.channel, telegram.frame.cob_id);
        self.cyclic.iter().find(is_it)
    }

    /// Appends what acts on arrival and is due, at most one frame for each bus, and none in the cycle
    /// after that. Where `is_late`, a word that enables operation waits. Call it once a cycle.
    pub fn changed(&mut self, is_late: bool, out: &mut Vec<Telegram>) {
        self.on_change.iter_mut().for_each(|rpdo| rpdo.age = rpdo.age.saturating_add(1));
        if std::mem::take(&mut self.rests) {
            return;
        }
        let first = out.len();
        let count = self.on_change.len();
        for place in (self.turn..count).chain(0..self.turn) {
            let Some(rpdo) = self.on_change.get_mut(place) else { continue };
            let is_taken = out.iter().skip(first).any(|sent| sent.channel == rpdo.channel);
            if rpdo.is_due() && !is_taken && !(is_late && rpdo.enables()) {
                rpdo.sent = Some(rpdo.content);
                rpdo.age = 0;
                out.extend(rpdo.telegram());
                self.turn = place + 1;
                self.rests = true;
            }
        }
    }

    /// Forgets what was sent: the drives start anew.
    pub fn restart(&mut self) {
        self.on_change.iter_mut().for_each(|rpdo| rpdo.sent = None);
    }

    /// How many frames it has for a bus, those that go out on change among them.
    pub fn frames_on(&self, channel: Channel) -> u32 {
        let all = self.cyclic.iter().chain(&self.on_change);
        let count = all.filter(|rpdo| rpdo.channel == channel).count();
        u32::try_from(count).unwrap_or(u32::MAX)
    }

    /// The data bytes of each frame that goes out on a bus every cycle.
    pub fn bytes_on(&self, channel: Channel) -> impl Iterator<Item = u32> + '_ {
        let here = self.cyclic.iter().filter(move |rpdo| rpdo.channel == channel);
        here.map(|rpdo| rpdo.service.bytes())
    }

    fn rpdos(&mut self) -> impl Iterator<Item = &mut Rpdo> {
        self.cyclic.iter_mut().chain(&mut self.on_change)
    }

    pub(super) fn reaches(&self, node: NodeIndex, object: Object) -> bool {
        let mut fields = self.cyclic.iter().chain(&self.on_change).flat_map(|rpdo| &rpdo.fields);
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

    /// Another node takes it, too.
    fn share(
        &mut self,
        name: &str,
        node: NodeIndex,
        service: &Service,
    ) -> Result<(), ExchangeError> {
        let cob_id = self.cob_id;
        if (service.bytes(), service.transmission)
            != (self.service.bytes(), self.service.transmission)
        {
            return Err(ExchangeError::Unlike { name: name.to_owned(), cob_id });
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

    fn set(&mut self, node: NodeIndex, object: Object, value: u16, is_followed: bool) {
        let is_it = |field: &&mut Field| field.node == node && field.object == object;
        for field in self.fields.iter_mut().filter(is_it) {
            self.content = field.slot.write(self.content, value);
            field.is_followed = is_followed;
        }
    }

    /// Returns whether it asks a node for torque.
    fn pushes(&self) -> bool {
        let mut torques = self.of(Object::TARGET_TORQUE);
        torques.any(|field| field.slot.read(self.content) != [0; 8])
    }

    /// Returns whether it enables operation, or leaves it so: it has no controlword that does not.
    fn enables(&self) -> bool {
        let mut words = self.of(Object::CONTROLWORD);
        words.all(|field| {
            let [low, high, ..] = field.slot.read(self.content);
            Controlword(u16::from_le_bytes([low, high])).enables()
        })
    }

    /// Its content with zeros for torques.
    fn without_torque(&self) -> u64 {
        let torques = self.of(Object::TARGET_TORQUE);
        torques.fold(self.content, |content, field| field.slot.write(content, 0))
    }

    fn of(&self, object: Object) -> impl Iterator<Item = &Field> {
        self.fields.iter().filter(move |field| field.object == object)
    }

    /// Whether it says something new, or the same to one who does not follow.
    fn is_due(&self) -> bool {
        let is_followed = self.fields.iter().all(|field| field.is_followed);
        self.sent != Some(self.content) || !is_followed && self.age >= REPEAT
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

/// What a node takes of a frame, dummies left out.
fn fields(node: NodeIndex, service: &Service) -> impl Iterator<Item = Field> + '_ {
    slots(service)
        .filter(|(mapped, _)| !mapped.object.is_dummy())
        .map(move |(mapped, slot)| Field { node, object: mapped.object, slot, is_followed: false })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NodeId;
    use crate::exchange::resolve;
    use crate::layout;
    use crate::layout::Group;
    use crate::testing::plans::elbow;

    fn plans(layout: impl Fn(NodeId, Group) -> Vec<Pdo>) -> Vec<(Channel, NodePlan)> {
        let nodes = [1, 2, 3, 4].map(|raw| NodeId::new(raw).unwrap());
        let plan = |(node, group): (&NodeId, &Group)| {
            let pdos = layout(*node, *group);
            (Channel(0), NodePlan { node: *node, pdos, ..elbow() })
        };
        nodes.iter().zip(&Group::threes(&nodes)).map(plan).collect()
    }

    fn grouped() -> Outbox {
        let plans = plans(|node, group| layout::grouped(node, 0, group, Some(5)));
        resolve(&plans).unwrap().outbox
    }

    fn text(send: impl FnOnce(&mut Vec<Telegram>)) -> String {
        let mut out = Vec::new();
        send(&mut out);
        let frames: Vec<_> = out.iter().map(|telegram| telegram.frame.to_string()).collect();
        frames.join(" ")
    }

    #[test]
    fn a_group_has_one_frame_with_a_place_for_each() {
        let mut outbox = grouped();
        for (node, torque) in [(0, 1), (1, -2), (2, 0x1234), (3, 5)] {
            outbox.exert(NodeIndex(node), PerMille(torque));
        }
        assert_eq!(text(|out| outbox.cyclic(out)), "201#0100FEFF3412 204#0500");
    }

    #[test]
    fn with_a_frame_for_each_drive_word_and_torque_go_together() {
        let mut outbox = resolve(&plans(|node, _| layout::per_drive(node, None))).unwrap().outbox;
        outbox.exert(NodeIndex(1), PerMille(-1));
        outbox.lead(NodeIndex(1), Controlword::ENABLE_OPERATION, false);
        let frames = "201#00000000 202#0F00FFFF 203#00000000 204#00000000";
        assert_eq!(text(|out| outbox.cyclic(out)), frames);
        assert_eq!(text(|out| outbox.changed(false, out)), "");
        assert!(!outbox.is_waiting(NodeIndex(1)));
    }

    #[test]
    fn each_bus_has_a_word_of_its_own_in_a_cycle() {
        let mut plans = plans(|node, group| layout::grouped(node, 0, group, Some(5)));
        plans.iter_mut().skip(2).for_each(|(channel, _)| *channel = Channel(1));
        let mut outbox = resolve(&plans).unwrap().outbox;
        (0..4).for_each(|node| outbox.lead(NodeIndex(node), Controlword::SHUTDOWN, true));
        let cycles: Vec<_> = (0..5).map(|_| text(|out| outbox.changed(false, out))).collect();
        assert_eq!(cycles.join("|"), "301#0600 303#0600||304#0600 302#0600||");
    }

    #[test]
    fn words_go_out_every_other_cycle_and_in_turn() {
        let mut outbox = grouped();
        (0..4).for_each(|node| outbox.lead(NodeIndex(node), Controlword::SHUTDOWN, true));
        let cycles: Vec<_> = (0..9).map(|_| text(|out| outbox.changed(false, out))).collect();
        assert_eq!(cycles.join("|"), "301#0600||302#0600||303#0600||304#0600||");
        outbox.lead(NodeIndex(2), Controlword::SWITCH_ON, true);
        outbox.lead(NodeIndex(0), Controlword::SWITCH_ON, true);
        assert!(outbox.is_waiting(NodeIndex(2)) && !outbox.is_waiting(NodeIndex(1)));
        let cycles: Vec<_> = (0..4).map(|_| text(|out| outbox.changed(false, out))).collect();
        assert_eq!(cycles.join("|"), "301#0700||303#0700|");
    }

    #[test]
    fn late_torques_are_dropped_and_zeros_are_not() {
        let mut outbox = grouped();
        outbox.exert(NodeIndex(1), PerMille(-1));
        let mut out = Vec::new();
        outbox.cyclic(&mut out);
        let sent: Vec<_> = out.iter().map(|telegram| outbox.late(telegram)).collect();
        assert_eq!(sent, [None, Some(out[1])], "one joint's torque holds back its group");
        assert_eq!(outbox.pushed_by(&out[0]).collect::<Vec<_>>(), [0, 1, 2].map(NodeIndex));
        assert_eq!(outbox.late(&Telegram { channel: Channel(1), ..out[1] }), None, "unknown");
    }

    #[test]
    fn late_words_that_take_power_away_are_sent_without_torque() {
        let mut outbox = resolve(&plans(|node, _| layout::per_drive(node, None))).unwrap().outbox;
        let words = [Controlword::ENABLE_OPERATION, Controlword::SHUTDOWN];
        for (node, word) in NodeIndex::each(words) {
            outbox.exert(node, PerMille(300));
            outbox.lead(node, word, true);
        }
        let mut out = Vec::new();
        outbox.cyclic(&mut out);
        assert_eq!(outbox.late(&out[0]), None);
        assert_eq!(outbox.late(&out[1]).unwrap().frame.to_string(), "202#06000000");
    }

    #[test]
    fn late_words_that_enable_wait_and_others_do_not() {
        let mut outbox = grouped();
        outbox.lead(NodeIndex(0), Controlword::ENABLE_OPERATION, true);
        outbox.lead(NodeIndex(2), Controlword::DISABLE_VOLTAGE, true);
        let cycles: Vec<_> = (0..8).map(|_| text(|out| outbox.changed(true, out))).collect();
        let waits = !cycles.iter().any(|frames| frames.starts_with("301"));
        assert!(waits && cycles.contains(&"303#0000".to_owned()), "{cycles:?}");
        assert!(outbox.is_waiting(NodeIndex(0)));
        assert_eq!(text(|out| outbox.changed(false, out)), "301#0F00");
    }

    #[test]
    fn who_does_not_follow_is_told_again() {
        let mut outbox = grouped();
        (0..4).for_each(|node| outbox.lead(NodeIndex(node), Controlword::SHUTDOWN, node != 1));
        (0..4).for_each(|_| {
            assert_ne!(text(|out| outbox.changed(false, out)), "");
            assert_eq!(text(|out| outbox.changed(false, out)), "");
        });
        let later: Vec<_> = (0..60).map(|_| text(|out| outbox.changed(false, out))).collect();
        assert_eq!(later.iter().filter(|frames| *frames == "302#0600").count(), 3);
        assert!(later.iter().all(|frames| frames.is_empty() || frames == "302#0600"));
        outbox.restart();
        assert!((0..4).all(|node| outbox.is_waiting(NodeIndex(node))));
    }

    #[test]
    fn nodes_that_contradict_each_other_about_a_frame_are_named() {
        let same = |node, group: Group| layout::grouped(node, 0, Group { slot: 0, ..group }, None);
        let message = "joint 3 (elbow): 6071h in 201h is where another node has something else";
        assert_eq!(resolve(&plans(same)).unwrap_err().to_string(), message);
        let longer = |node: NodeId, group: Group| {
            let size = if node.raw() == 2 { 4 } else { group.size };
            layout::grouped(node, 0, Group { size, ..group }, None)
        };
        let message = "joint 3 (elbow): 201h is not as another node that takes it has it";
        assert_eq!(resolve(&plans(longer)).unwrap_err().to_string(), message);
    }

    #[test]
    fn a_drive_that_cannot_be_told_something_is_named() {
        for (cob_id, object) in
            [(0x303, "6040h"), (0x201, "6071h"), (0x183, "6064h"), (0x283, "6041h")]
        {
            let cut = |node: NodeId, group| {
                let mut pdos = layout::grouped(node, 0, group, None);
                let is_it = |pdo: &&mut Pdo| node.raw() == 3 && pdo.cob_id == cob_id;
                pdos.iter_mut().filter(is_it).for_each(|pdo| pdo.service = None);
                pdos
            };
            let message = format!("joint 3 (elbow): {object} is in none of its PDOs");
            assert_eq!(resolve(&plans(cut)).unwrap_err().to_string(), message);
        }
    }
}
