//! Payload between sensor and contact (3.2).
//!
//! Static: weight and its moment, no inertia (decision 8). The sensor measures contact plus weight; subtracting the
//! weight leaves the contact.

use nalgebra::{Isometry3, Vector3};
use thiserror::Error;

use units::spatial::Wrench;

/// Maximum mass, in kg, and distance of the centre of mass, in m.
const MAX_VALUE: f64 = 1e4;

/// Mass carried beyond the sensor {S}.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Payload {
    mass: f64,
    centre_of_mass: Vector3<f64>,
}

/// Reasons to refuse a payload.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidPayload {
    /// Mass out of range.
    #[error("payload mass must be within 0..={MAX_VALUE} kg, got {0}")]
    Mass(f64),
    /// Centre of mass out of range.
    #[error("payload centre of mass must be within ±{MAX_VALUE} m, got {0}")]
    CentreOfMass(f64),
}

impl Payload {
    /// Creates a payload from its mass in kg and its centre of mass in {S}, in m.
    ///
    /// # Errors
    /// A negative mass, or a value that is too large or NaN.
    pub fn new(mass: f64, centre_of_mass: [f64; 3]) -> Result<Self, InvalidPayload> {
        if !(0.0..=MAX_VALUE).contains(&mass) {
            return Err(InvalidPayload::Mass(mass));
        }
        let far = centre_of_mass.into_iter().find(|part| !(-MAX_VALUE..=MAX_VALUE).contains(part));
        match far {
            Some(part) => Err(InvalidPayload::CentreOfMass(part)),
            None => Ok(Self { mass, centre_of_mass: centre_of_mass.into() }),
        }
    }

    /// Returns its weight at a sensor with pose `x_b_s`, in gravity in the base, in m/s².
    pub fn weight(&self, x_b_s: &Isometry3<f64>, gravity_in_b: &Vector3<f64>) -> Wrench {
        let force = x_b_s.rotation.inverse() * gravity_in_b * self.mass;
        Wrench { force, moment: self.centre_of_mass.cross(&force) }
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
    }
}
