//! Drives that may push although their target torques are zero.
//!
//! A drive without an RPDO timer that has lost its RPDOs holds its last target. Its torque actual value (6077h) shows it. A
//! drive with that timer has ended such a torque within its time.

use derive_more::Display;

use units::drive::PerMille;

/// Maximum torque actual value (6077h) of a drive that does not push, in ‰ of rated torque.
const MAX_ZERO_TORQUE: u16 = 20;

/// Push of a drive at zero target torque, displayed by its evidence.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Push {
    /// Excluded by an RPDO timer, by a power stage that is off, or by the torque actual value.
    #[display("none")]
    Excluded,
    /// Possible: no torque actual value was received since zero target torque acts.
    #[display("6077h was not received")]
    Unknown,
    /// Possible: the newest torque actual value is larger than 20 ‰.
    #[display("6077h shows {} ‰", _0.0)]
    Shown(PerMille),
}

impl Push {
    /// Returns the push of a drive without an RPDO timer, by its newest torque actual value.
    pub(crate) fn from_torque(torque: Option<PerMille>) -> Self {
        match torque {
            None => Self::Unknown,
            Some(PerMille(torque)) if torque.unsigned_abs() <= MAX_ZERO_TORQUE => Self::Excluded,
            Some(torque) => Self::Shown(torque),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn push_is_excluded_by_a_torque_of_20_per_mille_at_most() {
        let push = |torque| Push::from_torque(Some(PerMille(torque)));
        assert_eq!([push(20), push(-20), push(0)], [Push::Excluded; 3]);
        for torque in [21, -21, -225, i16::MIN, i16::MAX] {
            assert_eq!(push(torque), Push::Shown(PerMille(torque)));
        }
        assert_eq!(push(-225).to_string(), "6077h shows -225 ‰");
        assert_eq!(Push::from_torque(None).to_string(), "6077h was not received");
    }
}
