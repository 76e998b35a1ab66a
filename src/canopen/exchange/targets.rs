//! What drives are told: their RPDOs, made of targets.
//!
//! What acts at the SYNC is sent every cycle. What acts on arrival, such as a controlword that has its
//! own frame, is sent when it has changed, one frame every other cycle and bus. Behind the targets there
//! is room for one such frame and the drive's answer to it; more would keep the next SYNC waiting, which
//! leaves the host behind them, whatever its priority.

use crate::canopen::drive::Controlword;
use crate::canopen::exchange::ExchangeError;
use crate::canopen::exchange::slot::Slot;
use crate::canopen::exchange::slot::slots;
use crate::canopen::frame::Channel;
use crate::canopen::frame::Frame;
use crate::canopen::frame::Telegram;
use crate::canopen::layout::Direction;
use crate::canopen::layout::Pdo;
use crate::canopen::layout::Service;
use crate::canopen::object::Object;
use crate::canopen::pdo::PerMille;
use crate::canopen::plan::NodePlan;

/// A frame that acts on arrival is repeated after so many cycles while its drive does not follow.
const REPEAT: u32 = 20;

/// Every RPDO that is sent.
#[derive(Clone, Debug, Default)]
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
    node: usize,
    object: Object,
    slot: Slot,
    /// The node already is where this leads.
    is_followed: bool,
}

