//! The Jacobian of a serial chain: joint rates to the twist of a frame, wrench at it to joint torques.

use nalgebra::SMatrix;
use nalgebra::SVector;
use nalgebra::Vector3;

use crate::spatial::Twist;
use crate::spatial::Wrench;

/// The body Jacobian of a chain of `N` joints: `v_g = J qd`, `tau = Jᵀ f_g` (Eq. 7), all in {G}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jacobian<const N: usize> {
    /// Joint rates to the velocity of the frame's origin.
    pub linear: SMatrix<f64, 3, N>,
    /// Joint rates to its angular velocity.
    pub angular: SMatrix<f64, 3, N>,
}

impl<const N: usize> Jacobian<N> {
    /// From the twist that a unit rate of each joint gives.
    pub fn from_columns(columns: &[Twist; N]) -> Self {
        Self {
            linear: SMatrix::from_fn(|row, joint| part(columns, joint, |twist| twist.linear, row)),
            angular: SMatrix::from_fn(|row, joint| {
                part(columns, joint, |twist| twist.angular, row)
            }),
        }
    }

    /// The twist that joint rates `qd` give.
    pub fn twist(&self, qd: &SVector<f64, N>) -> Twist {
        Twist { linear: self.linear * qd, angular: self.angular * qd }
    }

    /// The joint torques that exert `wrench` at the frame: the transpose, never an inverse.
    pub fn torques(&self, wrench: &Wrench) -> SVector<f64, N> {
        self.linear.tr_mul(&wrench.force) + self.angular.tr_mul(&wrench.moment)
    }
}

/// One number of one column.
fn part<const N: usize>(
    columns: &[Twist; N],
    joint: usize,
    of: impl Fn(&Twist) -> Vector3<f64>,
    row: usize,
) -> f64 {
    columns.get(joint).map_or(0.0, |twist| of(twist)[row])
}
