//! Parts of a PDO layout that a device cannot have, by its EDS.
//!
//! A layout needs PDOs, writable communication and mapping parameters, entries enough for its objects, and objects
//! that can be mapped (CiA 301, 7.5.2.35 to 7.5.2.38). A shared RPDO also needs a data type as a dummy for the
//! slots of other drives (7.4.8), declared in `[DummyUsage]` (CiA 306).

use crate::NodeId;
use crate::eds::{Eds, EdsObject, OutsideLimits};
use crate::layout::{Direction, Pdo, Service};
use crate::object::Object;
use crate::sdo::bytes;

/// Missing part of a layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lack {
    /// Data type that may not be a dummy in RPDOs.
    Dummy(Object),
    /// Absent PDO, by its communication parameter.
    Pdo {
        /// TPDO or RPDO of the device.
        direction: Direction,
        /// Number, from 1.
        number: u16,
    },
    /// Absent or read-only parameter.
    Writable(Object),
    /// Mapping parameter with fewer entries.
    Entries {
        /// Number of mapped objects.
        mapping: Object,
        /// Entries of the layout.
        needed: usize,
    },
    /// Value outside the limits of its parameter.
    Value(OutsideLimits),
    /// Object that cannot be mapped into PDOs of a direction.
    Mapped(Object, Direction),
}

impl Lack {
    /// Words before and after the name, which parts of one kind share.
    fn words(&self) -> (&'static str, String) {
        match self {
            Self::Dummy(_) => ("dummy mapping of ", String::new()),
            Self::Pdo { .. } | Self::Value(_) => ("", String::new()),
            Self::Writable(_) => ("writable ", String::new()),
            Self::Entries { mapping, .. } => ("", format!(" entries in {mapping}")),
            Self::Mapped(_, direction) => ("", format!(" in {}s", kind(*direction))),
        }
    }

    fn name(&self) -> String {
        match self {
            Self::Dummy(object) | Self::Writable(object) | Self::Mapped(object, _) => {
                object.to_string()
            }
            Self::Pdo { direction, number } => {
                let Object { index, .. } = communication(*direction, *number);
                format!("{}{number} ({index:04X}h)", kind(*direction))
            }
            Self::Entries { needed, .. } => needed.to_string(),
            Self::Value(OutsideLimits { object, value, low, high }) => {
                format!("{object} = {value}, which it limits to {low}..={high}")
            }
        }
    }
}

/// Lists parts by their kind: `TPDO3 (1802h) and writable 1600h, 1A00h and 6071h in RPDOs`.
pub fn listed(lacks: &[Lack]) -> String {
    let mut kinds: Vec<((&str, String), Vec<String>)> = Vec::new();
    for lack in lacks {
        match kinds.iter_mut().find(|(words, _)| *words == lack.words()) {
            Some((_, names)) => names.push(lack.name()),
            None => kinds.push((lack.words(), vec![lack.name()])),
        }
    }
    let kinds = kinds.into_iter();
    let parts =
        kinds.map(|((before, after), names)| format!("{before}{}{after}", names.join(", ")));
    parts.collect::<Vec<_>>().join(" and ")
}

/// Returns whether an object is a PDO parameter, whose values [`lacks`] checks.
pub const fn is_parameter(object: Object) -> bool {
    matches!(object.index, 0x1400..=0x1BFF)
}

const fn kind(direction: Direction) -> &'static str {
    match direction {
        Direction::Receive => "RPDO",
        Direction::Transmit => "TPDO",
    }
}

const fn communication(direction: Direction, number: u16) -> Object {
    match direction {
        Direction::Receive => Object::rpdo_communication(number, 1),
        Direction::Transmit => Object::tpdo_communication(number, 1),
    }
}

/// Returns every part of the PDOs in use that `node` lacks by its EDS, each once.
pub fn lacks(eds: &Eds, node: NodeId, pdos: &[Pdo]) -> Vec<Lack> {
    let mut found: Vec<Lack> = Vec::new();
    let in_use = pdos.iter().filter_map(|pdo| Some((pdo, pdo.service.as_ref()?)));
    for (pdo, service) in in_use {
        let parts =
            parameters(eds, node, pdo, service).into_iter().chain(objects(eds, pdo, service));
        for lack in parts {
            if !found.contains(&lack) {
                found.push(lack);
            }
        }
    }
    found
}

/// Missing parameters of one PDO. An absent PDO counts as one part.
fn parameters(eds: &Eds, node: NodeId, pdo: &Pdo, service: &Service) -> Vec<Lack> {
    let Pdo { direction, number, .. } = *pdo;
    let Some(ability) = eds.pdo(direction, number) else {
        return vec![Lack::Pdo { direction, number }];
    };
    let mut missing = Vec::new();
    let (mapping, needed) = (pdo.mapping(0), service.mapping.len());
    if !ability.can_map {
        let is_needed = !is_mapped(eds, node, pdo, service);
        missing.extend(is_needed.then_some(Lack::Writable(mapping)));
    } else if usize::from(ability.max_entries) < needed {
        missing.push(Lack::Entries { mapping, needed });
    }
    let writes = pdo.writes().into_iter();
    let communication = writes.filter(|(object, _)| object.index == pdo.communication(0).index);
    missing.extend(communication.filter_map(|(object, value)| {
        let described = eds.object(object).filter(|described| described.access.is_writable());
        let Some(described) = described else { return Some(Lack::Writable(object)) };
        described.check_content(&bytes(&value), node).err().map(Lack::Value)
    }));
    missing
}

