//! Linear and angular velocity, in m/s and rad/s.

use std::ops::Add;
use std::ops::Mul;

use nalgebra::Isometry3;
use nalgebra::Vector3;

/// The velocity of a frame: of its origin, and about it. Written in that frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Velocity of the origin, in m/s.
    pub linear: Vector3<f64>,
    /// Angular velocity, in rad/s.
    pub angular: Vector3<f64>,
}

impl Twist {
    /// At rest.
    pub const ZERO: Self =
        Self { linear: Vector3::new(0.0, 0.0, 0.0), angular: Vector3::new(0.0, 0.0, 0.0) };

    /// From vx, vy, vz, ωx, ωy, ωz.
    pub const fn from_components([vx, vy, vz, wx, wy, wz]: [f64; 6]) -> Self {
        Self { linear: Vector3::new(vx, vy, vz), angular: Vector3::new(wx, wy, wz) }
    }

    /// vx, vy, vz, ωx, ωy, ωz.
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

    /// Each component multiplied by its own gain: a diagonal gain matrix.
    pub fn scaled(&self, gains: &[f64; 6]) -> Self {
        let [vx, vy, vz, wx, wy, wz] = self.components();
        let [a, b, c, d, e, f] = *gains;
        Self::from_components([a * vx, b * vy, c * vz, d * wx, e * wy, f * wz])
    }

    /// The same motion of the same rigid body, taken at the other frame of `x` and written in it:
    /// `v_m = v_s.at(&x_m_s)`.
    pub fn at(&self, x: &Isometry3<f64>) -> Self {
        let angular = x.rotation * self.angular;
        let linear = x.rotation * self.linear + x.translation.vector.cross(&angular);
        Self { linear, angular }
    }
}

impl Add for Twist {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { linear: self.linear + other.linear, angular: self.angular + other.angular }
    }
}

impl Mul<f64> for Twist {
    type Output = Self;

    fn mul(self, scale: f64) -> Self {
        Self { linear: self.linear * scale, angular: self.angular * scale }
    }
}
