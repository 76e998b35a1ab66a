//! What a device's data sheet permits of its layout.
//!
//! Torques of several drives in one frame need three things of each drive (CiA 301, 7.4.8): an RPDO
//! whose COB-ID may be written, room for the whole group in its mapping, and INTEGER16 as a dummy for
//! the others' slots, which is declared in `[DummyUsage]` (CiA 306).

use std::fmt;

use crate::eds::Eds;
use crate::layout::Direction;
use crate::layout::Group;
use crate::object::Object;

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
    /// As `eds` says.
    pub fn of(eds: &Eds) -> Self {
        let rpdo = eds.pdo(Direction::Receive, 1);
        let mut no_group = Vec::new();
        if !eds.dummy(Object::DUMMY_INTEGER16.index) {
            no_group.push(NoGroup::Dummy);
        }
        if !rpdo.is_some_and(|rpdo| rpdo.can_move) {
            no_group.push(NoGroup::CobId);
        }
        if rpdo.is_none_or(|rpdo| usize::from(rpdo.most_entries) < Group::SIZE) {
            no_group.push(NoGroup::Mapping);
        }
        let emcy = eds.object(Object::EMCY_COB_ID);
        Self { no_group, moves_emergencies: emcy.is_some_and(|emcy| emcy.access.is_writable()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVE: &str = include_str!("../../../eds/frhc_drive.eds");

    fn with(from: &str, to: &str) -> Abilities {
        assert!(DRIVE.contains(from));
        Abilities::of(&Eds::parse(DRIVE.replace(from, to).as_bytes()).unwrap())
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
