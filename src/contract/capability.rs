//! Capability message: figures of the far side, sent on request of a node. docs/link.md has the table.

use std::fmt;

use crate::codec::{ENCAPSULATION_LENGTH, Writer, packed, unpacked};
use crate::codes::codes;
use crate::head::{HEAD_LENGTH, Head, Kind};
use crate::reject::Reject;

/// Maximum of every figure; encodes infinity.
const MAX_FIGURE: f64 = 1e9;

codes! {
    /// Part of the payload's load that the far side removes from its sensor's reading.
    pub enum PayloadRemoval {
        /// Reading with the payload.
        None = 0, "nothing";
        /// Weight only.
        Weight = 1, "weight";
        /// Weight, and inertial load while the payload accelerates.
        Inertia = 2, "weight and inertia";
    }
}

/// Figures of a far side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capability {
    /// Set if the far side has a force/torque sensor.
    pub senses_wrench: bool,
    /// Set if the far side measures the pose of {MRF}.
    pub senses_pose: bool,
    /// Set if the far side takes gripper commands and reports opening and force.
    pub has_gripper: bool,
    /// Set if the far side follows rate commands.
    pub follows_rates: bool,
    /// Set if the far side follows pose commands.
    pub follows_poses: bool,
    /// Removal of the payload from the wrench.
    pub payload_removal: PayloadRemoval,
    /// K_FA per axis of {MRF}, in m/(s·N) and rad/(s·N·m).
    pub accommodation: [f64; 6],
    /// Deadband of accommodation per axis, in N and N·m.
    pub deadband: [f64; 6],
    /// Servo lag, in s.
    pub servo_lag: f64,
    /// Cycle period, in s.
    pub sample_period: f64,
    /// Age of the newest command after which the far side holds, in s.
    pub hold_after: f64,
    /// Range of the sensor: force in N, moment in N·m.
    pub sensor_range: [f64; 2],
    /// Maximum stiffness of a contact, in N/m.
    pub stiffest_contact: f64,
    /// Maximum speed of {MRF}, in m/s and rad/s.
    pub max_speed: [f64; 2],
    /// Minimum and maximum position of {MRF} in {b}, in m.
    pub workspace: [[f64; 3]; 2],
}

/// Reason to reject a capability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InvalidCapability {
    /// The message is not a capability of this version, or not the next one of the present far side.
    Message(Reject),
    /// A field is out of its range or NaN.
    Field {
        /// Name in the table of docs/link.md.
        field: &'static str,
        /// Minimum.
        low: f64,
        /// Maximum.
        high: f64,
        /// Value of the message.
        value: f64,
    },
}

impl InvalidCapability {
    /// Returns the reason under which the message is counted.
    pub const fn reject(self) -> Reject {
        match self {
            Self::Message(reject) => reject,
            Self::Field { .. } => Reject::Impossible,
        }
    }
}

impl fmt::Display for InvalidCapability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Message(reject) => reject.fmt(f),
            Self::Field { field, low, high, value } => {
                write!(f, "{field} must be within {low}..={high}, got {value}")
            }
        }
    }
}

impl From<Reject> for InvalidCapability {
    fn from(reject: Reject) -> Self {
        Self::Message(reject)
    }
}

impl From<InvalidCapability> for Reject {
    fn from(invalid: InvalidCapability) -> Self {
        invalid.reject()
    }
}

/// Checks that each value of a field is within a range; NaN is not.
fn check(
    field: &'static str,
    values: &[f64],
    [low, high]: [f64; 2],
) -> Result<(), InvalidCapability> {
    let invalid = values.iter().find(|value| !(low..=high).contains(*value));
    invalid
        .map_or(Ok(()), |value| Err(InvalidCapability::Field { field, low, high, value: *value }))
}

impl Capability {
    /// Length of the message, in bytes.
    pub const LENGTH: usize = ENCAPSULATION_LENGTH + HEAD_LENGTH + 232;

    /// Encodes the capability. Figures beyond ±1e9, infinity included, are clamped.
    pub fn encode(&self, head: &Head) -> [u8; Self::LENGTH] {
        let senses = packed([self.senses_wrench, self.senses_pose, self.has_gripper]);
        let follows = packed([self.follows_rates, self.follows_poses]);
        let mut bytes = [0; Self::LENGTH];
        let mut writer = Writer::new(&mut bytes);
        head.write(Kind::Capability, &mut writer);
        writer.put([senses, follows, self.payload_removal.code()]);
        writer.put([0; 5]);
        let [low, high] = self.workspace;
        let times = [self.servo_lag, self.sample_period, self.hold_after];
        for figures in [
            &self.accommodation[..],
            &self.deadband,
            &times,
            &self.sensor_range,
            &[self.stiffest_contact],
            &self.max_speed,
            &low,
            &high,
        ] {
            figures.iter().for_each(|one| writer.numbers(&[one.clamp(-MAX_FIGURE, MAX_FIGURE)]));
        }
        bytes
    }

    /// Decodes a message.
    ///
    /// # Errors
    /// Returns the reason if it is not a capability of this version, or has a field out of range.
    pub fn decode(bytes: &[u8]) -> Result<(Head, Self), InvalidCapability> {
        let (head, mut reader) = Head::open(bytes, Kind::Capability, Self::LENGTH)?;
        let [senses, follows, removal] = reader.take()?;
        let _: [u8; 5] = reader.take()?;
        for (field, code, most) in
            [("senses", senses, 7.0), ("follows", follows, 3.0), ("payload_removal", removal, 2.0)]
        {
            check(field, &[code.into()], [0.0, most])?;
        }
        let (accommodation, deadband) = (reader.numbers()?, reader.numbers()?);
        let [servo_lag, sample_period, hold_after] = reader.numbers()?;
        let sensor_range: [f64; 2] = reader.numbers()?;
        let [stiffest_contact] = reader.numbers()?;
        let max_speed: [f64; 2] = reader.numbers()?;
        let workspace: [[f64; 3]; 2] = [reader.numbers()?, reader.numbers()?];
        for (field, values) in [
            ("accommodation", &accommodation[..]),
            ("deadband", &deadband),
            ("servo_lag", &[servo_lag]),
            ("sample_period", &[sample_period]),
            ("hold_after", &[hold_after]),
            ("sensor_range", &sensor_range),
            ("stiffest_contact", &[stiffest_contact]),
            ("max_speed", &max_speed),
        ] {
            check(field, values, [0.0, MAX_FIGURE])?;
        }
        let [lows, highs] = &workspace;
        check("workspace_low", lows, [-MAX_FIGURE, MAX_FIGURE])?;
        for (low, high) in lows.iter().zip(highs) {
            check("workspace_high", &[*high], [*low, MAX_FIGURE])?;
        }
        let [senses_wrench, senses_pose, has_gripper] = unpacked(senses)?;
        let [follows_rates, follows_poses] = unpacked(follows)?;
        let capability = Self {
            senses_wrench,
            senses_pose,
            has_gripper,
            follows_rates,
            follows_poses,
            payload_removal: PayloadRemoval::from_code(removal).ok_or(Reject::Impossible)?,
            accommodation,
            deadband,
            servo_lag,
            sample_period,
            hold_after,
            sensor_range,
            stiffest_contact,
            max_speed,
            workspace,
        };
        Ok((head, capability))
    }
}
