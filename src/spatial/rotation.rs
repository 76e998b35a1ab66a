//! Orientations as three numbers: Z-Y-X Euler angles (Craig 1989, 2.8) and rotation vectors.

use nalgebra::Matrix3;
use nalgebra::Rotation3;
use nalgebra::UnitQuaternion;
use nalgebra::Vector3;

/// Below this |cos β| the angles α and γ are one rotation; α is then zero (Craig 1989, 2.8).
const DEGENERATE: f64 = 1e-9;

/// The angles (γ, β, α) of `R = Rz(α) Ry(β) Rx(γ)`, in rad; β within ±π/2.
pub fn euler_zyx(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let r = rotation.to_rotation_matrix();
    let cos_beta = r[(0, 0)].hypot(r[(1, 0)]);
    let beta = (-r[(2, 0)]).atan2(cos_beta);
    if cos_beta < DEGENERATE {
        let gamma = beta.signum() * r[(0, 1)].atan2(r[(1, 1)]);
        return Vector3::new(gamma, beta, 0.0);
    }
    Vector3::new(r[(2, 1)].atan2(r[(2, 2)]), beta, r[(1, 0)].atan2(r[(0, 0)]))
}

/// The orientation `Rz(α) Ry(β) Rx(γ)` of angles (γ, β, α) in rad.
pub fn from_euler_zyx(angles: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_euler_angles(
        angles.x, angles.y, angles.z,
    ))
}

/// The matrix E of Eq. 5: rates of (γ, β, α) to angular velocity in the turned frame. Its
/// determinant is cos β.
pub fn euler_rates(angles: &Vector3<f64>) -> Matrix3<f64> {
    let (sin_gamma, cos_gamma) = angles.x.sin_cos();
    let (sin_beta, cos_beta) = angles.y.sin_cos();
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

/// The rotation vector (axis times angle, within ±π), in rad. Continuous through every angle but π.
pub fn rotation_vector(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    rotation.scaled_axis()
}
