//! What a device's data sheet permits of its layout.
//!
//! Torques of several drives in one frame need three things of each drive (CiA 301, 7.4.8): an RPDO
//! whose COB-ID may be written, room for the whole group in its mapping, and INTEGER16 as a dummy for
//! the others' slots, which is declared in `[DummyUsage]` (CiA 306).

use std::fmt;

use canopen_rs::NodeId;

use crate::canopen::eds::Eds;
use crate::canopen::layout::Group;
use crate::canopen::object::Object;

/// Why a drive cannot listen to a shared RPDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoGroup {
    /// No dummy for a torque.
    Dummy,
    /// A COB-ID that is what it is.
    CobId,
    /// A mapping too short.
    Mapping,
}

/// What stands in its data sheet.
impl fmt::Display for NoGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Dummy => {
                write!(f, "its EDS has no dummy mapping for {}", Object::DUMMY_INTEGER16)
            }
            Self::CobId => write!(f, "{} cannot be written", Object::rpdo_communication(1, 1)),
            Self::Mapping => {
                write!(f, "{} takes fewer than {} entries", Object::rpdo_mapping(1, 0), Group::SIZE)
            }
        }
    }
}

/// What a device's data sheet permits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Abilities {
    /// Everything that keeps it out of a group; empty where it may be in one.
    pub no_group: Vec<NoGroup>,
    /// Whether its emergencies may be moved (1014h).
    pub moves_emergencies: bool,
}

impl Abilities {
    /// As `eds` says, for a device with node-id `node`.
    pub fn of(eds: &Eds, node: NodeId) -> Self {
        let is_writable = |object| eds.object(object).is_some_and(|it| it.access.is_writable());
        let mut no_group = Vec::new();
        if !eds.dummy(Object::DUMMY_INTEGER16.index) {
            no_group.push(NoGroup::Dummy);
        }
        if !is_writable(Object::rpdo_communication(1, 1)) {
            no_group.push(NoGroup::CobId);
        }
        if usize::try_from(entries(eds, node)).unwrap_or(0) < Group::SIZE {
            no_group.push(NoGroup::Mapping);
        }
        Self { no_group, moves_emergencies: is_writable(Object::EMCY_COB_ID) }
    }
}

/// How many objects RPDO1 can map: the high limit of 1600h, else as many as it describes.
fn entries(eds: &Eds, node: NodeId) -> i64 {
    let count = eds.object(Object::rpdo_mapping(1, 0));
    let Some(count) = count else { return 0 };
    let described = || (1..=64).filter(|sub| eds.object(Object::rpdo_mapping(1, *sub)).is_some());
    if !count.access.is_writable() {
        return count.number.map_or(0, |number| number.resolve(node));
    }
    count.high.unwrap_or_else(|| i64::try_from(described().count()).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::load::streams::tests::node;

    const DRIVE: &str = include_str!("../../../eds/frhc_drive.eds");

    fn with(from: &str, to: &str) -> Abilities {
        assert!(DRIVE.contains(from));
        Abilities::of(&Eds::parse(DRIVE.replace(from, to).as_bytes()).unwrap(), node(1))
    }

    #[test]
    fn the_shipped_drive_may_share_and_move() {
        let all = Abilities { no_group: Vec::new(), moves_emergencies: true };
        assert_eq!(with("", ""), all);
    }

    #[test]
    fn each_thing_missing_keeps_a_drive_out_of_a_group() {
        assert_eq!(with("Dummy0003=1", "Dummy0003=0").no_group, [NoGroup::Dummy]);
        let cob_id =
            "ParameterName=COB-ID used by RPDO\nObjectType=0x7\nDataType=0x0007\nAccessType=";
        let fixed = with(&format!("{cob_id}rw"), &format!("{cob_id}ro"));
        assert_eq!(fixed.no_group, [NoGroup::CobId]);
        assert_eq!(with("HighLimit=8", "HighLimit=2").no_group, [NoGroup::Mapping]);
        let emcy = "ParameterName=COB-ID EMCY\nObjectType=0x7\nDataType=0x0007\nAccessType=";
        assert!(!with(&format!("{emcy}rw"), &format!("{emcy}ro")).moves_emergencies);
    }

    #[test]
    fn what_is_missing_is_said() {
        let all = [NoGroup::Dummy, NoGroup::CobId, NoGroup::Mapping].map(|why| why.to_string());
        let expected = [
            "its EDS has no dummy mapping for 0003h",
            "1400h:1 cannot be written",
            "1600h takes fewer than 3 entries",
        ];
        assert_eq!(all, expected);
    }
}
