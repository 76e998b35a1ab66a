//! Configurable properties of a device's PDOs by its EDS, for bus planning.

use crate::eds::Eds;
use crate::layout::Direction;
use crate::object::Object;

/// Configurable properties of one PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PdoAbility {
    /// Set if the COB-ID is writable (1400h:1 or 1800h:1), so that the PDO can be shared.
    pub can_move: bool,
    /// Set if the mapping is writable.
    pub can_map: bool,
    /// Maximum number of mapped objects.
    pub max_entries: u8,
    /// Set if the transmission type is writable.
    pub has_transmission: bool,
    /// Set if the inhibit time is writable.
    pub has_inhibit_time: bool,
    /// Set if the event timer is writable; that of an RPDO is a timeout.
    pub has_event_timer: bool,
}

impl Eds {
    /// Properties of PDO `number` (1 to 512) of `direction`; `None` if it does not exist.
    pub fn pdo(&self, direction: Direction, number: u16) -> Option<PdoAbility> {
        if !(1..=512).contains(&number) {
            return None;
        }
        let (communication, mapping) = match direction {
            Direction::Receive => {
                (Object::rpdo_communication(number, 1), Object::rpdo_mapping(number, 0))
            }
            Direction::Transmit => {
                (Object::tpdo_communication(number, 1), Object::tpdo_mapping(number, 0))
            }
        };
        let cob_id = self.object(communication)?;
        let is_writable = |object| self.object(object).is_some_and(|one| one.access.is_writable());
        let of = |sub| is_writable(Object { sub, ..communication });
        Some(PdoAbility {
            can_move: cob_id.access.is_writable(),
            can_map: is_writable(mapping) && is_writable(Object { sub: 1, ..mapping }),
            max_entries: self.entries(mapping),
            has_transmission: of(2),
            has_inhibit_time: of(3),
            has_event_timer: of(5),
        })
    }

    /// Maximum number of mapping entries: those described, limited by the range of sub-index 0.
    fn entries(&self, mapping: Object) -> u8 {
        let described =
            (1..=64).filter(|sub| self.object(Object { sub: *sub, ..mapping }).is_some());
        let described = u8::try_from(described.count()).unwrap_or(u8::MAX);
        let high = self.object(mapping).and_then(|count| count.high).map(|high| high.value);
        high.and_then(|high| u8::try_from(high).ok()).map_or(described, |high| high.min(described))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writable_properties_are_derived() {
        let text = b"[1400sub1]\nDataType=7\nAccessType=ro\n[1600sub0]\nDataType=5\nAccessType=rw\n\
            HighLimit=2\n[1600sub1]\nDataType=7\nAccessType=rw\n[1600sub2]\nDataType=7\n[1600sub3]\nDataType=7\n";
        let eds = Eds::parse(text).unwrap();
        let simple = PdoAbility {
            can_move: false,
            can_map: true,
            max_entries: 2,
            has_transmission: false,
            has_inhibit_time: false,
            has_event_timer: false,
        };
        assert_eq!(eds.pdo(Direction::Receive, 1), Some(simple));
        assert_eq!(eds.pdo(Direction::Receive, 2), None);
        assert_eq!(eds.pdo(Direction::Receive, 0), None);
        assert_eq!(eds.pdo(Direction::Transmit, 1), None);
    }

    #[test]
    fn shipped_drive_can_share_an_rpdo() {
        let eds = Eds::parse(include_bytes!("../../../eds/frhc_drive.eds")).unwrap();
        let rpdo = eds.pdo(Direction::Receive, 1).unwrap();
        assert!(rpdo.can_move && rpdo.can_map && rpdo.has_event_timer && rpdo.max_entries >= 3);
    }
}
