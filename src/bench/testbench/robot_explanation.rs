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

/// Significant digits of limits in messages.
const MESSAGE_DIGITS: usize = 5;

/// Reason why joint positions are invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InvalidPosture {
    /// Number of positions that is not that of the joints.
    #[error("must have one position for each of the {joints} joints, got {got}")]
    Count {
        /// Number of joints.
        joints: usize,
        /// Number of positions.
        got: usize,
    },
    /// Position outside its range, or NaN.
    #[error("joint {joint} must be within {low} to {high} rad, its limit_deg, got {got}")]
    Range {
        /// Number of the joint, from 1.
        joint: usize,
        /// Lower limit, in rad.
        low: f64,
        /// Upper limit, in rad.
        high: f64,
        /// Position, in rad.
        got: f64,
    },
    /// Arm that cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] InvalidJointCount),
}

/// Explains `arm` without payload, at joint positions in rad, or at its start.
///
/// # Errors
/// Returns an error if the positions are invalid, or the arm cannot be simulated.
pub fn explain(arm: &RobotArm, q: Option<&[f64]>) -> Result<Explanation, InvalidPosture> {
    let q = q.map_or_else(|| Ok(arm.start()), |q| positions(arm, q))?;
    let mut entries = kinematics(arm, &q);
    entries.extend(dynamics(arm, &q)?);
    Ok(Explanation(entries))
}

/// Checks positions against the limits of their joints.
fn positions(arm: &RobotArm, given: &[f64]) -> Result<Joints, InvalidPosture> {
    let (joints, got) = (arm.joints.len(), given.len());
    if joints != got {
        return Err(InvalidPosture::Count { joints, got });
    }
    let mut q = Joints::zeros();
    for ((joint, q), (given, limits)) in (1..).zip(q.iter_mut()).zip(given.iter().zip(&arm.joints))
    {
        let [low, high] = limits.limit.range;
        if !(low..=high).contains(given) {
            let [low, high] = [low, high].map(|end| digits::significant(end, MESSAGE_DIGITS));
            return Err(InvalidPosture::Range { joint, low, high, got: *given });
        }
        *q = *given;
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
    use crate::explanation::Value;

    fn puma() -> RobotArm {
        RobotArm::load(Path::new("config/robots/puma560.toml")).unwrap()
    }

    #[test]
    fn positions_at_their_limits_are_accepted() {
        let low: [f64; 6] = [-160.0, -45.0, -225.0, -110.0, -100.0, -266.0];
        let high = [160.0, 225.0, 45.0, 170.0, 100.0, 266.0];
        for degrees in [low, high] {
            explain(&puma(), Some(&degrees.map(f64::to_radians))).unwrap();
        }
    }

    #[test]
    fn weight_of_the_configuration_is_that_of_the_simulation() {
        for file in ["puma560", "eight_r_synthetic"] {
            let arm = RobotArm::load(&Path::new("config/robots").join(file).with_extension("toml"));
            let arm = arm.unwrap();
            for share in [0.0, 0.3, 0.5, 0.9] {
                let mut q = Joints::zeros();
                for (q, joint) in q.iter_mut().zip(&arm.joints) {
                    let [low, high] = joint.limit.range;
                    *q = low + share * (high - low);
                }
                let Explanation(entries) = explain(&arm, Some(&of_joints(&arm, &q))).unwrap();
                let simulated = entries.iter().find(|entry| entry.name == "tau_gravity").unwrap();
                let Value::Numbers(simulated) = &simulated.value else { panic!("{simulated:?}") };
                for (ours, theirs) in arm.weight(&q).iter().zip(simulated) {
                    assert!(
                        (ours - theirs).abs() < 1e-9,
                        "{file}: {ours} N·m, simulated {theirs} N·m"
                    );
                }
            }
        }
    }

    #[test]
    fn positions_that_the_arm_cannot_have_are_refused() {
        let refused = |q: &[f64]| explain(&puma(), Some(q)).unwrap_err().to_string();
        let count = "must have one position for each of the 6 joints, got 7";
        assert_eq!(refused(&[0.0; 7]), count);
        let range = "joint 3 must be within -3.927 to 0.7854 rad, its limit_deg, got 0.79";
        assert_eq!(refused(&[0.0, 0.0, 0.79, 0.0, 0.0, 0.0]), range);
        assert!(refused(&[f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0]).ends_with("got NaN"));
    }
}
