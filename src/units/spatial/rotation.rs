//! Orientations by three parameters: Z-Y-X Euler angles (Craig 1989, 2.8) and rotation vectors.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::math;

/// Limit of |cos β| below which only one combination of α and γ is defined; α is then zero (Craig 1989, 2.8).
const DEGENERATE: f64 = 1e-9;

/// Returns the angles (γ, β, α) of `R = Rz(α) Ry(β) Rx(γ)`, in rad; β within ±π/2.
pub fn euler_zyx(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let r = rotation.to_rotation_matrix();
    let cos_beta = math::hypot(r[(0, 0)], r[(1, 0)]);
    let beta = math::atan2(-r[(2, 0)], cos_beta);
    if cos_beta < DEGENERATE {
        let gamma = beta.signum() * math::atan2(r[(0, 1)], r[(1, 1)]);
        return Vector3::new(gamma, beta, 0.0);
    }
    Vector3::new(math::atan2(r[(2, 1)], r[(2, 2)]), beta, math::atan2(r[(1, 0)], r[(0, 0)]))
}

/// Returns the orientation `Rz(α) Ry(β) Rx(γ)` of angles (γ, β, α) in rad.
pub fn from_euler_zyx(angles: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_euler_angles(
        angles.x, angles.y, angles.z,
    ))
}

/// Returns the matrix E of Eq. 5, which maps rates of (γ, β, α) to angular velocity in the rotated frame. Its
/// determinant is cos β.
pub fn euler_rates(angles: &Vector3<f64>) -> Matrix3<f64> {
    let (sin_gamma, cos_gamma) = math::sin_cos(angles.x);
    let (sin_beta, cos_beta) = math::sin_cos(angles.y);
    Matrix3::new(
        1.0,
        0.0,
        -sin_beta, //
        0.0,
        cos_gamma,
        cos_beta * sin_gamma, //
        0.0,
        -sin_gamma,
        cos_beta * cos_gamma,
    )
}

/// Returns the rotation vector (axis times angle, within ±π), in rad. Continuous except at π.
pub fn rotation_vector(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    rotation.scaled_axis()
}

/// Angle, in rad, below which series replace the coefficients; the next term is below 1e-16.
const SMALL: f64 = 1e-3;

/// Returns the left Jacobian of SO(3), which maps rates of a rotation vector to angular velocity in the frame rotated
/// *from*. It also gives the translation of a screw motion.
pub fn left_jacobian(vector: &Vector3<f64>) -> Matrix3<f64> {
    let angle = vector.norm();
    let cross = vector.cross_matrix();
    let (first, second) = if angle < SMALL {
        (0.5 - angle * angle / 24.0, 1.0 / 6.0 - angle * angle / 120.0)
    } else {
        let half = math::sin(angle / 2.0) / angle;
        (2.0 * half * half, (angle - math::sin(angle)) / (angle * angle * angle))
    };
    Matrix3::identity() + cross * first + cross * cross * second
}

/// Returns the inverse of [`left_jacobian`], for angles below 2π.
///
/// Its transpose maps angular velocity in the *rotated* frame to rates of the rotation vector. The moment conjugate to a
/// rotation vector is this matrix times the work per rad.
pub fn left_jacobian_inverse(vector: &Vector3<f64>) -> Matrix3<f64> {
    let angle = vector.norm();
    let cross = vector.cross_matrix();
    let second = if angle < SMALL {
        1.0 / 12.0 + angle * angle / 720.0
    } else {
        (1.0 / angle - 0.5 / math::tan(angle / 2.0)) / angle
    };
    Matrix3::identity() - cross * 0.5 + cross * cross * second
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use proptest::prelude::*;

    use super::*;

    fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-size..size).prop_map(Vector3::from)
    }

    proptest! {
        #[test]
        fn euler_angles_give_their_orientation(r in vector(3.0)) {
            let rotation = UnitQuaternion::from_scaled_axis(r);
            let again = from_euler_zyx(&euler_zyx(&rotation));
            prop_assert!(rotation.angle_to(&again) < 1e-7);
        }

        #[test]
        fn euler_angles_within_range_are_recovered(
            gamma in -3.1..3.1_f64, beta in -1.5..1.5_f64, alpha in -3.1..3.1_f64
        ) {
            let angles = Vector3::new(gamma, beta, alpha);
            prop_assert!((euler_zyx(&from_euler_zyx(&angles)) - angles).norm() < 1e-12);
        }

        #[test]
        fn rotation_vectors_within_pi_are_recovered(r in vector(1.8)) {
            let again = rotation_vector(&UnitQuaternion::from_scaled_axis(r));
            prop_assert!((again - r).norm() < 1e-12);
        }

        #[test]
        fn determinant_of_euler_rates_is_cos_beta(angles in vector(1.5)) {
            prop_assert!((euler_rates(&angles).determinant() - math::cos(angles.y)).abs() < 1e-14);
        }

        #[test]
        fn euler_rates_are_the_derivative_of_the_orientation(
            angles in vector(1.4), rates in vector(1.0)
        ) {
            let step = 1e-6;
            let before = from_euler_zyx(&(angles - rates * step));
            let after = from_euler_zyx(&(angles + rates * step));
            let omega = rotation_vector(&(before.inverse() * after)) / (2.0 * step);
            prop_assert!((omega - euler_rates(&angles) * rates).norm() < 1e-8);
        }

        #[test]
        fn left_jacobian_is_the_derivative_of_the_orientation(
            r in vector(1.7), rates in vector(1.0)
        ) {
            let step = 1e-6;
            let before = UnitQuaternion::from_scaled_axis(r - rates * step);
            let after = UnitQuaternion::from_scaled_axis(r + rates * step);
            let omega = rotation_vector(&(after * before.inverse())) / (2.0 * step);
            prop_assert!((omega - left_jacobian(&r) * rates).norm() < 1e-8);
        }

        #[test]
        fn left_jacobian_inverse_inverts(r in vector(1.7), scale in 0.0..1.0_f64) {
            let r = r * math::powf(scale, 8.0);
            let product = left_jacobian(&r) * left_jacobian_inverse(&r);
            prop_assert!((product - Matrix3::identity()).norm() < 1e-12);
        }
    }

    #[test]
    fn alpha_is_zero_at_the_singularity() {
        for (gamma, beta, alpha) in [(0.5, FRAC_PI_2, 0.2), (0.5, -FRAC_PI_2, 0.2)] {
            let rotation = from_euler_zyx(&Vector3::new(gamma, beta, alpha));
            let angles = euler_zyx(&rotation);
            assert!(angles.z.abs() < 1e-15 && (angles.y - beta).abs() < 1e-7);
            assert!(rotation.angle_to(&from_euler_zyx(&angles)) < 1e-7);
        }
    }

    #[test]
    fn property_04_half_turn_has_a_rotation_vector() {
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let r = rotation_vector(&UnitQuaternion::from_scaled_axis(axis * PI));
            assert!((r.norm() - PI).abs() < 1e-12 && r.cross(&axis).norm() < 1e-12);
            assert!(left_jacobian_inverse(&r).iter().all(|entry| entry.is_finite()));
        }
    }
}
