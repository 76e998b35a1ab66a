//! Cables and parallelograms between motors and joints: joints are at `θ = C m + offset` when the motors'
//! gears have turned to m.
//!
//! Solved here and not inverted beforehand, as the controller does it: the two judge each other.

use nalgebra::LU;
use nalgebra::U6;

use crate::sim::arm::JointMatrix;
use crate::sim::arm::Joints;

/// A coupling of six motors and six joints.
#[derive(Clone, Debug)]
pub struct Transmission {
    matrix: LU<f64, U6, U6>,
    transposed: LU<f64, U6, U6>,
    offset: Joints,
}

impl Transmission {
    /// From C, row by row, which must not be singular, and the joints' offsets in rad or m.
    pub fn new(rows: [[f64; 6]; 6], offset: [f64; 6]) -> Self {
        let transposed = JointMatrix::from(rows); // read column by column
        Self {
            matrix: LU::new(transposed.transpose()),
            transposed: LU::new(transposed),
            offset: Joints::from(offset),
        }
    }

    /// Each joint with its own motor.
    pub fn direct() -> Self {
        let one = JointMatrix::identity();
        Self { matrix: LU::new(one), transposed: LU::new(one), offset: Joints::zeros() }
    }

    /// Where the motors' gears are when the joints are at `q`.
    pub(super) fn motors(&self, q: &Joints) -> Joints {
        self.matrix.solve(&(q - self.offset)).unwrap_or_else(Joints::zeros)
    }

    /// How fast they turn when the joints move with `qd`.
    pub(super) fn rates(&self, qd: &Joints) -> Joints {
        self.matrix.solve(qd).unwrap_or_else(Joints::zeros)
    }

    /// What motors that exert `tau_a` exert on the joints: the same power, so `Cᵀ τ = τ_a`.
    pub(super) fn joints(&self, tau_a: &Joints) -> Joints {
        self.transposed.solve(tau_a).unwrap_or_else(Joints::zeros)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The elbow's motor stands on the base, so the shoulder turns the elbow back.
    fn parallelogram() -> Transmission {
        let mut rows: [[f64; 6]; 6] = JointMatrix::identity().into();
        rows[2][1] = -1.0;
        Transmission::new(rows, [0.0, 0.0, 0.5, 0.0, 0.0, 0.0])
    }

    #[test]
    fn the_elbow_keeps_its_direction_when_only_the_shoulder_turns() {
        let q = Joints::from([0.0, 0.3, 0.5 - 0.3, 0.0, 0.0, 0.0]);
        let m = parallelogram().motors(&q);
        assert!((m - Joints::from([0.0, 0.3, 0.0, 0.0, 0.0, 0.0])).norm() < 1e-12);
    }

    #[test]
    fn power_goes_through() {
        let qd = Joints::from([0.1, -0.2, 0.3, 0.4, -0.5, 0.6]);
        let tau_a = Joints::from([1.0, 2.0, -3.0, 0.4, 0.5, -0.6]);
        let coupled = parallelogram();
        let (joints, motors) = (coupled.joints(&tau_a).dot(&qd), tau_a.dot(&coupled.rates(&qd)));
        assert!((joints - motors).abs() < 1e-12);
        let direct = Transmission::direct();
        assert!((direct.joints(&tau_a) - tau_a).norm() < 1e-15);
        assert!((direct.motors(&qd) - qd).norm() < 1e-15);
    }
}
