//! The weight between the sensor and what touches the world (3.2).
//!
//! Static: weight and its moment, not inertia (decision 8). The sensor reads the contact and the
//! weight together; what is left without the weight is the contact.

use nalgebra::Isometry3;
use nalgebra::Vector3;
use thiserror::Error;

use units::spatial::Wrench;

/// No payload is heavier, in kg, nor its centre of mass farther away, in m.
const LARGEST: f64 = 1e4;

/// A mass carried beyond the sensor {S}.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Payload {
    mass: f64,
    centre_of_mass: Vector3<f64>,
}

/// Why a payload is none.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidPayload {
    /// Its mass.
    #[error("a mass of {0} kg is not within 0 and {LARGEST}")]
    Mass(f64),
    /// Its centre of mass.
    #[error("a centre of mass at {0} m is not within ±{LARGEST}")]
    CentreOfMass(f64),
}

impl Payload {
    /// From its mass in kg and its centre of mass in {S}, in m.
    ///
    /// # Errors
    /// A mass that is negative, or a number that is none.
    pub fn new(mass: f64, centre_of_mass: [f64; 3]) -> Result<Self, InvalidPayload> {
        if !(0.0..=LARGEST).contains(&mass) {
            return Err(InvalidPayload::Mass(mass));
        }
        let far = centre_of_mass.into_iter().find(|part| !(-LARGEST..=LARGEST).contains(part));
        match far {
            Some(part) => Err(InvalidPayload::CentreOfMass(part)),
            None => Ok(Self { mass, centre_of_mass: centre_of_mass.into() }),
        }
    }

    /// Its weight, at the sensor whose pose is `x_b_s`, in gravity written in the base, m/s².
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
        fn a_payload_weighs_the_same_however_it_is_held(
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
    fn no_payload_weighs_nothing() {
        assert_eq!(Payload::default().weight(&Isometry3::identity(), &DOWN), Wrench::ZERO);
    }

    #[test]
    fn a_payload_has_a_mass_and_a_place() {
        assert_eq!(Payload::new(-1.0, [0.0; 3]), Err(InvalidPayload::Mass(-1.0)));
        assert!(Payload::new(f64::NAN, [0.0; 3]).is_err());
        assert!(Payload::new(1.0, [0.0, f64::INFINITY, 0.0]).is_err());
    }
}
