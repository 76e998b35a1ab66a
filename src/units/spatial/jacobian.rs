//! Jacobian of a serial chain: maps joint rates to the twist of a frame, and a wrench at it to joint torques.

use nalgebra::{SMatrix, SVector};

use crate::spatial::{Twist, Wrench};

/// Body Jacobian of a chain of `N` joints: `v_g = J qd`, `tau = Jᵀ f_g` (Eq. 7), all in {G}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jacobian<const N: usize> {
    /// Maps joint rates to the velocity of the frame's origin, in m/rad or dimensionless.
    pub linear: SMatrix<f64, 3, N>,
    /// Maps joint rates to the angular velocity of the frame, dimensionless or in rad/m.
    pub angular: SMatrix<f64, 3, N>,
}

impl<const N: usize> Jacobian<N> {
    /// Creates the Jacobian from the twists at unit rate of each joint.
    pub fn from_columns(columns: &[Twist; N]) -> Self {
        let mut linear = SMatrix::<f64, 3, N>::zeros();
        let mut angular = SMatrix::<f64, 3, N>::zeros();
        for (mut column, twist) in linear.column_iter_mut().zip(columns) {
            column.copy_from(&twist.linear);
        }
        for (mut column, twist) in angular.column_iter_mut().zip(columns) {
            column.copy_from(&twist.angular);
        }
        Self { linear, angular }
    }

    /// Returns the matrix: translations above rotations, one column per joint.
    pub fn matrix(&self) -> SMatrix<f64, 6, N> {
        let mut matrix = SMatrix::<f64, 6, N>::zeros();
        matrix.fixed_rows_mut::<3>(0).copy_from(&self.linear);
        matrix.fixed_rows_mut::<3>(3).copy_from(&self.angular);
        matrix
    }

    /// Returns the twist at joint rates `qd`.
    pub fn twist(&self, qd: &SVector<f64, N>) -> Twist {
        Twist { linear: self.linear * qd, angular: self.angular * qd }
    }

    /// Returns the joint torques that exert `wrench` at the frame, `Jᵀ f` (Eq. 7), in N·m or N.
    pub fn torques(&self, wrench: &Wrench) -> SVector<f64, N> {
        self.linear.tr_mul(&wrench.force) + self.angular.tr_mul(&wrench.moment)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn six(size: f64) -> impl Strategy<Value = [f64; 6]> {
        prop::array::uniform6(-size..size)
    }

    proptest! {
        #[test]
        fn torques_do_the_work_of_the_wrench(
            columns in prop::array::uniform7(six(1.0)), f in six(50.0),
            qd in prop::array::uniform7(-5.0..5.0_f64)
        ) {
            let j_g = Jacobian::from_columns(&columns.map(Twist::from_components));
            let f_g = Wrench::from_components(f);
            let qd = SVector::from(qd);
            let difference = j_g.torques(&f_g).dot(&qd) - f_g.power(&j_g.twist(&qd));
            prop_assert!(difference.abs() < 1e-9, "{difference} W appeared from nowhere");
        }
    }

    #[test]
    fn a_joint_moves_the_frame_by_its_column() {
        let columns = [[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [-1.0, 0.0, 1.0, 0.5, 0.0, -0.5]]
            .map(Twist::from_components);
        let j_g = Jacobian::from_columns(&columns);
        assert_eq!(j_g.twist(&SVector::from([1.0, 0.0])), columns[0]);
        assert_eq!(j_g.twist(&SVector::from([0.0, 1.0])), columns[1]);
    }
}
