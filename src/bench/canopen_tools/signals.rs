//! Named signals of the effective PDO layout, with bits and units.
//!
//! The signals of a frame are the union of its consumers' mappings, so a frame shared by several drives reads as
//! one. Dummies are skipped; bits that two nodes map differently are named twice. [`object_text`] formats values,
//! [`decode`](crate::decode) log lines.

use canopen_rs::NodeId;

use crate::object_text;
use canopen::eds::Eds;
use canopen::frame::Channel;
use canopen::layout::{Direction, MappedObject, Pdo, Service};
use canopen::object::Object;
use canopen::plan::NodePlan;
use canopen::sync::TransmissionType;

/// Signal of a coupled joint's actuator, as no single signal gives the joint's position.
pub const ACTUATOR_POSITION: &str = "actuator_position";

/// Node whose traffic is decoded.
#[derive(Clone, Debug)]
pub struct Member {
    /// Name in frames and signals: `elbow`.
    pub name: String,
    /// Bus, by its index in the configuration.
    pub channel: Channel,
    /// Planned settings: node-id, PDOs, error control, EMCY COB-ID.
    pub plan: NodePlan,
    /// Scale of each object.
    pub measures: Vec<(Object, Measure)>,
    /// EDS of the device, for names and types of objects without standard ones.
    pub eds: Option<Eds>,
}

impl Member {
    pub const fn node(&self) -> NodeId {
        self.plan.node
    }
}

/// Scale of a raw number: `(raw - zero) * step`.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// Name of the quantity, where it differs from the object's: `actuator_position`.
    pub quantity: &'static str,
    /// Raw number of zero.
    pub zero: i32,
    /// Physical value of one step, in `unit`.
    pub step: f64,
    /// Unit: `rad`, `m`, `N·m`.
    pub unit: &'static str,
    /// Range in `unit`, if known.
    pub range: Option<[f64; 2]>,
    /// Value at the joint, if it is not linear.
    pub curve: Option<Curve>,
}

impl Measure {
    /// Physical value. A 32-bit number may have wrapped once since zero.
    pub fn value(&self, raw: i64) -> f64 {
        let whole = i32::try_from(raw).map(|raw| raw.wrapping_sub(self.zero));
        let steps = whole.map_or_else(|_| float(raw) - f64::from(self.zero), f64::from);
        steps * self.step + 0.0 // never `-0`
    }

    /// Physical value of raw 0, for a linear scale without wrapping.
    pub fn offset(&self) -> f64 {
        0.0 - f64::from(self.zero) * self.step
    }
}

/// Converts `raw` to the nearest floating-point number.
#[expect(
    clippy::as_conversions,
    clippy::cast_precision_loss,
    reason = "a value of more than 53 bits is shown, not computed with"
)]
const fn float(raw: i64) -> f64 {
    raw as f64
}

/// Odd rising curve, as a table of values by raw magnitude from 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Place of the value: `joint`, or `actuator` for coupled joints.
    pub place: &'static str,
    /// Unit: `N·m`, or `N` for a prismatic joint.
    pub unit: &'static str,
    /// Values of raw 0, 1, 2 …, with the sign of the direction; constant beyond the end.
    pub table: Vec<f64>,
}

impl Curve {
    /// Value of a raw number.
    pub fn at(&self, raw: i64) -> f64 {
        let place = usize::try_from(raw.unsigned_abs()).unwrap_or(usize::MAX);
        let value = self.table.get(place).or(self.table.last()).copied().unwrap_or_default();
        if raw < 0 { 0.0 - value } else { value }
    }
}

/// Signal of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Name: `elbow_position`.
    pub name: String,
    /// Index of its member.
    pub member: usize,
    /// Mapped object; its value has the text of [`object_text`].
    pub object: Object,
    /// Lowest bit; bit 0 is the lowest of byte 0.
    pub start: u8,
    /// Length in bits.
    pub bits: u8,
    /// Set if it is signed.
    pub is_signed: bool,
    /// Scale; `None` for a plain number or bit field.
    pub measure: Option<Measure>,
    /// Set if an earlier signal has some of its bits: one node maps the frame wrongly.
    pub is_disputed: bool,
}

impl Signal {
    /// Raw number in the data of a frame.
    pub fn raw(&self, data: [u8; 8]) -> i64 {
        let shifted = u64::from_le_bytes(data).checked_shr(u32::from(self.start)).unwrap_or(0);
        let bits = usize::from(self.bits.clamp(1, 64));
        if self.is_signed {
            return object_text::sign_extended(shifted, bits);
        }
        (shifted & u64::MAX >> (64 - bits)).cast_signed()
    }

