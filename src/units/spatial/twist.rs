//! Twist: linear and angular velocity, in m/s and rad/s.

use derive_more::{Add, Mul};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::spatial::rotation;

/// Velocity of a frame, written in that frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Add, Mul)]
pub struct Twist {
    /// Velocity of the origin, in m/s.
    pub linear: Vector3<f64>,
    /// Angular velocity, in rad/s.
    pub angular: Vector3<f64>,
}

impl Twist {
    /// Zero velocity.
    pub const ZERO: Self =
        Self { linear: Vector3::new(0.0, 0.0, 0.0), angular: Vector3::new(0.0, 0.0, 0.0) };

    /// Creates a twist from vx, vy, vz, ωx, ωy, ωz.
    pub const fn from_components([vx, vy, vz, wx, wy, wz]: [f64; 6]) -> Self {
        Self { linear: Vector3::new(vx, vy, vz), angular: Vector3::new(wx, wy, wz) }
    }

    /// Returns vx, vy, vz, ωx, ωy, ωz.
    pub fn components(&self) -> [f64; 6] {
        [
            self.linear.x,
            self.linear.y,
            self.linear.z,
            self.angular.x,
            self.angular.y,
            self.angular.z,
        ]
    }

    /// Multiplies each component by its own gain: a diagonal gain matrix.
    pub fn scaled(&self, gains: &[f64; 6]) -> Self {
        let [vx, vy, vz, wx, wy, wz] = self.components();
        let [a, b, c, d, e, f] = *gains;
        Self::from_components([a * vx, b * vy, c * vz, d * wx, e * wy, f * wz])
    }

    /// Transforms the twist of a rigid body to the other frame of `x`: `v_m = v_s.at(&x_m_s)`.
    pub fn at(&self, x: &Isometry3<f64>) -> Self {
        let angular = x.rotation * self.angular;
        let linear = x.rotation * self.linear + x.translation.vector.cross(&angular);
        Self { linear, angular }
    }

    /// Returns the motion of a body with this constant twist in `dt` s: a screw motion, exact for any `dt`.
    pub fn over(&self, dt: f64) -> Isometry3<f64> {
        let turn = self.angular * dt;
        let shift = rotation::left_jacobian(&turn) * (self.linear * dt);
        Isometry3::from_parts(Translation3::from(shift), UnitQuaternion::from_scaled_axis(turn))
    }

    /// Returns the twist that moves a body by `x` in `dt` s, rotating by at most π: the inverse of
    /// [`over`](Self::over).
    pub fn reaching(x: &Isometry3<f64>, dt: f64) -> Self {
        let turn = rotation::rotation_vector(&x.rotation);
        let shift = rotation::left_jacobian_inverse(&turn) * x.translation.vector;
        Self { linear: shift / dt, angular: turn / dt }
    }

    /// Returns whether all components are finite.
    pub fn is_finite(&self) -> bool {
        self.components().iter().all(|component| component.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn twist() -> impl Strategy<Value = Twist> {
        prop::array::uniform6(-3.0..3.0_f64).prop_map(Twist::from_components)
    }

    proptest! {
        #[test]
        fn reversed_twist_undoes_a_motion(v_g in twist(), dt in 0.0..2.0_f64) {
            let there_and_back = v_g.over(dt) * (v_g * -1.0).over(dt);
            prop_assert!(there_and_back.translation.vector.norm() < 1e-12);
            prop_assert!(there_and_back.rotation.angle() < 1e-7);
        }

        #[test]
        fn two_half_motions_equal_the_whole(v_g in twist(), dt in 0.0..2.0_f64) {
            let halves = v_g.over(dt / 2.0) * v_g.over(dt / 2.0);
            let whole = v_g.over(dt);
            prop_assert!((halves.to_homogeneous() - whole.to_homogeneous()).norm() < 1e-12);
        }

        #[test]
        fn reaching_inverts_over(v_g in twist(), dt in 1e-4..0.5_f64) {
            let again = Twist::reaching(&v_g.over(dt), dt);
            for (a, b) in again.components().iter().zip(v_g.components()) {
                prop_assert!((a - b).abs() < 1e-9, "{again:?} is not {v_g:?}");
            }
        }
    }

    #[test]
    fn slow_motion_is_twist_times_time() {
        let v_g = Twist::from_components([1.0, -2.0, 3.0, 0.5, 0.1, -0.7]);
        let x = v_g.over(1e-8);
        assert!((x.translation.vector / 1e-8 - v_g.linear).norm() < 1e-7);
        assert!((x.rotation.scaled_axis() / 1e-8 - v_g.angular).norm() < 1e-7);
    }

    #[test]
    fn rotating_body_moves_on_an_arc() {
        // Half a turn about z while moving along its own x: a semicircle of diameter 2/π.
        let half_turn = Twist::from_components([1.0, 0.0, 0.0, 0.0, 0.0, std::f64::consts::PI]);
        let end = half_turn.over(1.0).translation.vector;
        assert!((end - Vector3::new(0.0, 2.0 / std::f64::consts::PI, 0.0)).norm() < 1e-15);
    }
}
