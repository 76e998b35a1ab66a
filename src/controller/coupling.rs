//! Coupling of joints and actuators if one motor moves several joints: parallelograms, cables.
//!
//! Joint positions are `θ = C m + offset`, with actuator positions m behind the gears. By virtual work, actuator torques
//! are `τ_a = Cᵀ τ` (decision 25).

use nalgebra::{SMatrix, SVector};
use thiserror::Error;

/// Maximum product of the largest entries of matrix and inverse; a matrix beyond it counts as singular.
const LARGEST_GROWTH: f64 = 1e6;

/// Coupling of `N` joints with `N` actuators.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling<const N: usize> {
    matrix: SMatrix<f64, N, N>,
    inverse: SMatrix<f64, N, N>,
    offset: SVector<f64, N>,
}

/// Reason why a coupling is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidCoupling {
    /// Entry of the matrix or the offsets beyond ±1e6, or NaN.
    #[error("{0} in the matrix or the offsets is not a reasonable number")]
    NotFinite(f64),
    /// Matrix singular or ill-conditioned: some joint motion moves no actuator, or hardly any.
    #[error("the matrix is singular: not every motion of the joints moves an actuator")]
    Singular,
}

impl<const N: usize> Coupling<N> {
    /// Returns the identity: each joint has its own actuator.
    pub fn none() -> Self {
        let one = SMatrix::identity();
        Self { matrix: one, inverse: one, offset: SVector::zeros() }
    }

    /// Creates a coupling from the rows of C and the joint offsets in rad or m.
    ///
    /// # Errors
    /// Returns the first invalid entry, or [`InvalidCoupling::Singular`].
    pub fn new(rows: [[f64; N]; N], offset: [f64; N]) -> Result<Self, InvalidCoupling> {
        let numbers = rows.iter().flatten().chain(&offset);
        if let Some(number) = numbers.copied().find(|number| !(-1e6..=1e6).contains(number)) {
            return Err(InvalidCoupling::NotFinite(number));
        }
        // nalgebra reads columns, so these rows are those of the transpose.
        let matrix = SMatrix::<f64, N, N>::from(rows).transpose();
        let inverse = matrix.try_inverse().ok_or(InvalidCoupling::Singular)?;
        if inverse.amax() * matrix.amax() <= LARGEST_GROWTH {
            Ok(Self { matrix, inverse, offset: SVector::from(offset) })
        } else {
            Err(InvalidCoupling::Singular)
        }
    }

    /// C, from actuator to joint positions.
    pub const fn matrix(&self) -> &SMatrix<f64, N, N> {
        &self.matrix
    }

    /// Joint positions with all actuators at zero, in rad or m.
    pub const fn offset(&self) -> &SVector<f64, N> {
        &self.offset
    }

    /// Converts actuator positions to joint positions, in rad or m.
    pub fn joints(&self, m: &SVector<f64, N>) -> SVector<f64, N> {
        self.matrix * m + self.offset
    }

    /// Converts joint positions to actuator positions, in rad or m.
    pub fn actuators(&self, q: &SVector<f64, N>) -> SVector<f64, N> {
        self.inverse * (q - self.offset)
    }

    /// Returns the maximum speed of each actuator at joint speeds up to `most`, in rad/s or m/s.
    pub fn fastest(&self, most: &SVector<f64, N>) -> SVector<f64, N> {
        self.inverse.abs() * most
    }

    /// Returns the maximum torque of each joint with no torque on the others, in N·m or N, for actuators limited to
    /// `max_torques`.
    pub fn capacities(&self, max_torques: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::from_iterator(self.matrix.row_iter().map(|shares| {
            let limits = shares.iter().zip(max_torques.iter());
            limits.fold(f64::INFINITY, |most, (share, max)| most.min(max / share.abs()))
        }))
    }

    /// Converts joint torques `tau` to actuator torques `Cᵀ τ`, in N·m or N.
    pub fn at_actuators(&self, tau: &SVector<f64, N>) -> SVector<f64, N> {
        self.matrix.tr_mul(tau)
    }

    /// Converts actuator torques to joint torques `C⁻ᵀ τ_a`, in N·m or N.
    pub fn at_joints(&self, tau_a: &SVector<f64, N>) -> SVector<f64, N> {
        self.inverse.tr_mul(tau_a)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn coupling() -> impl Strategy<Value = Coupling<4>> {
        let rows = prop::array::uniform4(prop::array::uniform4(-1.0..1.0_f64));
        let offset = prop::array::uniform4(-1.0..1.0_f64);
        (rows, offset)
            .prop_filter_map("singular", |(rows, offset)| Coupling::new(rows, offset).ok())
    }

    fn joints() -> impl Strategy<Value = SVector<f64, 4>> {
        prop::array::uniform4(-3.0..3.0_f64).prop_map(SVector::from)
    }

    proptest! {
        #[test]
        fn power_is_the_same_on_both_sides(
            coupling in coupling(), m in joints(), md in joints(), tau in joints()
        ) {
            let qd = (coupling.joints(&(m + md)) - coupling.joints(&(m - md))) / 2.0;
            let (at_joints, at_actuators) = (tau.dot(&qd), coupling.at_actuators(&tau).dot(&md));
            prop_assert!((at_joints - at_actuators).abs() < 1e-9 * (1.0 + at_joints.abs()));
        }

        #[test]
        fn there_and_back_again(coupling in coupling(), q in joints()) {
            let grown = coupling.inverse.amax().max(1.0);
            prop_assert!((coupling.joints(&coupling.actuators(&q)) - q).norm() < 1e-12 * grown);
            let tau = coupling.at_joints(&coupling.at_actuators(&q));
            prop_assert!((tau - q).norm() < 1e-12 * grown);
        }

        #[test]
        fn capacity_of_one_joint_is_reached_by_one_actuator(
            coupling in coupling(), joint in 0..4_usize, max in prop::array::uniform4(0.1..9.0_f64)
        ) {
            let max = SVector::from(max);
            let mut tau = SVector::<f64, 4>::zeros();
            tau[joint] = coupling.capacities(&max)[joint];
            let used = coupling.at_actuators(&tau).abs().component_div(&max);
            prop_assert!((used.max() - 1.0).abs() < 1e-9, "{used}");
        }

        #[test]
        fn uncoupled_is_as_it_was(q in joints()) {
            let none = Coupling::<4>::none();
            prop_assert!(none.joints(&q) == q && none.actuators(&q) == q);
            prop_assert!(none.at_actuators(&q) == q && none.at_joints(&q) == q);
        }
    }

    #[test]
    fn a_matrix_that_loses_a_motion_is_refused() {
        let singular = [[1.0, 2.0], [2.0, 4.0]];
        assert_eq!(Coupling::new(singular, [0.0; 2]).unwrap_err(), InvalidCoupling::Singular);
        let nearly = [[1.0, 0.0], [0.0, 1e-9]];
        assert_eq!(Coupling::new(nearly, [0.0; 2]).unwrap_err(), InvalidCoupling::Singular);
        let broken = [[1.0, 0.0], [f64::NAN, 1.0]];
        assert!(matches!(Coupling::new(broken, [0.0; 2]), Err(InvalidCoupling::NotFinite(_))));
        assert!(Coupling::new([[1.0, 0.0], [0.0, 1.0]], [0.0, f64::INFINITY]).is_err());
    }
}
