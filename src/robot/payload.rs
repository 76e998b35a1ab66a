//! Payload between sensor and contact (3.2), and its load on the sensor.
//!
//! The sensor measures contact plus load: weight and inertia (Newton-Euler). With `r` from {S} to the centre of mass, `a`
//! its acceleration and `I` the inertia about it, in {S}:
//!
//! ```text
//!  f = m (g - a)        m_s = r × f - (I α + ω × I ω)
//! ```
//!
//! Subtracting the load leaves the contact (decision 8). If only the weight is subtracted, the inertia of an accelerated
//! payload appears as contact.

use nalgebra::{Isometry3, Matrix3, Vector3};
use thiserror::Error;

use units::spatial::{Twist, Wrench};

/// Maximum mass, in kg, distance of the centre of mass, in m, and inertia, in kg·m².
const MAX_VALUE: f64 = 1e4;

/// Rigid body beyond the sensor {S}.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Payload {
    mass: f64,
    centre_of_mass: Vector3<f64>,
    inertia: Matrix3<f64>,
}

/// Motion of {S}, written in {S}.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorMotion {
    /// Linear and angular velocity, in m/s and rad/s.
    pub v_s: Twist,
    /// Rate of change of the twist's components, in m/s² and rad/s².
    pub v_dot_s: Twist,
}

/// Reason why a payload is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidPayload {
    /// Mass out of range.
    #[error("payload mass must be within 0..={MAX_VALUE} kg, got {0}")]
    Mass(f64),
    /// Centre of mass out of range.
    #[error("payload centre of mass must be within ±{MAX_VALUE} m, got {0}")]
    CentreOfMass(f64),
    /// Inertia out of range, or not positive semidefinite.
    #[error("payload inertia must be that of a body: finite and not negative, got {0:?}")]
    Inertia([f64; 6]),
}

impl Payload {
    /// Creates a point mass from its mass in kg and its centre of mass in {S}, in m.
    ///
    /// # Errors
    /// Returns the first value out of range, or NaN.
    pub fn new(mass: f64, centre_of_mass: [f64; 3]) -> Result<Self, InvalidPayload> {
        if !(0.0..=MAX_VALUE).contains(&mass) {
            return Err(InvalidPayload::Mass(mass));
        }
        let far = centre_of_mass.into_iter().find(|part| !(-MAX_VALUE..=MAX_VALUE).contains(part));
        match far {
            Some(part) => Err(InvalidPayload::CentreOfMass(part)),
            None => {
                Ok(Self { mass, centre_of_mass: centre_of_mass.into(), inertia: Matrix3::zeros() })
            }
        }
    }

    /// Sets the inertia about the centre of mass, xx, yy, zz, xy, xz, yz in {S}, in kg·m².
    ///
    /// # Errors
    /// Returns [`InvalidPayload::Inertia`] for values out of range or NaN, or a tensor that is not positive semidefinite.
    pub fn with_inertia(self, inertia: [f64; 6]) -> Result<Self, InvalidPayload> {
        let [xx, yy, zz, xy, xz, yz] = inertia;
        let matrix = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let is_in_range = inertia.iter().all(|part| part.abs() <= MAX_VALUE);
        if is_in_range && matrix.symmetric_eigenvalues().min() >= -1e-12 {
            Ok(Self { inertia: matrix, ..self })
        } else {
            Err(InvalidPayload::Inertia(inertia))
        }
    }

    /// Returns the mass, in kg.
    pub const fn mass(&self) -> f64 {
        self.mass
    }

    /// Returns the centre of mass in {S}, in m.
    pub const fn centre_of_mass(&self) -> &Vector3<f64> {
        &self.centre_of_mass
    }

    /// Returns the inertia about the centre of mass, in kg·m².
    pub const fn inertia(&self) -> &Matrix3<f64> {
        &self.inertia
    }

    /// Computes the weight at {S}, for a sensor with pose `x_b_s` and gravity in the base, in m/s².
    pub fn weight(&self, x_b_s: &Isometry3<f64>, gravity_in_b: &Vector3<f64>) -> Wrench {
        let force = x_b_s.rotation.inverse() * gravity_in_b * self.mass;
        Wrench { force, moment: self.centre_of_mass.cross(&force) }
    }

