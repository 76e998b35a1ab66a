//! Feedback message of a cycle, from the far side to the node. docs/link.md has the table.

use crate::codec::{ENCAPSULATION_LENGTH, Writer, are_within, packed, unpacked};
use crate::codes::codes;
use crate::command::Gripper;
use crate::head::{HEAD_LENGTH, Head, Kind};
use crate::pose::Pose;
use crate::reject::Reject;

/// Maximum component of a wrench, in N or N·m.
pub const MAX_WRENCH: f64 = 1e5;

codes! {
    /// State of the far side.
    pub enum FarState {
        /// Holds its pose.
        Holding = 0, "holding";
        /// Follows the commands of the leading session.
        Following = 1, "following";
    }
}

codes! {
    /// Reason of a hold. Only a new epoch ends it.
    pub enum Reason {
        /// No hold: the far side follows.
        None = 0, "none";
        /// No node leads, or its session was never armed.
        NotArmed = 1, "not armed";
        /// Newest command older than `hold_after`.
        Silence = 2, "no fresh command";
        /// Invalid reading of the force/torque sensor.
        SensorInvalid = 3, "force sensor invalid";
        /// Reading of the force/torque sensor beyond its range.
        SensorSaturated = 4, "force sensor saturated";
        /// Force/torque sensor without new readings.
        SensorSilent = 5, "force sensor silent";
        /// Contact force or moment beyond the limit of the far side.
        WrenchLimit = 6, "contact wrench above its limit";
        /// End of the far side's process.
        Ending = 7, "far side ends";
        /// Any other fault that the robot reports.
        Robot = 8, "fault of the robot";
    }
}

impl Reason {
    /// Returns [`FarState::Following`] for [`Reason::None`], else [`FarState::Holding`].
    pub fn state(self) -> FarState {
        if self == Self::None { FarState::Following } else { FarState::Holding }
    }
}

/// Measurements of one cycle of the far side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurements {
    /// Wrench of the environment on the object at {S}, without payload: force in N, then moment in N·m. `None` if invalid.
    pub wrench: Option<[f64; 6]>,
    /// Pose of {MRF} in {b}; `None` if invalid.
    pub pose: Option<Pose>,
    /// Opening and force of the gripper; `None` without a gripper, or if invalid.
    pub gripper: Option<Gripper>,
}

/// Feedback message of one cycle of the far side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// Head of the message.
    pub head: Head,
    /// Reason of the hold; [`Reason::None`] while following.
    pub reason: Reason,
    /// Session of the leading node; zero without one.
    pub obeyed_session: u64,
    /// Number of that session's newest command that has taken effect; zero without one.
    pub acted_sequence: u64,
    /// Measurements of this cycle.
    pub measured: Measurements,
}

impl Feedback {
    /// Length of the message, in bytes.
    pub const LENGTH: usize = ENCAPSULATION_LENGTH + HEAD_LENGTH + 152;

    /// Encodes the feedback.
    pub fn encode(&self) -> [u8; Self::LENGTH] {
        let Measurements { wrench, pose, gripper } = self.measured;
        let valid = packed([wrench.is_some(), pose.is_some(), gripper.is_some()]);
        let mut bytes = [0; Self::LENGTH];
        let mut writer = Writer::new(&mut bytes);
        self.head.write(Kind::Feedback, &mut writer);
        writer.put([self.reason.state().code(), self.reason.code(), valid]);
        writer.put([0; 5]);
        writer.put(self.obeyed_session.to_le_bytes());
        writer.put(self.acted_sequence.to_le_bytes());
        writer.numbers(&wrench.unwrap_or_default());
        writer.numbers(&pose.unwrap_or_default().numbers());
        writer.numbers(&Gripper::numbers(gripper));
        bytes
    }

    /// Decodes a message.
    ///
    /// # Errors
    /// Returns the reason if it is not a feedback of this version, or has a value out of range.
    pub fn decode(bytes: &[u8]) -> Result<Self, Reject> {
        let (head, mut reader) = Head::open(bytes, Kind::Feedback, Self::LENGTH)?;
        let [state, reason, valid] = reader.take()?;
        let _: [u8; 5] = reader.take()?;
        let obeyed_session = u64::from_le_bytes(reader.take()?);
        let acted_sequence = u64::from_le_bytes(reader.take()?);
        let (wrench, pose, gripper) = (reader.numbers()?, reader.numbers()?, reader.numbers()?);
        let [has_wrench, has_pose, has_gripper] = unpacked(valid)?;
        let reason = Reason::from_code(reason).ok_or(Reject::Impossible)?;
        if state != reason.state().code() || has_wrench && !are_within(&wrench, MAX_WRENCH) {
            return Err(Reject::Impossible);
        }
        let pose = Pose::from_numbers(pose).ok_or(Reject::Impossible);
        let gripper = Gripper::from_numbers(gripper);
        Ok(Self {
            head,
            reason,
            obeyed_session,
            acted_sequence,
            measured: Measurements {
                wrench: has_wrench.then_some(wrench),
                pose: has_pose.then_some(pose).transpose()?,
                gripper: has_gripper.then_some(gripper).transpose()?,
            },
        })
    }
}
