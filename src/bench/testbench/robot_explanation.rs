//! Robot arm at given joint positions: kinematics of the room `robot`, torques and masses of the simulation.
//!
//! The simulated arm uses the same computations, so that other programs can be compared with it by the arm's file.

use nalgebra::Vector3;

use crate::explanation::{Entry, Explanation, entry};
use crate::simulated_joint;
use config::robots::RobotArm;
use remote::site::GRAVITY;
use robot::chain::{Joints, MAX_JOINTS};
use sim::arm::{Arm, InvalidJointCount, LinkSettings};
use telemetry::digits;

/// Significant digits of limits in messages: those of the file, without the rounding of rad.
const MESSAGE_DIGITS: usize = 12;

/// Reason why joint positions are invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InvalidPosture {
    /// The number of positions is not that of the joints.
    #[error("must have one position for each of the {joints} joints, got {got}")]
    Count {
        /// Number of joints.
        joints: usize,
        /// Number of positions.
        got: usize,
    },
    /// A position is outside of its range, or NaN.
    #[error("joint {joint} must be within its limit_deg, {low} to {high}, got {got}")]
    Range {
        /// The joint, from 1.
        joint: usize,
        /// Lower limit, in degrees.
        low: f64,
        /// Upper limit, in degrees.
        high: f64,
        /// Position, in degrees.
        got: f64,
    },
    /// The arm cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] InvalidJointCount),
}

/// Explains `arm` without payload, at joint positions in degrees, or at its start.
///
/// # Errors
/// The positions are invalid, or the arm cannot be simulated.
pub fn explain(arm: &RobotArm, degrees: Option<&[f64]>) -> Result<Explanation, InvalidPosture> {
    let q = degrees.map_or_else(|| Ok(arm.start()), |degrees| positions(arm, degrees))?;
    let mut entries = kinematics(arm, &q);
    entries.extend(dynamics(arm, &q)?);
    Ok(Explanation(entries))
}

/// Checks positions in degrees, and returns them in rad.
fn positions(arm: &RobotArm, degrees: &[f64]) -> Result<Joints, InvalidPosture> {
    let (joints, got) = (arm.joints.len(), degrees.len());
    if joints != got {
        return Err(InvalidPosture::Count { joints, got });
    }
    let mut q = Joints::zeros();
    let pairs = degrees.iter().zip(&arm.joints);
    for ((joint, q), (degrees, limits)) in (1..).zip(q.iter_mut()).zip(pairs) {
        let [low, high] = limits.limit.range;
        *q = degrees.to_radians();
        if !(low..=high).contains(q) {
            let [low, high] =
                [low, high].map(|end| digits::significant(end.to_degrees(), MESSAGE_DIGITS));
            return Err(InvalidPosture::Range { joint, low, high, got: *degrees });
        }
    }
    Ok(q)
}

/// Returns the entries computed by the room `robot`.
fn kinematics(arm: &RobotArm, q: &Joints) -> Vec<Entry> {
    let law = arm.law();
    let (x_b_m, j_m) = law.chain().forward_and_jacobian(q);
    let present = of_joints(arm, q);
    let j_m: Vec<Vec<f64>> =
        j_m.matrix().row_iter().map(|row| of_joints(arm, &row.transpose())).collect();
    let sigma_min = law.sigma_min(q);
    vec![
        entry("q", &present, "", ["rad", "joints"], "joint positions"),
        entry("x_b_m", &x_b_m, "", ["m", "b"], "frame under control"),
        entry("j_m", &j_m, "", ["m, 1", "m"], "its Jacobian"),
        entry(
            "sigma_min",
            &sigma_min,
            "",
            ["1", ""],
            "smallest singular value, lengths over length_m",
        ),
    ]
}

/// Returns the entries computed by the simulation.
fn dynamics(arm: &RobotArm, q: &Joints) -> Result<Vec<Entry>, InvalidPosture> {
    let links: Vec<LinkSettings> =
        arm.joints.iter().map(|joint| simulated_joint::settings(joint).link).collect();
    let g_0 = arm.x_b_0.rotation.inverse() * Vector3::from(GRAVITY);
    let simulated = Arm::<MAX_JOINTS>::padded(&links, arm.x_n_m, g_0)?;
    let posture = simulated.posture(q);
    let tau_gravity = of_joints(arm, &simulated.gravity(&posture));
    let mass = simulated.mass_matrix(&posture);
    let mass: Vec<Vec<f64>> =
        mass.column_iter().take(arm.joints.len()).map(|one| of_joints(arm, &one.into())).collect();
    Ok(vec![
        entry("tau_gravity", &tau_gravity, "", ["N·m", "joints"], "torques that carry the arm"),
        entry("mass_matrix", &mass, "", ["kg·m²", "joints"], "mass matrix, with the rotors"),
    ])
}

/// Returns the values of the arm's joints, without the padding.
fn of_joints(arm: &RobotArm, values: &Joints) -> Vec<f64> {
    values.iter().copied().take(arm.joints.len()).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn puma() -> RobotArm {
        RobotArm::load(Path::new("config/robots/puma560.toml")).unwrap()
    }

    #[test]
    fn positions_at_their_limits_are_accepted() {
        let low = [-160.0, -45.0, -225.0, -110.0, -100.0, -266.0];
        let high = [160.0, 225.0, 45.0, 170.0, 100.0, 266.0];
        for degrees in [low, high] {
            explain(&puma(), Some(&degrees)).unwrap();
        }
    }

    #[test]
    fn positions_that_the_arm_cannot_have_are_refused() {
        let refused = |degrees: &[f64]| explain(&puma(), Some(degrees)).unwrap_err().to_string();
        let count = "must have one position for each of the 6 joints, got 7";
        assert_eq!(refused(&[0.0; 7]), count);
        let range = "joint 3 must be within its limit_deg, -225 to 45, got 45.1";
        assert_eq!(refused(&[0.0, 0.0, 45.1, 0.0, 0.0, 0.0]), range);
        assert!(refused(&[f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0]).ends_with("got NaN"));
    }
}