    /// Scale and curve, if it has a value at the joint.
    pub fn measured(&self) -> Option<(&Measure, &Curve)> {
        let measure = self.measure.as_ref()?;
        Some((measure, measure.curve.as_ref()?))
    }

    /// Returns whether a frame of `bytes` bytes contains all of it.
    pub fn is_in(&self, bytes: usize) -> bool {
        usize::from(self.start) + usize::from(self.bits) <= 8 * bytes
    }

    fn overlaps(&self, other: &Self) -> bool {
        self.start < other.start + other.bits && other.start < self.start + self.bits
    }
}

/// PDO on a bus, with all its senders and receivers.
#[derive(Clone, Debug, PartialEq)]
pub struct PdoFrame {
    /// Bus, by its index in the configuration.
    pub channel: Channel,
    /// Identifier, 11 bits.
    pub cob_id: u16,
    /// Name: `TPDO1_elbow`, `RPDO1_group1`.
    pub name: String,
    /// Indices of the senders; empty for the master.
    pub senders: Vec<usize>,
    /// Indices of the receivers; empty for the master.
    pub receivers: Vec<usize>,
    /// Length in bytes.
    pub bytes: usize,
    /// Transmission type, sub-index 2 of the communication parameter.
    pub transmission: TransmissionType,
    /// Period in ms, if it is periodic.
    pub event_timer_ms: Option<u16>,
    /// Signals by their first bits.
    pub signals: Vec<Signal>,
}

impl PdoFrame {
    /// Returns whether its signals belong to several nodes.
    pub fn is_shared(&self) -> bool {
        let first = self.signals.first().map(|signal| signal.member);
        self.signals.iter().any(|signal| Some(signal.member) != first)
    }

    /// Units at motor and joint, if all signals have both and agree.
    pub fn common_units(&self) -> Option<[&'static str; 2]> {
        let units = |signal: &Signal| {
            let (measure, curve) = signal.measured()?;
            (curve.place == "joint").then_some([measure.unit, curve.unit])
        };
        let first = units(self.signals.first()?)?;
        self.signals.iter().all(|signal| units(signal) == Some(first)).then_some(first)
    }
}

/// Mapping of one node in a frame.
struct Part<'m> {
    member: usize,
    of: &'m Member,
    pdo: &'m Pdo,
    service: &'m Service,
}

/// PDOs in use, by bus and COB-ID.
pub fn frames(members: &[Member]) -> Vec<PdoFrame> {
    let mut parts: Vec<Part<'_>> = Vec::new();
    for (member, of) in members.iter().enumerate() {
        let used = of.plan.pdos.iter().filter_map(|pdo| Some((pdo, pdo.service.as_ref()?)));
        parts.extend(used.map(|(pdo, service)| Part { member, of, pdo, service }));
    }
    parts.sort_by_key(|part| (part.of.channel, part.pdo.cob_id));
    let same =
        |a: &Part<'_>, b: &Part<'_>| (a.of.channel, a.pdo.cob_id) == (b.of.channel, b.pdo.cob_id);
    let mut groups = 0;
    parts.chunk_by(same).filter_map(|parts| frame(parts, &mut groups)).collect()
}

