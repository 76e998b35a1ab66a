//! Typical values of a configuration's drives while the arm is in use.

use std::collections::BTreeMap;

use nalgebra::SVector;

use crate::bus_figures::typical::Signals;
use canopen::NodeId;
use canopen::frame::Channel;
use config::{Config, JointParameters};

/// Values by the bus and the node-id of a drive.
pub type Values = BTreeMap<(Channel, NodeId), Signals>;

/// Typical deviation of a joint from its start, as a share of its range.
const TRAVEL: f64 = 0.05;

/// Typical deviation of a joint's torque from that of gravity, as a share of its maximum.
const EFFORT: f64 = 0.15;

/// Returns the typical values of each joint's drive: near the start, with the torque of gravity.
pub fn typical_values(config: &Config) -> Values {
    let controller = &config.controller;
    let q = SVector::from(config.joints.each_ref().map(|joint| joint.plant.start));
    let tau = controller.arm.gravity(&controller.arm.posture(&q));
    let homes = controller.calibration.counts(&q).map(|counts| counts.0);
    let holding = controller.calibration.targets(&tau).map(|target| target.0);
    let joints = config.joints.iter().zip(homes.into_iter().zip(holding));
    let signals = |(joint, (home, holding)): (&JointParameters, _)| {
        let [low, high] = joint.plant.link.range;
        let most = joint.calibration.max_target().0.unsigned_abs();
        let signals = Signals {
            home,
            travel: whole(TRAVEL * (high - low) / joint.calibration.quantum()),
            holding,
            effort: u16::try_from(whole(EFFORT * f64::from(most))).unwrap_or(u16::MAX),
        };
        ((joint.channel, joint.node), signals)
    };
    joints.map(signals).collect()
}

/// Rounds a number that is not negative to the nearest integer.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the range of u32 first; NaN becomes zero"
)]
fn whole(number: f64) -> u32 {
    number.round().clamp(0.0, f64::from(u32::MAX)) as u32
}
