//! The command of a cycle, from the node to the far side. docs/link.md has the table.
//!
//! Values that mode and flags exclude are those of no motion, and are not read; nor are reserved bytes.

use crate::codec::{ENCAPSULATION_LENGTH, Writer, are_within};
use crate::head::{HEAD_LENGTH, Head, Kind};
use crate::pose::Pose;
use crate::reject::Reject;

/// Maximum component of a twist, in m/s or rad/s.
const MAX_RATE: f64 = 100.0;

/// Maximum opening of a gripper in m, and maximum force in N.
const MAX_GRIPPER: f64 = 1e3;

/// Motion of {MRF} that is commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Stay where it is.
    Hold,
    /// Move with this twist of {MRF}, written in {MRF}: linear in m/s, then angular in rad/s.
    Rate([f64; 6]),
    /// Go to this pose.
    Pose(Pose),
}

/// Position and force of a gripper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gripper {
    /// Opening, in m.
    pub position: f64,
    /// Force, in N.
    pub force: f64,
}

impl Gripper {
    /// Returns whether opening and force are within their ranges. NaN is not.
    pub fn is_possible(&self) -> bool {
        are_within(&[self.position, self.force], MAX_GRIPPER)
    }

    /// Returns its numbers; zeros for none.
    pub(crate) fn numbers(gripper: Option<Self>) -> [f64; 2] {
        gripper.map_or([0.0; 2], |Self { position, force }| [position, force])
    }

    /// Returns the gripper with these numbers.
    pub(crate) fn from_numbers(numbers: [f64; 2]) -> Result<Self, Reject> {
        let [position, force] = numbers;
        let gripper = Self { position, force };
        if gripper.is_possible() { Ok(gripper) } else { Err(Reject::Impossible) }
    }
}

/// A command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Head.
    pub head: Head,
    /// Motion.
    pub motion: Motion,
    /// True while the motion comes from the operator's hand.
    pub is_engaged: bool,
    /// The node has no capability of this far side's session yet.
    pub asks_capability: bool,
    /// Gripper, where the hand controller has one.
    pub gripper: Option<Gripper>,
}

impl Command {
    /// Length, in bytes.
    pub const LENGTH: usize = ENCAPSULATION_LENGTH + HEAD_LENGTH + 144;

    /// Encodes the command.
    pub fn encode(&self) -> [u8; Self::LENGTH] {
        let (mode, rate, pose) = match self.motion {
            Motion::Hold => (0, [0.0; 6], Pose::default()),
            Motion::Rate(rate) => (1, rate, Pose::default()),
            Motion::Pose(pose) => (2, [0.0; 6], pose),
        };
        let mut bytes = [0; Self::LENGTH];
        let mut writer = Writer::new(&mut bytes);
        self.head.write(Kind::Command, &mut writer);
        let flags = [self.is_engaged, self.asks_capability, self.gripper.is_some()];
        writer.put([mode]);
        writer.put(flags.map(u8::from));
        writer.put([0; 4]);
        writer.numbers(&rate);
        writer.numbers(&pose.numbers());
        writer.numbers(&Gripper::numbers(self.gripper));
        bytes
    }

    /// Decodes a message.
    ///
    /// # Errors
    /// A message that is not a command of this version, or has a value out of range.
    pub fn decode(bytes: &[u8]) -> Result<Self, Reject> {
        let (head, mut reader) = Head::open(bytes, Kind::Command, Self::LENGTH)?;
        let [mode, engaged, asks, has_gripper] = reader.take()?;
        let _: [u8; 4] = reader.take()?;
        let (rate, pose) = (reader.numbers()?, reader.numbers()?);
        let motion = match mode {
            0 => Motion::Hold,
            1 if are_within(&rate, MAX_RATE) => Motion::Rate(rate),
            2 => Motion::Pose(Pose::from_numbers(pose).ok_or(Reject::Impossible)?),
            _ => return Err(Reject::Impossible),
        };
        let gripper = Gripper::from_numbers(reader.numbers()?);
        let has_gripper = flag(has_gripper)?;
        Ok(Self {
            head,
            motion,
            is_engaged: flag(engaged)?,
            asks_capability: flag(asks)?,
            gripper: has_gripper.then_some(gripper).transpose()?,
        })
    }
}

/// Reads a flag, which is 0 or 1.
const fn flag(byte: u8) -> Result<bool, Reject> {
    match byte {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(Reject::Impossible),
    }
}