/// Merges the frame of all nodes that send or receive it; `groups` counts frames with several receivers.
fn frame(parts: &[Part<'_>], groups: &mut u32) -> Option<PdoFrame> {
    let those = |direction| {
        let of = move |part: &&Part<'_>| part.pdo.direction == direction;
        parts.iter().filter(of).collect::<Vec<_>>()
    };
    let (senders, receivers) = (those(Direction::Transmit), those(Direction::Receive));
    // The sender defines the content of a TPDO; the receivers define that of an RPDO.
    let authors = if senders.is_empty() { &receivers } else { &senders };
    let first = authors.first()?;
    let signals = signals(authors);
    let kind = if senders.is_empty() { "RPDO" } else { "TPDO" };
    let owner = if authors.len() == 1 {
        first.of.name.clone()
    } else {
        *groups += 1;
        format!("group{groups}")
    };
    let name = format!("{kind}{}_{owner}", first.pdo.number);
    let places = |parts: &[&Part<'_>]| parts.iter().map(|part| part.member).collect();
    Some(PdoFrame {
        channel: first.of.channel,
        cob_id: first.pdo.cob_id,
        name,
        senders: places(&senders),
        receivers: places(&receivers),
        bytes: authors.iter().map(|part| bytes(part.service)).max().unwrap_or_default(),
        transmission: first.service.transmission,
        event_timer_ms: first.service.event_timer_ms.filter(|_| !senders.is_empty()),
        signals,
    })
}

fn bytes(service: &Service) -> usize {
    usize::try_from(service.bytes()).unwrap_or(usize::MAX)
}

/// Union of the mappings of all `authors`.
fn signals(authors: &[&Part<'_>]) -> Vec<Signal> {
    let mut signals: Vec<Signal> = Vec::new();
    for part in authors {
        let mut start = 0_u8;
        for mapped in &part.service.mapping {
            if !mapped.object.is_dummy() {
                signals.push(signal(part, *mapped, start));
            }
            start = start.saturating_add(mapped.bits);
        }
    }
    signals.retain(|signal| signal.bits > 0 && signal.is_in(8));
    signals.sort_by_key(|signal| (signal.start, signal.member));
    for place in 1..signals.len() {
        let (before, rest) = signals.split_at_mut(place);
        if let Some(signal) = rest.first_mut() {
            signal.is_disputed = before.iter().any(|other| signal.overlaps(other));
        }
    }
    signals
}

fn signal(part: &Part<'_>, mapped: MappedObject, start: u8) -> Signal {
    let MappedObject { object, bits } = mapped;
    let of_object = part.of.measures.iter().find(|(measured, _)| *measured == object);
    let measure = of_object.map(|(_, measure)| measure.clone());
    let described = part.of.eds.as_ref().and_then(|eds| eds.object(object));
    let data_type =
        object_text::data_type(object).or(described.map(|described| described.data_type));
    let quantity = measure.as_ref().map(|measure| measure.quantity).filter(|name| !name.is_empty());
    let what = match quantity.or(object_text::name(object)) {
        Some(name) => identifier(name),
        None => format!("{:04X}h_{}", object.index, object.sub),
    };
    Signal {
        name: format!("{}_{what}", part.of.name),
        member: part.member,
        object,
        start,
        bits,
        is_signed: data_type.is_some_and(object_text::is_signed),
        measure,
        is_disputed: false,
    }
}

/// Replaces all but letters, digits and underscores, for names of frames and signals.
pub fn identifier(name: &str) -> String {
    let legal = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    name.chars().map(legal).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use proptest::prelude::*;

    use super::*;
    use canopen::layout;
    use canopen::testing::plans::{IDENTITY, heartbeats};

    fn node(id: u8) -> NodeId {
        NodeId::new(id).unwrap()
    }

    pub(crate) fn torque() -> Measure {
        let table = (0..=1_000).map(|raw| f64::from(raw) * 0.02).collect();
        Measure {
            quantity: "",
            zero: 0,
            step: 0.000_1,
            unit: "N·m",
            range: Some([-0.1, 0.1]),
            curve: Some(Curve { place: "joint", unit: "N·m", table }),
        }
    }

    pub(crate) fn position() -> Measure {
        Measure { quantity: "", zero: 100, step: 0.001, unit: "rad", range: None, curve: None }
    }

    pub(crate) fn drive(name: &str, id: u8, pdos: Vec<Pdo>) -> Member {
        let title = format!("joint {id} ({name})");
        Member {
            name: name.to_owned(),
            channel: Channel(0),
            plan: NodePlan::drive(title, node(id), IDENTITY, pdos, &heartbeats(), 1_000),
            measures: vec![
                (Object::POSITION_ACTUAL, position()),
                (Object::TARGET_TORQUE, torque()),
                (Object::TORQUE_ACTUAL, torque()),
            ],
            eds: None,
        }
    }

    pub(crate) fn switch_box() -> Member {
        Member {
            name: "switch_box".to_owned(),
            channel: Channel(0),
            plan: NodePlan::switches(
                "switch box".to_owned(),
                node(16),
                IDENTITY,
                None,
                &heartbeats(),
            ),
            measures: Vec::new(),
            eds: None,
        }
    }

    /// Drives with separate PDOs.
    pub(crate) fn per_drive() -> Vec<Member> {
        [("shoulder", 1), ("elbow", 2), ("wrist", 3)]
            .map(|(name, id)| drive(name, id, layout::per_drive(node(id), Some(5))))
            .into_iter()
            .chain([switch_box()])
            .collect()
    }

    const DUMMY: Object = Object { index: 3, sub: 0 };

    fn pdo(
        direction: Direction,
        number: u16,
        cob_id: u16,
        transmission: TransmissionType,
        mapping: &[(Object, u8)],
    ) -> Pdo {
        let mapping =
            mapping.iter().map(|(object, bits)| MappedObject { object: *object, bits: *bits });
        let service = Service {
            transmission,
            inhibit_100us: None,
            event_timer_ms: None,
            mapping: mapping.collect(),
        };
        Pdo { direction, number, cob_id, has_no_rtr: false, service: Some(service) }
    }

    /// Drives with shared torque RPDOs and dummies for the others' slots.
    pub(crate) fn grouped() -> Vec<Member> {
        let drives = [("shoulder", 1_u8), ("elbow", 2), ("wrist", 3)];
        let member = |(slot, (name, id)): (usize, (&str, u8))| {
            let mut targets = [(DUMMY, 16); 3];
            targets[slot].0 = Object::TARGET_TORQUE;
            let id16 = u16::from(id);
            let sync = TransmissionType::EVERY_SYNC;
            let event = TransmissionType::EVENT_OF_PROFILE;
            let position = [(Object::POSITION_ACTUAL, 32)];
            let state = [(Object::STATUSWORD, 16), (Object::TORQUE_ACTUAL, 16)];
            let pdos = vec![
                pdo(Direction::Receive, 1, 0x201, sync, &targets),
                pdo(Direction::Receive, 2, 0x300 + id16, event, &[(Object::CONTROLWORD, 16)]),
                pdo(Direction::Transmit, 1, 0x180 + id16, sync, &position),
                pdo(Direction::Transmit, 2, 0x280 + id16, event, &state),
            ];
            drive(name, id, pdos)
        };
        drives.into_iter().enumerate().map(member).chain([switch_box()]).collect()
    }

    fn shown(frame: &PdoFrame) -> String {
        let signals = frame
            .signals
            .iter()
            .map(|signal| format!("{}@{}|{}", signal.name, signal.start, signal.bits));
        format!("{:03X} {} {}", frame.cob_id, frame.name, signals.collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn frame_of_one_drive_has_its_objects() {
        let frames = frames(&per_drive());
        assert_eq!(
            frames.iter().map(shown).take(5).collect::<Vec<_>>(),
            [
                "181 TPDO1_shoulder shoulder_statusword@0|16 shoulder_position@16|32 \
                 shoulder_torque@48|16",
                "182 TPDO1_elbow elbow_statusword@0|16 elbow_position@16|32 elbow_torque@48|16",
                "183 TPDO1_wrist wrist_statusword@0|16 wrist_position@16|32 wrist_torque@48|16",
                "190 TPDO1_switch_box switch_box_digital_inputs@0|8",
                "201 RPDO1_shoulder shoulder_controlword@0|16 shoulder_target_torque@16|16",
            ]
        );
        assert_eq!((frames[0].bytes, frames[4].bytes), (8, 4));
    }

    #[test]
    fn shared_frame_is_the_union_of_its_mappings() {
        let frames = frames(&grouped());
        let torques = frames.iter().find(|frame| frame.cob_id == 0x201).unwrap();
        assert_eq!(
            shown(torques),
            "201 RPDO1_group1 shoulder_target_torque@0|16 elbow_target_torque@16|16 \
             wrist_target_torque@32|16"
        );
        assert_eq!((torques.bytes, torques.receivers.len(), torques.senders.len()), (6, 3, 0));
        assert!(torques.is_shared() && torques.signals.iter().all(|signal| !signal.is_disputed));
    }

    #[test]
    fn bits_mapped_by_two_nodes_are_named_twice() {
        let mut members = grouped();
        let wrong = members[0].plan.pdos[0].clone();
        members[1].plan.pdos[0] = wrong;
        let frames = frames(&members);
        let torques = frames.iter().find(|frame| frame.cob_id == 0x201).unwrap();
        let disputed: Vec<_> = torques.signals.iter().filter(|signal| signal.is_disputed).collect();
        assert_eq!(disputed.len(), 1);
        assert_eq!((disputed[0].name.as_str(), disputed[0].start), ("elbow_target_torque", 0));
    }

    #[test]
    fn wrapped_count_is_near_zero() {
        let measure = Measure { zero: i32::MAX, ..position() };
        assert_eq!(measure.value(i64::from(i32::MIN)).to_string(), "0.001");
    }

    proptest! {
        #[test]
        fn signal_is_read_at_its_bits(
            start in 0_u8..64,
            bits in 1_u8..=64,
            value in any::<i64>(),
            noise in any::<u64>(),
            is_signed in any::<bool>(),
        ) {
            let bits = bits.min(64 - start);
            let mask = u64::MAX >> (64 - bits);
            let data = noise & !(mask << start) | (value.cast_unsigned() & mask) << start;
            let signal = Signal {
                name: String::new(),
                member: 0,
                object: Object::TARGET_TORQUE,
                start,
                bits,
                is_signed,
                measure: None,
                is_disputed: false,
            };
            let raw = signal.raw(data.to_le_bytes());
            prop_assert_eq!(raw.cast_unsigned() & mask, value.cast_unsigned() & mask);
            prop_assert!(bits == 64 || is_signed || raw >= 0);
        }
    }
}
