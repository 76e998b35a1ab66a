//! Capability message: figures of the far side, sent on request of a node. docs/link.md has the table.

use crate::codec::{ENCAPSULATION_LENGTH, Writer, are_within, packed, unpacked};
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
    /// Returns the reason if it is not a capability of this version, or has a figure out of range.
    pub fn decode(bytes: &[u8]) -> Result<(Head, Self), Reject> {
        let (head, mut reader) = Head::open(bytes, Kind::Capability, Self::LENGTH)?;
        let [senses, follows, removal] = reader.take()?;
        let _: [u8; 5] = reader.take()?;
        let (accommodation, deadband) = (reader.numbers()?, reader.numbers()?);
        let [servo_lag, sample_period, hold_after] = reader.numbers()?;
        let sensor_range: [f64; 2] = reader.numbers()?;
        let [stiffest_contact] = reader.numbers()?;
        let max_speed: [f64; 2] = reader.numbers()?;
        let workspace: [[f64; 3]; 2] = [reader.numbers()?, reader.numbers()?];
        let [low, high] = &workspace;
        let not_negative = [servo_lag, sample_period, hold_after, stiffest_contact];
        let not_negative = not_negative.iter().chain(&accommodation).chain(&deadband);
        let not_negative = not_negative.chain(&sensor_range).chain(&max_speed);
        let is_possible = not_negative.into_iter().all(|one| (0.0..=MAX_FIGURE).contains(one))
            && workspace.iter().all(|corner| are_within(corner, MAX_FIGURE))
            && low.iter().zip(high).all(|(low, high)| low <= high);
        if !is_possible {
            return Err(Reject::Impossible);
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
