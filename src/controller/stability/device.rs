//! Hand controller at the grip without its law: mass, damping, dry friction and position quantum, along and about each
//! axis of {G}.
//!
//! Each value holds for one axis with no force on the others, at one posture `q`.

use thiserror::Error;

use crate::JointVector;
use crate::arm::Arm;

/// Minimum magnitude of an entry of the Jacobian that counts as motion, in m or rad per rad.
const NOTHING: f64 = 1e-9;

/// Friction and encoder resolution of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointResistance {
    /// Dry friction, in N·m.
    pub coulomb: f64,
    /// Viscous friction that is not compensated, in N·m·s/rad.
    pub viscous: f64,
    /// One encoder count, in rad.
    pub quantum: f64,
    /// Magnitude of the negative stiffness of friction compensation, in N·m/rad; zero without it.
    pub compensated_stiffness: f64,
}

/// Mass, damping and friction along or about one axis of the grip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Device {
    /// Effective mass along the axis, `1 / (J M⁻¹ Jᵀ)_ii`, in kg or kg·m².
    pub mass: f64,
    /// Viscous damping along the axis, `1 / (J B⁻¹ Jᵀ)_ii`, in N·s/m or N·m·s/rad.
    pub damping: f64,
    /// Force along the axis at which the first joint breaks away, `min_j c_j / |J_ij|`, in N or N·m.
    pub friction: f64,
    /// Force for motion along this axis alone, `Σ_j |(J⁻¹)_ji| c_j`, in N or N·m: the maximum of dry friction. Infinite at
    /// a singularity.
    pub full_friction: f64,
    /// Magnitude of the negative stiffness of friction compensation, `1 / (J K_f⁻¹ Jᵀ)_ii`, in N/m or N·m/rad; zero
    /// without it.
    pub compensated_stiffness: f64,
    /// Position quantum, `Σ_j |J_ij| δ_j`, in m or rad: the step if every joint moves by one count.
    pub quantum: f64,
}

/// Mass matrix that is not positive definite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the arm's mass matrix is not positive definite: a joint has neither mass nor rotor")]
pub struct Massless;

impl Device {
    /// Computes all six axes of the grip of `arm`, with its joints at `q`.
    ///
    /// # Errors
    /// Returns [`Massless`] if the mass matrix is not positive definite.
    pub fn at_grip(
        arm: &Arm<6>,
        joints: &[JointResistance; 6],
        q: &JointVector,
    ) -> Result<[Self; 6], Massless> {
        let posture = arm.posture(q);
        let mass = arm.mass_matrix(&posture).cholesky().ok_or(Massless)?;
        let j_g = arm.jacobian(&posture).matrix();
        let inverse = j_g.try_inverse();
        Ok(std::array::from_fn(|axis| {
            let moved_by = JointVector::from(j_g.row(axis).transpose());
            let moving = inverse.map(|inverse| JointVector::from(inverse.column(axis)));
            Self {
                mass: moved_by.dot(&mass.solve(&moved_by)).recip(),
                full_friction: moving.map_or(f64::INFINITY, |qd| dry_power(&qd, joints)),
                ..Self::without_mass(&moved_by, joints)
            }
        }))
    }

    /// Computes the quantities that need only the axis's row of the Jacobian, `moved_by`.
    fn without_mass(moved_by: &JointVector, joints: &[JointResistance; 6]) -> Self {
        let (mut mobility, mut compliance) = (0.0, 0.0);
        let mut device = Self {
            mass: 0.0,
            damping: 0.0,
            friction: f64::INFINITY,
            full_friction: 0.0,
            compensated_stiffness: 0.0,
            quantum: 0.0,
        };
        let joints = moved_by.iter().map(|part| part.abs()).zip(joints);
        for (part, joint) in joints.filter(|(part, _)| *part > NOTHING) {
            mobility += part * part / joint.viscous;
            compliance += part * part / joint.compensated_stiffness;
            device.friction = device.friction.min(joint.coulomb / part);
            device.quantum += part * joint.quantum;
        }
        Self {
            damping: f64::recip(mobility),
            compensated_stiffness: f64::recip(compliance),
            ..device
        }
    }
}

/// Power that dry friction dissipates at joint rates `qd`, in W.
fn dry_power(qd: &JointVector, joints: &[JointResistance; 6]) -> f64 {
    qd.iter().zip(joints).map(|(rate, joint)| rate.abs() * joint.coulomb).sum()
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::arm::Link;
    use units::numbering::Joint;

    #[test]
    fn dry_friction_of_all_joints_is_their_power_at_the_grip() {
        let link = Link { alpha: 1.0, a: 0.1, d: 0.1, rotor_inertia: 1e-3, ..Link::TURNING };
        let arm = Arm::new([link; 6], Isometry3::identity(), [0.0; 3]).unwrap();
        let q = JointVector::from([0.1, 0.4, -0.3, 0.7, 0.2, -0.5]);
        let rates = arm.jacobian(&arm.posture(&q));
        let joint = |coulomb| JointResistance {
            coulomb,
            viscous: 0.1,
            quantum: 1e-5,
            compensated_stiffness: 0.0,
        };
        let coulomb = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
        let devices = Device::at_grip(&arm, &coulomb.map(joint), &q).unwrap();
        for (axis, device) in devices.into_iter().enumerate() {
            // Rates at which the grip moves by 1 along this axis alone.
            let columns = |joint: Joint| {
                let mut one = JointVector::zeros();
                one[joint.index()] = 1.0;
                JointVector::from(rates.twist(&one).components())
            };
            let matrix = nalgebra::SMatrix::<f64, 6, 6>::from_columns(&Joint::ALL.map(columns));
            let mut along = JointVector::zeros();
            along[axis] = 1.0;
            let qd = matrix.lu().solve(&along).unwrap();
            let power: f64 = qd.iter().zip(coulomb).map(|(rate, torque)| rate.abs() * torque).sum();
            let found = device.full_friction;
            assert!((found / power - 1.0).abs() < 1e-9, "axis {axis}: {found}, not {power}");
        }
    }

    #[test]
    fn an_arm_without_mass_is_none() {
        let link = Link { alpha: 1.0, a: 0.1, d: 0.1, ..Link::TURNING };
        let joint = JointResistance {
            coulomb: 0.1,
            viscous: 0.1,
            quantum: 1e-5,
            compensated_stiffness: 0.0,
        };
        let at_grip = |link| {
            let arm = Arm::new([link; 6], Isometry3::identity(), [0.0; 3]).unwrap();
            Device::at_grip(&arm, &[joint; 6], &JointVector::zeros())
        };
        assert_eq!(at_grip(link), Err(Massless));
        assert!(at_grip(Link { rotor_inertia: 1e-3, ..link }).is_ok());
    }
}