impl Outbox {
    pub(super) fn new(plans: &[(Channel, NodePlan)]) -> Result<Self, ExchangeError> {
        let mut rpdos: Vec<Rpdo> = Vec::new();
        for (node, (channel, plan)) in plans.iter().enumerate() {
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
    pub fn exert(&mut self, node: usize, torque: PerMille) {
        let value = u16::from_le_bytes(torque.0.to_le_bytes());
        self.rpdos().for_each(|rpdo| rpdo.set(node, Object::TARGET_TORQUE, value, true));
    }

    /// Where a drive's power stage is led, and whether it already is there.
    pub fn lead(&mut self, node: usize, word: Controlword, is_followed: bool) {
        self.rpdos().for_each(|rpdo| rpdo.set(node, Object::CONTROLWORD, word.0, is_followed));
    }

    /// Whether something that acts on arrival has not been sent to a drive yet.
    pub fn is_waiting(&self, node: usize) -> bool {
        let is_for = |rpdo: &&Rpdo| rpdo.fields.iter().any(|field| field.node == node);
        self.on_change.iter().filter(is_for).any(|rpdo| rpdo.sent != Some(rpdo.content))
    }

    /// Appends what acts at the next SYNC, in the order of the nodes.
    pub fn cyclic(&self, out: &mut Vec<Telegram>) {
        out.extend(self.cyclic.iter().filter_map(Rpdo::telegram));
    }

    /// Appends what acts on arrival and is due, at most one frame for each bus, and none in the cycle
    /// after that. Call it once a cycle.
    pub fn changed(&mut self, out: &mut Vec<Telegram>) {
        self.on_change.iter_mut().for_each(|rpdo| rpdo.age = rpdo.age.saturating_add(1));
        if std::mem::take(&mut self.rests) {
            return;
        }
        let first = out.len();
        let count = self.on_change.len();
        for place in (self.turn..count).chain(0..self.turn) {
            let Some(rpdo) = self.on_change.get_mut(place) else { continue };
            let is_taken = out.iter().skip(first).any(|sent| sent.channel == rpdo.channel);
            if rpdo.is_due() && !is_taken {
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

    /// The data bytes of each frame that goes out on a bus every cycle.
    pub fn bytes_on(&self, channel: Channel) -> impl Iterator<Item = u32> + '_ {
        let here = self.cyclic.iter().filter(move |rpdo| rpdo.channel == channel);
        here.map(|rpdo| rpdo.service.bytes())
    }

    fn rpdos(&mut self) -> impl Iterator<Item = &mut Rpdo> {
        self.cyclic.iter_mut().chain(&mut self.on_change)
    }

    pub(super) fn reaches(&self, node: usize, object: Object) -> bool {
        let mut fields = self.cyclic.iter().chain(&self.on_change).flat_map(|rpdo| &rpdo.fields);
        fields.any(|field| field.node == node && field.object == object)
    }
}

impl Rpdo {
    fn new(channel: Channel, node: usize, pdo: &Pdo, service: &Service) -> Self {
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
    fn share(&mut self, name: &str, node: usize, service: &Service) -> Result<(), ExchangeError> {
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

    fn set(&mut self, node: usize, object: Object, value: u16, is_followed: bool) {
        let is_it = |field: &&mut Field| field.node == node && field.object == object;
        for field in self.fields.iter_mut().filter(is_it) {
            self.content = field.slot.write(self.content, value);
            field.is_followed = is_followed;
        }
    }

    /// Whether it says something new, or the same to one who does not follow.
    fn is_due(&self) -> bool {
        let is_followed = self.fields.iter().all(|field| field.is_followed);
        self.sent != Some(self.content) || !is_followed && self.age >= REPEAT
    }

    fn telegram(&self) -> Option<Telegram> {
        let bytes = self.content.to_le_bytes();
        let length = usize::try_from(self.service.bytes()).ok()?;
        let frame = Frame::from_slice(self.cob_id, bytes.get(..length)?)?;
        Some(Telegram { channel: self.channel, frame })
    }
}

/// What a node takes of a frame, dummies left out.
fn fields(node: usize, service: &Service) -> impl Iterator<Item = Field> + '_ {
    slots(service)
        .filter(|(mapped, _)| !mapped.object.is_dummy())
        .map(move |(mapped, slot)| Field { node, object: mapped.object, slot, is_followed: false })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::NodeId;
    use crate::canopen::exchange::resolve;
    use crate::canopen::layout;
    use crate::canopen::layout::Group;
    use crate::canopen::plan::tests::elbow;

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
        resolve(&plans).unwrap().1
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
            outbox.exert(node, PerMille(torque));
        }
        assert_eq!(text(|out| outbox.cyclic(out)), "201#0100FEFF3412 204#0500");
    }

    #[test]
    fn with_a_frame_for_each_drive_word_and_torque_go_together() {
        let mut outbox = resolve(&plans(|node, _| layout::per_drive(node, None))).unwrap().1;
        outbox.exert(1, PerMille(-1));
        outbox.lead(1, Controlword::ENABLE_OPERATION, false);
        let frames = "201#00000000 202#0F00FFFF 203#00000000 204#00000000";
        assert_eq!(text(|out| outbox.cyclic(out)), frames);
        assert_eq!(text(|out| outbox.changed(out)), "");
        assert!(!outbox.is_waiting(1));
    }

    #[test]
    fn words_go_out_every_other_cycle_and_in_turn() {
        let mut outbox = grouped();
        (0..4).for_each(|node| outbox.lead(node, Controlword::SHUTDOWN, true));
        let cycles: Vec<_> = (0..9).map(|_| text(|out| outbox.changed(out))).collect();
        assert_eq!(cycles.join("|"), "301#0600||302#0600||303#0600||304#0600||");
        outbox.lead(2, Controlword::SWITCH_ON, true);
        outbox.lead(0, Controlword::SWITCH_ON, true);
        assert!(outbox.is_waiting(2) && !outbox.is_waiting(1));
        let cycles: Vec<_> = (0..4).map(|_| text(|out| outbox.changed(out))).collect();
        assert_eq!(cycles.join("|"), "301#0700||303#0700|");
    }

    #[test]
    fn who_does_not_follow_is_told_again() {
        let mut outbox = grouped();
        (0..4).for_each(|node| outbox.lead(node, Controlword::SHUTDOWN, node != 1));
        (0..4).for_each(|_| {
            assert_ne!(text(|out| outbox.changed(out)), "");
            assert_eq!(text(|out| outbox.changed(out)), "");
        });
        let later: Vec<_> = (0..60).map(|_| text(|out| outbox.changed(out))).collect();
        assert_eq!(later.iter().filter(|frames| *frames == "302#0600").count(), 3);
        assert!(later.iter().all(|frames| frames.is_empty() || frames == "302#0600"));
        outbox.restart();
        assert!((0..4).all(|node| outbox.is_waiting(node)));
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