    /// Computes weight and inertial load at {S}, for a moving sensor.
    pub fn load(
        &self,
        x_b_s: &Isometry3<f64>,
        gravity_in_b: &Vector3<f64>,
        SensorMotion { v_s, v_dot_s }: &SensorMotion,
    ) -> Wrench {
        let (omega, alpha, r) = (v_s.angular, v_dot_s.angular, self.centre_of_mass);
        let origin = v_dot_s.linear + omega.cross(&v_s.linear);
        let acceleration = origin + alpha.cross(&r) + omega.cross(&omega.cross(&r));
        let force = -acceleration * self.mass;
        let turning = self.inertia * alpha + omega.cross(&(self.inertia * omega));
        let inertial = Wrench { force, moment: r.cross(&force) - turning };
        self.weight(x_b_s, gravity_in_b) + inertial
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

    proptest! {
        #[test]
        fn weight_does_not_depend_on_the_orientation(
            [x, y, z, a, b, c] in prop::array::uniform6(-3.0..3.0_f64)
        ) {
            let payload = Payload::new(1.3, [0.01, -0.02, 0.09]).unwrap();
            let x_b_s = Isometry3::new([x, y, z].into(), [a, b, c].into());
            let f_s = payload.weight(&x_b_s, &DOWN);
            prop_assert!((f_s.force.norm() - 1.3 * 9.81).abs() < 1e-12);
            // A weight has no moment about its own centre of mass.
            let x_c_s = Isometry3::translation(-0.01, 0.02, -0.09);
            prop_assert!(f_s.at(&x_c_s).moment.norm() < 1e-12);
        }

        #[test]
        fn load_takes_the_power_that_the_payload_gains(
            v in prop::array::uniform6(-2.0..2.0_f64), a in prop::array::uniform6(-9.0..9.0_f64)
        ) {
            let payload = Payload::new(1.3, [0.01, -0.02, 0.09]).unwrap();
            let payload = payload.with_inertia([0.004, 0.005, 0.003, 1e-4, 0.0, -2e-4]).unwrap();
            let (v_s, v_dot_s) = (Twist::from_components(v), Twist::from_components(a));
            let kinetic = |v: Twist| {
                let speed = v.linear + v.angular.cross(&payload.centre_of_mass);
                let spin = v.angular.dot(&(payload.inertia * v.angular));
                f64::midpoint(payload.mass * speed.norm_squared(), spin)
            };
            // No gravity. Kinetic energy does not depend on the pose, so its rate follows from the components.
            let step = 1e-6;
            let gained = (kinetic(v_s + v_dot_s * step) - kinetic(v_s + v_dot_s * -step)) / (2.0 * step);
            let moving = SensorMotion { v_s, v_dot_s };
            let f_s = payload.load(&Isometry3::identity(), &Vector3::zeros(), &moving);
            prop_assert!((f_s.power(&v_s) + gained).abs() < 1e-6, "{} {gained}", f_s.power(&v_s));
        }
    }

    #[test]
    fn payload_in_free_fall_has_no_load() {
        let payload = Payload::new(2.0, [0.1, 0.0, 0.0]).unwrap();
        let v_dot_s = Twist { linear: DOWN, ..Twist::ZERO };
        let f_s = payload.load(
            &Isometry3::identity(),
            &DOWN,
            &SensorMotion { v_dot_s, ..SensorMotion::default() },
        );
        assert!(f_s.force.norm() < 1e-12 && f_s.moment.norm() < 1e-12);
    }

    #[test]
    fn default_payload_has_zero_weight() {
        assert_eq!(Payload::default().weight(&Isometry3::identity(), &DOWN), Wrench::ZERO);
    }

    #[test]
    fn invalid_payloads_are_refused() {
        assert_eq!(Payload::new(-1.0, [0.0; 3]), Err(InvalidPayload::Mass(-1.0)));
        assert!(Payload::new(f64::NAN, [0.0; 3]).is_err());
        assert!(Payload::new(1.0, [0.0, f64::INFINITY, 0.0]).is_err());
        assert!(Payload::default().with_inertia([-1.0, 1.0, 1.0, 0.0, 0.0, 0.0]).is_err());
        assert!(Payload::default().with_inertia([f64::NAN; 6]).is_err());
    }
}
