//! The fault table: what each kind of cause does in each mode, who sees to it, and how it is left again.
//!
//! A kind or a mode without an entry does not compile. `frhc explain faults` prints the table, and
//! [`safety`](crate::safety) does what it says; nothing else decides what a cause leads to.

use std::time::Duration;

use crate::cause::Kind;
use crate::record::Mode;

/// What a cause leads to, mildest first; a worse one always replaces a milder one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Reaction {
    /// Nothing flows that it could harm; but nothing is armed while it is there.
    None,
    /// S1: the weight of the arm is carried on, everything else ends by a ramp, the command holds.
    ReflectionOff,
    /// S2: all target torques zero in the next frame, the drives stay enabled for 100 ms.
    ZeroTorque,
    /// S3: the same, and voltage off at once.
    DrivesOff,
}

impl Reaction {
    /// How long torque may take to end.
    pub const fn ramp(self) -> Duration {
        match self {
            Self::ReflectionOff => Duration::from_millis(50),
            Self::None | Self::ZeroTorque | Self::DrivesOff => Duration::ZERO,
        }
    }

    /// The mode it leads to, if to another.
    pub const fn mode(self) -> Option<Mode> {
        match self {
            Self::None => None,
            Self::ReflectionOff => Some(Mode::ReflectionOff),
            Self::ZeroTorque => Some(Mode::ZeroTorque),
            Self::DrivesOff => Some(Mode::DrivesOff),
        }
    }
}

/// Who takes the torque away first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Decides {
    /// The node, in its next frame.
    Node,
    /// The drive it befalls, by itself; the node stops the others.
    Drive,
    /// The drives, by their own timers: the node cannot reach them.
    Timers,
}

/// One row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// In `Boot` and `Ready`, where torque is zero.
    pub unarmed: Reaction,
    /// In `Armed` and `Engaged`, where the weight of the arm is carried and wrenches may be felt.
    pub armed: Reaction,
    /// Who takes the torque away first.
    pub decides: Decides,
    /// Whether a reset must boot the network again, because a node may have lost its configuration.
    pub boots: bool,
    /// The hazards it stands for, by their numbers in docs/safety.md.
    pub hazards: &'static [u8],
}

/// The same in every mode.
const fn always(reaction: Reaction, decides: Decides, boots: bool, hazards: &'static [u8]) -> Row {
    Row { unarmed: reaction, armed: reaction, decides, boots, hazards }
}

/// Only where torque may flow.
const fn armed(reaction: Reaction, hazards: &'static [u8]) -> Row {
    Row { unarmed: Reaction::None, armed: reaction, decides: Decides::Node, boots: false, hazards }
}

/// The table.
pub const fn row(kind: Kind) -> Row {
    use Decides::Drive;
    use Decides::Node;
    use Decides::Timers;
    use Reaction::DrivesOff;
    use Reaction::ReflectionOff;
    use Reaction::ZeroTorque;
    match kind {
        Kind::SamplesMissing => always(ZeroTorque, Node, true, &[1, 3, 4]),
        Kind::StatusMissing => always(ZeroTorque, Node, true, &[3]),
        Kind::SamplesRare => armed(ReflectionOff, &[3]),
        Kind::SamplesOverdue => always(ZeroTorque, Node, true, &[4]),
        Kind::PositionFrozen => always(ZeroTorque, Node, false, &[5]),
        Kind::PositionJumped => always(ZeroTorque, Node, false, &[12]),
        Kind::TorqueDiffers => always(ZeroTorque, Node, false, &[10]),
        Kind::Overspeed | Kind::GripOverspeed => armed(ZeroTorque, &[11]),
        Kind::BeyondLimit => armed(ReflectionOff, &[43]),
        Kind::MovesUnheld => armed(ZeroTorque, &[41]),
        Kind::Unstable => armed(ReflectionOff, &[45]),
        Kind::LinkLost => armed(ReflectionOff, &[34, 35]),
        Kind::DriveLeft => always(ZeroTorque, Drive, false, &[8]),
        Kind::Emergency => always(ZeroTorque, Drive, false, &[7, 13]),
        Kind::HeartbeatLost => always(DrivesOff, Node, true, &[2]),
        Kind::Rebooted => always(DrivesOff, Drive, true, &[9]),
        Kind::LeftOperational => always(ZeroTorque, Node, true, &[8]),
        Kind::Duplicate => always(ZeroTorque, Node, true, &[6]),
        Kind::ForeignMaster => always(DrivesOff, Node, true, &[26]),
        Kind::SettingChanged => always(DrivesOff, Node, true, &[26]),
        Kind::ControllerFault => always(ZeroTorque, Node, false, &[42, 44]),
        Kind::QueueFull => always(ZeroTorque, Timers, true, &[21]),
        Kind::EchoMissing => always(DrivesOff, Timers, true, &[22]),
        Kind::BusPassive => always(ZeroTorque, Node, false, &[23]),
        Kind::BusOff => always(DrivesOff, Timers, true, &[23]),
        Kind::BusDown => always(DrivesOff, Timers, true, &[24]),
        Kind::DeadmanDisagrees => always(ZeroTorque, Node, false, &[39]),
        Kind::DeadmanTaped => armed(ReflectionOff, &[39]),
        Kind::Overrun => always(ZeroTorque, Timers, false, &[28, 29]),
        Kind::Late => always(ZeroTorque, Node, false, &[29]),
        Kind::Suspended => always(DrivesOff, Timers, true, &[31]),
        Kind::EnableTimeout => always(ZeroTorque, Node, true, &[16]),
        Kind::AwaitsReset => always(DrivesOff, Node, true, &[27]),
    }
}

/// What a cause of this kind leads to in a mode; never to a milder one than it is in.
pub const fn reaction(kind: Kind, mode: Mode) -> Reaction {
    let row = row(kind);
    match mode {
        Mode::Boot | Mode::Ready => row.unarmed,
        Mode::Armed | Mode::Engaged => row.armed,
        Mode::ReflectionOff => worse(row.armed, Reaction::ReflectionOff),
        Mode::ZeroTorque => worse(row.armed, Reaction::ZeroTorque),
        Mode::DrivesOff => Reaction::DrivesOff,
    }
}

const fn worse(one: Reaction, other: Reaction) -> Reaction {
    match (one, other) {
        (Reaction::DrivesOff, _) | (_, Reaction::DrivesOff) => Reaction::DrivesOff,
        (Reaction::ZeroTorque, _) | (_, Reaction::ZeroTorque) => Reaction::ZeroTorque,
        (Reaction::ReflectionOff, _) | (_, Reaction::ReflectionOff) => Reaction::ReflectionOff,
        (Reaction::None, Reaction::None) => Reaction::None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_latch_never_becomes_milder_and_where_nothing_is_carried_nothing_is_carried_on() {
        for kind in Kind::ALL {
            assert_ne!(row(kind).unarmed, Reaction::ReflectionOff, "{kind:?}");
            for mode in [Mode::ReflectionOff, Mode::ZeroTorque, Mode::DrivesOff] {
                let after = reaction(kind, mode).mode().unwrap();
                let rank = |mode| Mode::ALL.iter().position(|one| *one == mode);
                assert!(rank(after) >= rank(mode), "{kind:?} in {mode}: {after}");
            }
        }
    }

    #[test]
    fn what_acts_where_nothing_flows_acts_where_something_does() {
        for kind in Kind::ALL {
            let row = row(kind);
            assert!(row.unarmed <= row.armed, "{kind:?}");
            assert!(row.armed > Reaction::None && !row.hazards.is_empty(), "{kind:?}");
        }
    }
}
