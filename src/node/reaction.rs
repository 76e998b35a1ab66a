//! Reactions to a cause, and the other columns of the [fault table](crate::cause).

use std::time::Duration;

/// Reaction to a cause, mildest first. A stricter reaction always replaces a milder one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Reaction {
    /// No stop: torque is zero. Arming is refused while the cause is active.
    NoStop,
    /// S1: gravity compensation stays on, other torques ramp to zero, the object is held.
    ReflectionOff,
    /// S2: all target torques zero in the next frame; the drives stay enabled for 100 ms.
    ZeroTorque,
    /// S3: all target torques zero in the next frame, and disable voltage in the next controlwords.
    DrivesOff,
}

impl Reaction {
    /// Returns the maximum time until the torques that it ends are zero.
    pub const fn ramp(self) -> Duration {
        match self {
            Self::ReflectionOff => Duration::from_millis(20),
            Self::NoStop | Self::ZeroTorque | Self::DrivesOff => Duration::ZERO,
        }
    }

    /// Returns its description for operators, as `frhc explain faults` prints it.
    pub const fn description(self) -> &'static str {
        match self {
            Self::NoStop => {
                "no stop: torque is zero, and arming is refused while the cause is active"
            }
            Self::ReflectionOff => {
                "reflection off: the object is held, gravity compensation stays on, other torques ramp to zero"
            }
            Self::ZeroTorque => {
                "zero torque: all six targets zero in the next frame, drives off 100 ms later"
            }
            Self::DrivesOff => {
                "drives off: all six targets zero in the next frame, disable voltage in the next controlwords"
            }
        }
    }
}

/// Device that removes torque first, as `frhc explain faults` prints it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Initiator {
    /// The node, in its next frame.
    Node,
    /// The faulty drive itself; the node stops the others.
    Drive,
    /// The drives' watchdogs (RPDO timer, heartbeat consumer): the node cannot reach the drives.
    Timers,
}

impl Initiator {
    /// Returns its name, as `frhc explain faults` prints it.
    pub const fn description(self) -> &'static str {
        match self {
            Self::Node => "node",
            Self::Drive => "drive",
            Self::Timers => "drives' timers",
        }
    }
}

/// Row of the fault table: reactions to a kind of cause, and its reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultTableRow {
    /// Reaction in `Boot` and `Ready`, where torque is zero.
    pub unarmed: Reaction,
    /// Reaction in `Armed` and `Engaged`, where gravity compensation and reflection may act.
    pub armed: Reaction,
    /// Device that removes torque first.
    pub initiator: Initiator,
    /// True if a reset boots the network again, because a node may have lost its configuration.
    pub reset_boots: bool,
    /// Numbers of its hazards in docs/safety.md.
    pub hazards: &'static [u8],
}

impl FaultTableRow {
    /// Returns whether the reset itself clears the cause, by a fault reset in the drive. Such a cause refuses no reset.
    pub const fn is_reset_in_drive(&self) -> bool {
        !self.reset_boots && matches!(self.initiator, Initiator::Drive)
    }
}

/// Row with the same reaction in every mode.
pub(crate) const fn always(
    reaction: Reaction,
    initiator: Initiator,
    reset_boots: bool,
    hazards: &'static [u8],
) -> FaultTableRow {
    FaultTableRow { unarmed: reaction, armed: reaction, initiator, reset_boots, hazards }
}

/// Row that stops only modes with torque.
pub(crate) const fn armed(reaction: Reaction, hazards: &'static [u8]) -> FaultTableRow {
    FaultTableRow {
        unarmed: Reaction::NoStop,
        armed: reaction,
        initiator: Initiator::Node,
        reset_boots: false,
        hazards,
    }
}
