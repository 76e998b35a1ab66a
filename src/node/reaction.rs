//! What a cause can lead to: reactions, and what else a row of the [table](crate::cause) says.

use std::time::Duration;

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
pub(crate) const fn always(
    reaction: Reaction,
    decides: Decides,
    boots: bool,
    hazards: &'static [u8],
) -> Row {
    Row { unarmed: reaction, armed: reaction, decides, boots, hazards }
}

/// Only where torque may flow.
pub(crate) const fn armed(reaction: Reaction, hazards: &'static [u8]) -> Row {
    Row { unarmed: Reaction::None, armed: reaction, decides: Decides::Node, boots: false, hazards }
}
