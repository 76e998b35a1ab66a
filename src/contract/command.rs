//! Command message of a cycle, from the node to the far side. docs/link.md has the table.
//!
//! Values that mode and flags exclude are sent as zero or identity. Receivers ignore them, and reserved bytes.

use crate::codec::{ENCAPSULATION_LENGTH, Writer, are_within};
use crate::head::{HEAD_LENGTH, Head, Kind};
use crate::pose::Pose;
use crate::reject::Reject;

/// Maximum component of a twist, in m/s or rad/s.
const MAX_RATE: f64 = 100.0;

/// Maximum opening of a gripper, in m, and maximum force, in N.
const MAX_GRIPPER: f64 = 1e3;

/// Commanded motion of {MRF}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Hold the present pose.
    Hold,
    /// Twist of {MRF}, written in {MRF}: linear in m/s, then angular in rad/s.
    Rate([f64; 6]),
    /// Pose of {MRF} in {b}.
    Pose(Pose),
}

/// Opening and force of a gripper, commanded or measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gripper {
    /// Opening, in m.
    pub position: f64,
    /// Force, in N.
    pub force: f64,
}

impl Gripper {
    /// Returns whether opening and force are within their ranges; NaN is not.
    pub fn is_possible(&self) -> bool {
        are_within(&[self.position, self.force], MAX_GRIPPER)
    }

    /// Returns opening and force for the wire; zeros for `None`.
    pub(crate) fn numbers(gripper: Option<Self>) -> [f64; 2] {
        gripper.map_or([0.0; 2], |Self { position, force }| [position, force])
    }

    /// Creates a gripper from the wire; out of range it is [`Reject::Impossible`].
    pub(crate) fn from_numbers(numbers: [f64; 2]) -> Result<Self, Reject> {
        let [position, force] = numbers;
        let gripper = Self { position, force };
        if gripper.is_possible() { Ok(gripper) } else { Err(Reject::Impossible) }
    }
}

/// Command message of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Head of the message.
    pub head: Head,
    /// Commanded motion of {MRF}.
    pub motion: Motion,
    /// Set if the operator's hand commands the motion.
    pub is_engaged: bool,
    /// Requests the capability of the far side's session.
    pub asks_capability: bool,
    /// Opening and maximum force of the gripper; `None` without a gripper command.
    pub gripper: Option<Gripper>,
}

impl Command {
    /// Length of the message, in bytes.
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
    /// Returns the reason if it is not a command of this version, or has a value out of range.
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

/// Decodes a flag, 0 or 1.
const fn flag(byte: u8) -> Result<bool, Reject> {
    match byte {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(Reject::Impossible),
    }
}
