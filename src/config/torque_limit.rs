//! `[joint.torque_limit]`: torque limit of a drive in place of 6072h. Either the boot writes it to an object, or the
//! maker's tool has stored it in the drive, where the master cannot read it.

use derive_more::Display;

use crate::drive_object::{self, ObjectWrite};
use crate::problem::Problems;
use crate::raw;
use crate::value::Optional;
use canopen::eds::Eds;
use canopen::object::Object;
use canopen::setting::can_limit_torque;

/// Torque limit of a drive in place of 6072h.
#[derive(Clone, Debug, PartialEq)]
pub enum TorqueLimit {
    /// Objects with values, which every boot writes and reads back.
    Objects(Vec<ObjectWrite>),
    /// Limit stored by the maker's tool, which the master cannot read.
    Stated(StatedLimit),
}

/// Torque limit stored in a drive by the maker's tool.
#[derive(Clone, Copy, Debug, Display, PartialEq)]
pub enum StatedLimit {
    /// Torque, in ‰ of rated torque.
    #[display("{_0} ‰ of rated torque")]
    PerMille(f64),
    /// Motor current, in mA.
    #[display("{_0} mA")]
    Milliamperes(f64),
}

impl TorqueLimit {
    /// Returns the SDO downloads that set the limit; empty for a limit of the maker's tool.
    pub fn writes(&self) -> &[ObjectWrite] {
        match self {
            Self::Objects(writes) => writes,
            Self::Stated(_) => &[],
        }
    }

    /// Returns the limit that only the configuration states.
    pub const fn stated(&self) -> Option<StatedLimit> {
        match *self {
            Self::Objects(_) => None,
            Self::Stated(limit) => Some(limit),
        }
    }
}

/// Range of a limit, in ‰ of rated torque.
const PER_MILLE: std::ops::RangeInclusive<f64> = 1.0..=10_000.0;

/// Range of a limit, in mA.
const MILLIAMPERES: std::ops::RangeInclusive<f64> = 1.0..=1e6;

/// Reads the limit of one drive. Returns `None` after a problem.
pub(super) fn read(
    raw: &raw::TorqueLimit,
    eds: Option<&Eds>,
    problems: &mut Problems<'_>,
) -> Option<TorqueLimit> {
    let raw::TorqueLimit { object, value, makers_tool_per_mille, makers_tool_ma, .. } = raw;
    let is_given = [
        !object.is_absent() || !value.is_absent(),
        !makers_tool_per_mille.is_absent(),
        !makers_tool_ma.is_absent(),
    ];
    if is_given.iter().filter(|given| **given).count() != 1 {
        let reason = "must have one of: object with value; makers_tool_per_mille; makers_tool_ma";
        problems.add(raw, reason);
        return None;
    }
    if is_given.first() == Some(&true) {
        return objects(object, value, eds, problems).map(TorqueLimit::Objects);
    }
    let per_mille = problems.within(makers_tool_per_mille, PER_MILLE).map(StatedLimit::PerMille);
    let current = problems.within(makers_tool_ma, MILLIAMPERES).map(StatedLimit::Milliamperes);
    if eds.is_some_and(has_maximum) {
        let reason =
            "must be absent, as 6072h is in the EDS and limits the torque: remove the section";
        problems.add(raw, reason);
    }
    per_mille.or(current).map(TorqueLimit::Stated)
}

/// Reads an object and its value. 60E0h and 60E1h limit one direction each, so the value is set in both.
fn objects(
    object: &Optional<String>,
    value: &Optional<i64>,
    eds: Option<&Eds>,
    problems: &mut Problems<'_>,
) -> Option<Vec<ObjectWrite>> {
    if object.is_absent() {
        problems.add(value, "needs an object beside it");
        return None;
    }
    if value.is_absent() {
        problems.add(object, "needs a value beside it");
        return None;
    }
    let (named, content) = drive_object::read(object, value, eds, problems)?;
    if !can_limit_torque(named) {
        let reason = format!(
            "{named} limits no torque; name 6072h, 6073h, 60E0h, 60E1h or an object of the maker (2000h to 5FFFh) that does"
        );
        problems.add(object, reason);
        return None;
    }
    problems.within(value, 1..=i64::MAX)?;
    let other = match named {
        Object::POSITIVE_TORQUE_LIMIT => Object::NEGATIVE_TORQUE_LIMIT,
        Object::NEGATIVE_TORQUE_LIMIT => Object::POSITIVE_TORQUE_LIMIT,
        _ => return Some(vec![(named, content)]),
    };
    if !eds.is_some_and(|eds| is_writable(eds, other)) {
        let reason =
            format!("{named} limits one direction alone: {other} must be writable in the EDS, too");
        problems.add(object, reason);
    }
    Some(vec![(named, content), (other, content)])
}

fn has_maximum(eds: &Eds) -> bool {
    is_writable(eds, Object::MAX_TORQUE)
}

fn is_writable(eds: &Eds, object: Object) -> bool {
    eds.object(object).is_some_and(|described| described.access.is_writable())
}
