//! `joint.boot.mode_shown`: drives that display their mode (6061h) only while they are enabled.
//!
//! Before it is enabled, the node cannot verify that such a drive is in torque mode. In another mode it might move to an
//! old position. Its boot therefore ends with a torque limit of at most 5 %, with which the node enables it and reads the
//! mode.

use std::time::Duration;

use crate::drive_object::ObjectWrite;
use crate::problem::Problems;
use crate::raw;
use crate::section::Sections;
use crate::torque_limit::TorqueLimit;
use crate::value::HasPlace;
use canopen::eds::Eds;
use canopen::object::Object;
use canopen::plan::mapped;

/// Maximum reduced limit, in per mille of rated torque or current.
const MAX_REDUCED: i64 = 50;

/// Divisor of a limit in a manufacturer-specific object, whose unit is unknown.
const MAKERS_DIVISOR: i64 = 20;

/// Maximum period with which a drive is enabled, checked and disabled within 10 ms.
const MAX_PERIOD: Duration = Duration::from_millis(4);

/// Objects that move a drive in a mode other than torque.
const SET_POINTS: [Object; 2] = [Object::TARGET_POSITION, Object::TARGET_VELOCITY];

/// Properties of a drive that decide whether its mode can be checked safely.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive<'a> {
    /// Torque limit in place of 6072h.
    pub(super) limit: Option<&'a TorqueLimit>,
    /// EDS of the drive; `None` if it could not be read.
    pub(super) eds: Option<&'a Eds>,
    /// Communication cycle period (1006h).
    pub(super) period: Option<Duration>,
}

/// Returns whether the drive displays its mode only while it is enabled. Refuses settings that make the check unsafe.
pub(super) fn read(raw: &raw::Boot, drive: Drive<'_>, problems: &mut Problems<'_>) -> bool {
    let times = [("always", false), ("enabled", true)];
    let is_when_enabled =
        problems.one_of(&raw.mode_shown.or("always".to_owned()), &times).unwrap_or_default();
    if !is_when_enabled {
        return false;
    }
    if !has_reducible_limit(drive.limit, drive.eds) {
        let reason = "\"enabled\" needs a torque limit that the boot can reduce to 5 %: 6072h in the EDS, or an object of \
                      [joint.torque_limit]";
        problems.add(&raw.mode_shown, reason);
    }
    if drive.period.is_some_and(|period| period > MAX_PERIOD) {
        let reason = format!(
            "\"enabled\" needs a cycle of at most {} ms: the drive must be disabled within 10 ms",
            MAX_PERIOD.as_millis()
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

/// Returns whether a torque limit of the drive can be reduced to 5 %; true if its data sheet could not be read.
pub(super) fn has_reducible_limit(limit: Option<&TorqueLimit>, eds: Option<&Eds>) -> bool {
    match limit {
        Some(TorqueLimit::Objects(limits)) => reduced(limits).is_some(),
        Some(TorqueLimit::Stated(_)) => false,
        None => eds.is_none_or(|eds| eds.object(Object::MAX_TORQUE).is_some()),
    }
}

/// Returns reduced values of torque limits: at most 5 % of rated torque, or of a manufacturer-specific limit. Returns
/// `None` if a reduced value would be below one.
pub(super) fn reduced(limits: &[ObjectWrite]) -> Option<Vec<ObjectWrite>> {
    let low = |object: Object, full: i64| {
        let low = if object.is_of_maker() { full / MAKERS_DIVISOR } else { full.min(MAX_REDUCED) };
        (low > 0).then_some(low)
    };
    let one = |(object, content): &ObjectWrite| {
        Some((*object, mapped(content, |full| low(*object, full))?))
    };
    limits.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive_object::Content;

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
