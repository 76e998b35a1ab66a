//! Expectations of the campaign: one row for each hazard, written by hand from docs/safety.md.
//!
//! They judge the node's own fault table and are never taken from it. A test compares the two, and another compares
//! the limits with the page.

use std::fmt;
use std::time::Duration;

use EndState::{DrivesOff, ReflectionOff, ZeroTorque};
use Limit::{Cycles, DriveTimer, HeartbeatTime, Millis, RpdoTimer, Unstated};

use crate::timers;
use config::Config;
use node::cause::CauseKind;
use node::record::Mode;

/// Expectation of one hazard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expectation {
    /// Number of the hazard in docs/safety.md.
    pub hazard: u8,
    /// Time from the fault on the bus until the torque has ended.
    pub limit: Limit,
    /// Limit for a drive without an RPDO timer, if different.
    pub without_timer: Option<Limit>,
    /// Causes that the hazard raises, with the state that each leads to.
    pub reactions: &'static [(CauseKind, EndState)],
}

/// Limit of a hazard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// Number of cycles.
    Cycles(u32),
    /// Time, in ms.
    Millis(u64),
    /// Configured heartbeat time, `drive_lost_ms`.
    HeartbeatTime,
    /// Time until the slowest drive stops without its master, by its shortest timer, with tolerance.
    DriveTimer,
    /// RPDO timer of the drives plus 1 ms.
    RpdoTimer,
    /// Not stated in docs/safety.md.
    Unstated,
}

/// State of the drives after a reaction, mildest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum EndState {
    /// S1: enabled, with the weight of the arm alone.
    ReflectionOff,
    /// S2: zero torque, power stages off after 100 ms.
    ZeroTorque,
    /// S3: power stages off.
    DrivesOff,
}

/// Expectations of all hazards, in their order.
pub const EXPECTATIONS: &[Expectation] = &[
    row(1, Cycles(5), &[(CauseKind::SamplesMissing, ZeroTorque)]),
    row(2, HeartbeatTime, &[(CauseKind::HeartbeatLost, DrivesOff)]),
    row(
        3,
        Cycles(5),
        &[
            (CauseKind::SamplesMissing, ZeroTorque),
            (CauseKind::StatusMissing, ZeroTorque),
            (CauseKind::SamplesOverdue, ZeroTorque),
            (CauseKind::SamplesRare, ReflectionOff),
        ],
    ),
    row(
        4,
        Cycles(5),
        &[(CauseKind::SamplesMissing, ZeroTorque), (CauseKind::SamplesOverdue, ZeroTorque)],
    ),
    row(5, Millis(600), &[(CauseKind::PositionFrozen, ZeroTorque)]),
    row(6, Cycles(3), &[(CauseKind::Duplicate, ZeroTorque)]),
    row(7, Cycles(2), &[(CauseKind::Emergency, ZeroTorque)]),
    row(
        8,
        Cycles(2),
        &[(CauseKind::DriveLeft, ZeroTorque), (CauseKind::LeftOperational, ZeroTorque)],
    ),
    row(9, Cycles(2), &[(CauseKind::Rebooted, DrivesOff)]),
    row(10, Millis(55), &[(CauseKind::TorqueDiffers, ZeroTorque)]),
    row(
        11,
        Cycles(3),
        &[(CauseKind::Overspeed, ZeroTorque), (CauseKind::GripOverspeed, ZeroTorque)],
    ),
    row(12, Cycles(2), &[(CauseKind::PositionJumped, ZeroTorque)]),
    Expectation {
        without_timer: Some(Millis(120)),
        ..row(
            13,
            RpdoTimer,
            &[(CauseKind::Emergency, ZeroTorque), (CauseKind::TargetNotTaken, ZeroTorque)],
        )
    },
    row(16, Unstated, &[(CauseKind::EnableTimeout, ZeroTorque)]),
    row(21, Cycles(6), &[(CauseKind::QueueFull, ZeroTorque)]),
    row(22, DriveTimer, &[(CauseKind::TransmitUnconfirmed, DrivesOff)]),
    row(23, Unstated, &[(CauseKind::BusOff, DrivesOff), (CauseKind::BusPassive, ZeroTorque)]),
    row(24, Unstated, &[(CauseKind::BusDown, DrivesOff)]),
    row(25, Cycles(2), &[]),
    row(
        26,
        Cycles(2),
        &[(CauseKind::ForeignMaster, DrivesOff), (CauseKind::SettingChanged, DrivesOff)],
    ),
    row(27, DriveTimer, &[(CauseKind::AwaitsReset, DrivesOff)]),
    row(28, Unstated, &[(CauseKind::Overrun, ZeroTorque)]),
    row(29, Cycles(5), &[(CauseKind::Overrun, ZeroTorque), (CauseKind::Late, ZeroTorque)]),
    row(31, Unstated, &[(CauseKind::Suspended, DrivesOff)]),
    row(33, Unstated, &[]),
    row(34, Millis(70), &[(CauseKind::LinkLost, ReflectionOff)]),
    row(35, Millis(70), &[(CauseKind::LinkLost, ReflectionOff)]),
    row(37, Unstated, &[]),
    row(38, Millis(20), &[]),
    row(
        39,
        Millis(50),
        &[(CauseKind::DeadmanDisagrees, ZeroTorque), (CauseKind::TieDown, ReflectionOff)],
    ),
    row(40, Unstated, &[]),
    row(41, Unstated, &[(CauseKind::UncommandedMotion, ZeroTorque)]),
    row(42, Unstated, &[(CauseKind::ControllerFault, ZeroTorque)]),
    row(43, Cycles(1), &[(CauseKind::BeyondLimit, ReflectionOff)]),
    row(44, Unstated, &[(CauseKind::ControllerFault, ZeroTorque)]),
    row(45, Millis(400), &[(CauseKind::Unstable, ReflectionOff)]),
    row(46, Unstated, &[(CauseKind::NotOff, DrivesOff)]),
    row(47, Millis(70), &[(CauseKind::FarSideHolds, ReflectionOff)]),
    row(48, Millis(70), &[(CauseKind::LinkSlow, ReflectionOff)]),
    row(49, Unstated, &[(CauseKind::ModelDiffers, ReflectionOff)]),
    row(50, Millis(100), &[(CauseKind::GripperInputInvalid, ReflectionOff)]),
    row(
        51,
        Cycles(2),
        &[(CauseKind::ZeroUnknown, ZeroTorque), (CauseKind::HomingFailed, DrivesOff)],
    ),
    row(
        52,
        Unstated,
        &[(CauseKind::NotFollowing, ReflectionOff), (CauseKind::Blocked, ReflectionOff)],
    ),
    row(53, Unstated, &[(CauseKind::LimitReduced, DrivesOff)]),
];