/// Returns whether the default mapping of a PDO is the one of its service.
fn is_mapped(eds: &Eds, node: NodeId, pdo: &Pdo, service: &Service) -> bool {
    let default = |object| Some(eds.object(object)?.number?.resolve(node));
    let mut entries = (1..).zip(&service.mapping);
    default(pdo.mapping(0)) == i128::try_from(service.mapping.len()).ok()
        && entries.all(|(sub, mapped)| default(pdo.mapping(sub)) == Some(mapped.entry().into()))
}

/// Objects and dummies that cannot be mapped.
fn objects(eds: &Eds, pdo: &Pdo, service: &Service) -> Vec<Lack> {
    let direction = pdo.direction;
    let is_able = |described: &EdsObject| {
        described.is_mappable
            && match direction {
                Direction::Receive => described.access.is_output(),
                Direction::Transmit => described.access.is_input(),
            }
    };
    let lack = |object: Object| {
        if object.is_dummy() {
            (!eds.dummy(object.index)).then_some(Lack::Dummy(object))
        } else {
            (!eds.object(object).is_some_and(is_able)).then_some(Lack::Mapped(object, direction))
        }
    };
    service.mapping.iter().filter_map(|mapped| lack(mapped.object)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{self, Group};

    const DRIVE: &str = include_str!("../../../eds/frhc_drive.eds");

    fn node() -> NodeId {
        NodeId::new(3).unwrap()
    }

    fn grouped() -> Vec<Pdo> {
        layout::grouped(node(), 0, Group { cob_id: 0x201, size: 3, slot: 2 }, None)
    }

    fn changed(from: &str, to: &str) -> Eds {
        assert!(DRIVE.contains(from), "{from}");
        Eds::parse(DRIVE.replace(from, to).as_bytes()).unwrap()
    }

    #[test]
    fn shipped_drive_lacks_nothing() {
        let eds = Eds::parse(DRIVE.as_bytes()).unwrap();
        assert_eq!(lacks(&eds, node(), &grouped()), []);
        assert_eq!(lacks(&eds, node(), &layout::per_drive(node(), Some(5))), []);
    }

    #[test]
    fn each_missing_part_is_named_once() {
        let of = |from: &str, to: &str| listed(&lacks(&changed(from, to), node(), &grouped()));
        assert_eq!(of("Dummy0003=1", "Dummy0003=0"), "dummy mapping of 0003h");
        assert_eq!(of("[1802", "[2802"), "TPDO3 (1802h)");
        let cob_id =
            "ParameterName=COB-ID used by RPDO\nObjectType=0x7\nDataType=0x0007\nAccessType=";
        assert_eq!(of(&format!("{cob_id}rw"), &format!("{cob_id}ro")), "writable 1400h:1, 1401h:1");
        assert_eq!(of("[1801sub3]", "[1801sub9]"), "writable 1801h:3");
        assert_eq!(of("HighLimit=8", "HighLimit=2"), "3 entries in 1600h");
        let timer = "[1801sub5]\nParameterName=Event timer\n";
        assert_eq!(
            of(timer, &format!("{timer}HighLimit=40\n")),
            "1801h:5 = 47, which it limits to 0..=40"
        );
        assert_eq!(of("[6064]", "[2064]"), "6064h in TPDOs");
        let both = changed("Dummy0003=1", "Dummy0003=0");
        let mut parts = lacks(&both, node(), &grouped());
        let mapping = |index| Object { index, sub: 0 };
        parts.extend([0x1600, 0x1A00].map(mapping).map(Lack::Writable));
        assert_eq!(listed(&parts), "dummy mapping of 0003h and writable 1600h, 1A00h");
    }

    #[test]
    fn read_only_mapping_as_planned_is_no_lack() {
        let fixed = |count: &str, entry: &str| {
            let text = format!(
                "[1A00]\nObjectType=0x9\nSubNumber=4\n\
                 [1A00sub0]\nObjectType=0x7\nDataType=0x0005\nAccessType=const\nDefaultValue={count}\n\
                 [1A00sub1]\nObjectType=0x7\nDataType=0x0007\nAccessType=const\nDefaultValue=0x60410010\n\
                 [1A00sub2]\nObjectType=0x7\nDataType=0x0007\nAccessType=const\nDefaultValue={entry}\n\
                 [1A00sub3]\nObjectType=0x7\nDataType=0x0007\nAccessType=const\nDefaultValue=0x60770010\n"
            );
            let (before, rest) = DRIVE.split_once("[1A00]").unwrap();
            let after = &rest[rest.find("[1A01]").unwrap()..];
            let eds = Eds::parse(format!("{before}{text}{after}").as_bytes()).unwrap();
            listed(&lacks(&eds, node(), &layout::per_drive(node(), None)))
        };
        assert_eq!(fixed("3", "0x60640020"), "");
        assert_eq!(fixed("3", "0x60630020"), "writable 1A00h");
        assert_eq!(fixed("2", "0x60640020"), "writable 1A00h");
    }

    #[test]
    fn unused_pdos_need_not_exist() {
        let eds = changed("[1803", "[2803");
        assert_eq!(lacks(&eds, node(), &grouped()), []);
    }
}
