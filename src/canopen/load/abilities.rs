//! Changes of a network that a drive's EDS permits.

use canopen_rs::NodeId;

use crate::eds::Eds;
use crate::layout::{self, Group};
use crate::load::lacks::{self, Lack};
use crate::object::Object;

/// Changes that a device's EDS permits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Abilities {
    /// Parts of the grouped layout that the device lacks; empty if it can share an RPDO.
    pub no_group: Vec<Lack>,
    /// Set if the EMCY COB-ID (1014h) is writable.
    pub moves_emergencies: bool,
}

impl Abilities {
    /// Derives the abilities of `node` from its EDS.
    pub fn from_eds(eds: &Eds, node: NodeId) -> Self {
        let size = u8::try_from(Group::SIZE).unwrap_or(u8::MAX);
        // The last slot has dummies before it, and every drive of a group the same number of entries.
        let group = Group { cob_id: layout::rpdo1(node), size, slot: size.saturating_sub(1) };
        let no_group = lacks::lacks(eds, node, &layout::grouped(node, 0, group, None));
        let emcy = eds.object(Object::EMCY_COB_ID);
        Self { no_group, moves_emergencies: emcy.is_some_and(|emcy| emcy.access.is_writable()) }
    }

    /// Returns whether the device can have the PDOs of the grouped layout with a separate RPDO, which needs no
    /// dummies.
    pub fn can_split_states(&self) -> bool {
        self.no_group.iter().all(|lack| matches!(lack, Lack::Dummy(_) | Lack::Entries { .. }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVE: &str = include_str!("../../../eds/frhc_drive.eds");

    fn with(from: &str, to: &str) -> Abilities {
        assert!(DRIVE.contains(from));
        let eds = Eds::parse(DRIVE.replace(from, to).as_bytes()).unwrap();
        Abilities::from_eds(&eds, NodeId::new(3).unwrap())
    }

    #[test]
    fn shipped_drive_permits_every_change() {
        let all = Abilities { no_group: Vec::new(), moves_emergencies: true };
        assert_eq!(with("", ""), all);
        assert!(all.can_split_states());
    }

    #[test]
    fn drive_without_dummies_can_split_states() {
        let abilities = with("Dummy0003=1", "Dummy0003=0");
        assert_eq!(abilities.no_group, [Lack::Dummy(Object::DUMMY_INTEGER16)]);
        assert!(abilities.can_split_states());
    }

    #[test]
    fn drive_with_two_tpdos_can_do_neither() {
        let abilities = with("[1802", "[2802");
        assert_eq!(lacks::listed(&abilities.no_group), "TPDO3 (1802h)");
        assert!(!abilities.can_split_states());
    }

    #[test]
    fn emergencies_stay_where_their_cob_id_is_read_only() {
        let emcy = "ParameterName=COB-ID EMCY\nObjectType=0x7\nDataType=0x0007\nAccessType=";
        assert!(!with(&format!("{emcy}rw"), &format!("{emcy}ro")).moves_emergencies);
    }
}