const fn row(hazard: u8, limit: Limit, reactions: &'static [(CauseKind, EndState)]) -> Expectation {
    Expectation { hazard, limit, without_timer: None, reactions }
}

/// Returns the expectation of a hazard by its number in docs/safety.md; `None` if it has no row.
pub fn of_hazard(hazard: u8) -> Option<&'static Expectation> {
    EXPECTATIONS.iter().find(|row| row.hazard == hazard)
}

/// Returns the state to which a cause leads.
pub(super) fn end_state(cause: CauseKind) -> Option<EndState> {
    let mut reactions = EXPECTATIONS.iter().flat_map(|row| row.reactions);
    reactions.find(|(one, _)| *one == cause).map(|(_, end)| *end)
}

impl Limit {
    /// Returns the time that the limit allows with a configuration; zero where none is stated.
    pub(super) fn time(self, config: &Config) -> Duration {
        match self {
            Cycles(count) => config.period * count,
            Millis(millis) => Duration::from_millis(millis),
            HeartbeatTime => config.safety.drive_lost,
            DriveTimer => timers::slowest(config),
            RpdoTimer => timers::rpdo(config).unwrap_or_default(),
            Unstated => Duration::ZERO,
        }
    }
}

/// Writes the limit as docs/safety.md states it.
impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Cycles(1) => f.write_str("1 cycle"),
            Cycles(count) => write!(f, "{count} cycles"),
            Millis(millis) => write!(f, "{millis} ms"),
            HeartbeatTime => f.write_str("its configured time"),
            DriveTimer | RpdoTimer => f.write_str("timer"),
            Unstated => Ok(()),
        }
    }
}

impl EndState {
    /// Returns the state of the drives in a latched mode.
    pub(super) const fn from_mode(mode: Mode) -> Option<Self> {
        match mode {
            Mode::Boot | Mode::Ready | Mode::Armed | Mode::Engaged | Mode::Measuring => None,
            Mode::ReflectionOff => Some(ReflectionOff),
            Mode::ZeroTorque => Some(ZeroTorque),
            Mode::DrivesOff => Some(DrivesOff),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use node::reaction::Reaction;

    /// Returns the end state of a reaction in the node's fault table.
    fn state_of(reaction: Reaction) -> Option<EndState> {
        reaction.mode().and_then(EndState::from_mode)
    }

    #[test]
    fn expected_reactions_are_those_of_the_node() {
        for Expectation { hazard, reactions, .. } in EXPECTATIONS {
            for (cause, end) in *reactions {
                let row = cause.row();
                assert_eq!(state_of(row.armed), Some(*end), "{cause:?}");
                assert!(row.hazards.contains(hazard), "{cause:?}: not for hazard {hazard}");
            }
        }
    }

    #[test]
    fn every_cause_of_the_node_is_expected_for_its_hazards() {
        for cause in CauseKind::ALL {
            for hazard in cause.row().hazards {
                let expected = of_hazard(*hazard).map(|row| row.reactions).unwrap_or_default();
                let is_expected = expected.iter().any(|(one, _)| *one == cause);
                assert!(is_expected, "hazard {hazard}: {cause:?}");
            }
        }
    }
}
