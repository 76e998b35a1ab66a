//! `joint.boot.mode_shown`: drives that display their mode (6061h) only while they are enabled.
//!
//! Until then nothing shows that such a drive obeys torques and not, say, its last position. Its boot therefore ends with
//! a torque limit of at most 5 %, under which the node enables it and looks.

use std::time::Duration;

use crate::drive_object::{Content, Written};
use crate::problem::Problems;
use crate::raw;
use crate::section::Sections;
use crate::torque_limit::TorqueLimit;
use crate::value::Placed;
use canopen::eds::Eds;
use canopen::object::Object;

/// Largest reduced limit, in per mille of rated torque or current.
const MOST: i64 = 50;

/// Share of a limit of the maker's, whose unit is not known.
const SHARE_OF_MAKERS_LIMIT: i64 = 20;

/// Longest cycle in which a drive can be enabled, seen and disabled within 10 ms.
const LONGEST_PERIOD: Duration = Duration::from_millis(4);

/// Objects that set a drive in motion in a mode other than torque.
const SET_POINTS: [Object; 2] = [Object::TARGET_POSITION, Object::TARGET_VELOCITY];

/// Properties of a drive that decide whether it may be checked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive<'a> {
    /// Limit of its torque in place of 6072h.
    pub(super) limit: Option<&'a TorqueLimit>,
    /// Its data sheet.
    pub(super) eds: Option<&'a Eds>,
    /// Period of SYNC.
    pub(super) period: Option<Duration>,
}

/// Returns whether the drive displays its mode only while it is enabled. Notes what would make looking dangerous.
pub(super) fn read(raw: &raw::Boot, drive: Drive<'_>, problems: &mut Problems<'_>) -> bool {
    let times = [("always", false), ("enabled", true)];
    let is_when_enabled =
        problems.one_of(&raw.mode_shown.or("always".to_owned()), &times).unwrap_or_default();
    if !is_when_enabled {
        return false;
    }
    let is_limited = match drive.limit {
        Some(TorqueLimit::Objects(limits)) => reduced(limits).is_some(),
        Some(TorqueLimit::Stated(_)) => false,
        None => drive.eds.is_none_or(|eds| eds.object(Object::MAX_TORQUE).is_some()),
    };
    if !is_limited {
        let reason = "\"enabled\" needs a torque limit that the boot can reduce to 5 %: 6072h in the EDS, or an object of \
                      [joint.torque_limit]";
        problems.add(&raw.mode_shown, reason);
    }
    if drive.period.is_some_and(|period| period > LONGEST_PERIOD) {
        let reason = format!(
            "\"enabled\" needs a cycle of at most {} ms: the drive must be disabled within 10 ms",
            LONGEST_PERIOD.as_millis()
        );
        problems.add(&raw.mode_shown, reason);
    }
    for write in raw.write.as_ref().map(Sections::all).unwrap_or_default() {
        let named = write.object.as_ref().and_then(|text| text.parse::<Object>().ok());
        if let Some(object) = named.filter(|object| SET_POINTS.contains(object)) {
            let reason = format!(
                "{object} moves a drive that is not in torque mode, which {} = \"enabled\" finds only by enabling it",
                raw.mode_shown.place().key()
            );
            problems.add(&write.object, reason);
        }
    }
    true
}

/// Returns reduced values of torque limits: at most 5 % of rated torque, or of the limit in the maker's own unit; `None`
/// where that is less than one.
pub(super) fn reduced(limits: &[Written]) -> Option<Vec<Written>> {
    let low = |object: Object, full: i64| {
        let low = if object.is_of_maker() { full / SHARE_OF_MAKERS_LIMIT } else { full.min(MOST) };
        (low > 0).then_some(low)
    };
    let one =
        |(object, content): &Written| Some((*object, lowered(content, |full| low(*object, full))?));
    limits.iter().map(one).collect()
}

/// Returns the value that `low` gives for an integer content, in the same type.
fn lowered(content: &Content, low: impl Fn(i64) -> Option<i64>) -> Option<Content> {
    Some(match *content {
        Content::Integer8(full) => Content::Integer8(low(full.into())?.try_into().ok()?),
        Content::Integer16(full) => Content::Integer16(low(full.into())?.try_into().ok()?),
        Content::Integer32(full) => Content::Integer32(low(full.into())?.try_into().ok()?),
        Content::Integer64(full) => Content::Integer64(low(full)?),
        Content::Unsigned8(full) => Content::Unsigned8(low(full.into())?.try_into().ok()?),
        Content::Unsigned16(full) => Content::Unsigned16(low(full.into())?.try_into().ok()?),
        Content::Unsigned32(full) => Content::Unsigned32(low(full.into())?.try_into().ok()?),
        Content::Unsigned64(full) => {
            Content::Unsigned64(low(full.try_into().ok()?)?.try_into().ok()?)
        }
        Content::Boolean(_)
        | Content::Real32(_)
        | Content::Real64(_)
        | Content::VisibleString(_)
        | Content::OctetString(_)
        | Content::Domain(_)
        | _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reduced_limits_are_at_most_five_percent() {
        let makers = Object { index: 0x3001, sub: 2 };
        for (object, full, low) in [
            (Object::MAX_TORQUE, 1_200, Some(50)),
            (Object::MAX_TORQUE, 30, Some(30)),
            (Object::POSITIVE_TORQUE_LIMIT, 900, Some(50)),
            (makers, 3_000, Some(150)),
            (makers, 19, None),
        ] {
            let found = reduced(&[(object, Content::Unsigned32(full))]);
            let expected = low.map(|low| vec![(object, Content::Unsigned32(low))]);
            assert_eq!(found, expected, "{object} {full}");
        }
        assert_eq!(reduced(&[(makers, Content::Real32(1e3))]), None);
    }
}
