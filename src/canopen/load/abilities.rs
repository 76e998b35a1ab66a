//! Changes of the layout that a drive's EDS permits.
//!
//! A shared RPDO needs three abilities of each drive (CiA 301, 7.4.8): a writable COB-ID, a mapping with room
//! for the whole group, and INTEGER16 dummies for the slots of other drives, declared in `[DummyUsage]`
//! (CiA 306).

use std::fmt;

use crate::eds::Eds;
use crate::layout::{Direction, Group};
use crate::object::Object;

/// Reason why a drive cannot take a shared RPDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoGroup {
    /// No INTEGER16 dummy.
    Dummy,
    /// The COB-ID is not writable.
    CobId,
    /// The mapping is too short.
    Mapping,
}

/// Text of the reason.
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

/// Changes that a device's EDS permits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Abilities {
    /// Reasons against a shared RPDO; empty if it is possible.
    pub no_group: Vec<NoGroup>,
    /// Set if the EMCY COB-ID (1014h) is writable.
    pub moves_emergencies: bool,
}

impl Abilities {
    /// Derives the abilities from an EDS.
    pub fn of(eds: &Eds) -> Self {
        let rpdo = eds.pdo(Direction::Receive, 1);
        let mut no_group = Vec::new();
        if !eds.dummy(Object::DUMMY_INTEGER16.index) {
            no_group.push(NoGroup::Dummy);
        }
        if !rpdo.is_some_and(|rpdo| rpdo.can_move) {
            no_group.push(NoGroup::CobId);
        }
        if rpdo.is_none_or(|rpdo| usize::from(rpdo.max_entries) < Group::SIZE) {
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
    fn shipped_drive_permits_every_change() {
        let all = Abilities { no_group: Vec::new(), moves_emergencies: true };
        assert_eq!(with("", ""), all);
    }

    #[test]
    fn each_missing_ability_prevents_grouping() {
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
    fn missing_abilities_are_named() {
        let all = [NoGroup::Dummy, NoGroup::CobId, NoGroup::Mapping].map(|why| why.to_string());
        let expected = [
            "its EDS has no dummy mapping for 0003h",
            "1400h:1 cannot be written",
            "1600h takes fewer than 3 entries",
        ];
        assert_eq!(all, expected);
    }
}
