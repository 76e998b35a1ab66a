//! The hand controller as a hand feels it at the grip: mass, damping, dry friction and the step of the
//! position, along and about each axis of {G}.
//!
//! Not what the law adds to it. Each number is what one axis shows while nothing acts on the others, at
//! one posture `q`; it differs from posture to posture.

use nalgebra::SMatrix;
use thiserror::Error;

use crate::controller::JointVector;
use crate::controller::arm::Arm;
use crate::spatial::Jacobian;

/// A Jacobian's entry this small moves nothing, in m or rad per rad.
const NOTHING: f64 = 1e-9;

/// What one joint's motion meets, and how finely it is counted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointResistance {
    /// Dry friction, in N·m.
    pub coulomb: f64,
    /// Viscous friction, in N·m·s/rad.
    pub viscous: f64,
    /// One encoder count, in rad.
    pub quantum: f64,
}

/// What a hand feels along or about one axis of the grip, in m and N or in rad and N·m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Device {
    /// `1 / (J M⁻¹ Jᵀ)_ii`, in kg or kg·m²: what a force along the axis accelerates.
    pub mass: f64,
    /// `1 / (J B⁻¹ Jᵀ)_ii`, in N·s/m or N·m·s/rad: what a slow force along the axis moves against.
    pub damping: f64,
    /// `min_j c_j / |J_ij|`, in N or N·m: the force along the axis that the first joint gives way to.
    pub friction: f64,
    /// `Σ_j |(J⁻¹)_ji| c_j`, in N or N·m: the force along the axis that moves the grip along nothing
    /// else, whatever holds it there; the most that friction can withstand. Infinite at a singularity.
    pub full_friction: f64,
    /// `Σ_j |J_ij| δ_j`, in m or rad: the step of the position when every joint makes one.
    pub quantum: f64,
}

/// An arm without mass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the arm's mass matrix is not positive definite: a joint has neither mass nor rotor")]
pub struct Massless;

impl Device {
    /// All six axes of the grip of `arm`, its joints at `q`.
    ///
    /// # Errors
    /// An arm whose mass matrix has no inverse.
    pub fn at_grip(
        arm: &Arm<6>,
        joints: &[JointResistance; 6],
        q: &JointVector,
    ) -> Result<[Self; 6], Massless> {
        let posture = arm.posture(q);
        let j_g = rows(&arm.jacobian(&posture));
        let mass = arm.mass_matrix(&posture).cholesky().ok_or(Massless)?;
        let inverse = j_g.try_inverse();
        let mut devices =
            [Self { mass: 0.0, damping: 0.0, friction: 0.0, full_friction: 0.0, quantum: 0.0 }; 6];
        for (axis, device) in devices.iter_mut().enumerate() {
            let row = JointVector::from(j_g.row(axis).transpose());
            let along = |per_joint: fn(f64, &JointResistance) -> f64| {
                let moving = row.iter().zip(joints).filter(|(entry, _)| entry.abs() > NOTHING);
                moving.map(move |(entry, joint)| per_joint(entry.abs(), joint))
            };
            let mobility: f64 = along(|entry, joint| entry * entry / joint.viscous).sum();
            let held = |column: &JointVector| -> f64 {
                column.iter().zip(joints).map(|(entry, joint)| entry.abs() * joint.coulomb).sum()
            };
            *device = Self {
                mass: row.dot(&mass.solve(&row)).recip(),
                damping: mobility.recip(),
                friction: along(|entry, joint| joint.coulomb / entry).fold(f64::INFINITY, f64::min),
                full_friction: inverse.map_or(f64::INFINITY, |j| held(&j.column(axis).into())),
                quantum: along(|entry, joint| entry * joint.quantum).sum(),
            };
        }
        Ok(devices)
    }
}

/// Translations above rotations.
fn rows(j_g: &Jacobian<6>) -> SMatrix<f64, 6, 6> {
    let mut rows = SMatrix::<f64, 6, 6>::zeros();
    rows.fixed_rows_mut::<3>(0).copy_from(&j_g.linear);
    rows.fixed_rows_mut::<3>(3).copy_from(&j_g.angular);
    rows
}
