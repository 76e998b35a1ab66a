//! Places of the wall: the arm's posture where the hand meets it, its smallest singular value and its dry friction.

use derive_more::Display;
use nalgebra::Vector3;
use serde::Serialize;

use config::Config;
use controller::JointVector;
use controller::arm::JointKind;
use controller::contact_posture::{ContactPosture, OutOfReach};
use remote::scene::HALF_CUBE;

/// Distances of the hand from the start to the wall, in m.
pub const DISTANCES: [f64; 3] = [0.05, 0.09, 0.13];

/// Joint whose position names the posture: the elbow of an articulated arm, the slide of another.
const NAMING_JOINT: usize = 2;

/// Place of the wall, and the posture of the arm where the hand meets it.
#[derive(Clone, Debug, Display, PartialEq, Serialize)]
#[display("{:.0} cm: {joint}, σ {sigma_min:.2}, {friction_n:.1} N", distance_m * 100.0)]
pub struct Place {
    /// Distance of the hand from the start to the wall, in m.
    #[serde(rename = "way_m")]
    pub distance_m: f64,
    /// Name of the third joint, and its position in degrees or m.
    pub joint: String,
    /// Smallest singular value of the Jacobian at {G} (m, rad).
    pub sigma_min: f64,
    /// Dry friction of the joints along the push, at the grip, in N.
    pub friction_n: f64,
}

impl Place {
    /// Returns the place at this distance, along x of {0}, from the start posture of `config`.
    ///
    /// # Errors
    /// Returns an error if the arm does not reach the place.
    pub fn new(config: &Config, distance_m: f64) -> Result<Self, OutOfReach> {
        let start = JointVector::from(config.joints.each_ref().map(|joint| joint.plant.start));
        let friction = config.joints.each_ref().map(|joint| joint.plant.friction.coulomb);
        let way = Vector3::new(distance_m, 0.0, 0.0);
        let arm = &config.controller.arm;
        let met = ContactPosture::after(arm, &start, &way, &JointVector::from(friction))?;
        let position = met.q.iter().nth(NAMING_JOINT).copied().unwrap_or_default();
        let joint = config.joints.get(NAMING_JOINT).map(|joint| {
            let at = match joint.plant.link.kind {
                JointKind::Prismatic => format!("{position:.2} m"),
                JointKind::Revolute => format!("{:.0}°", position.to_degrees()),
            };
            format!("{} {at}", joint.name)
        });
        Ok(Self {
            distance_m,
            joint: joint.unwrap_or_default(),
            sigma_min: met.sigma_min,
            friction_n: met.friction_n,
        })
    }
}

/// Returns `config` with its wall at this distance from the hand, and with `stiffness` in N/m, if given.
#[must_use]
pub fn moved_wall(config: &Config, distance_m: f64, stiffness: Option<f64>) -> Config {
    let mut remote = config.remote.clone();
    if let Some((point, normal, contact)) = &mut remote.wall {
        let [k_p, ..] = *config.controller.command.pose_gain.values();
        let away = (*point - remote.x_b_m.translation.vector).dot(&-normal.into_inner());
        *point -= normal.into_inner() * (k_p * distance_m + HALF_CUBE - away);
        contact.stiffness = stiffness.unwrap_or(contact.stiffness);
    }
    config.clone().with_remote(remote)
}
