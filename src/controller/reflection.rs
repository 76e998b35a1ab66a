//! The wrench on the object, felt at the grip (3.2, Eq. 6).
//!
//! Not the removal of the payload, which the commanded side does. A wrench is what the environment
//! exerts *on* the object; the hand is pushed the same way. The gain is applied at {MRF} and its
//! result taken for the wrench at the grip, along the grip's own axes (decisions 9, 10 and 30).

use nalgebra::Isometry3;
use thiserror::Error;

use crate::arm::is_pose;
use crate::gains::Gains;
use units::spatial::Wrench;

/// From the sensor to the grip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflection {
    x_m_s: Isometry3<f64>,
    gain: Gains,
    max_force: f64,
    max_moment: f64,
}

/// Why a wrench cannot be reflected so.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidReflection {
    /// The sensor's place on the object.
    #[error("the pose of the sensor in the frame under control is not finite")]
    Sensor,
    /// Limit of force or moment at the grip.
    #[error("the maximum {quantity} at the grip must be positive and finite, got {value}")]
    Limit {
        /// Force or moment.
        quantity: &'static str,
        /// The value given, in N or N·m.
        value: f64,
    },
}

impl Reflection {
    /// From the sensor's pose on the object, K_T, and the most a hand may feel in N and N·m.
    ///
    /// # Errors
    /// An invalid pose, or a limit that is not positive and finite.
    pub fn new(
        x_m_s: Isometry3<f64>,
        gain: Gains,
        max_force: f64,
        max_moment: f64,
    ) -> Result<Self, InvalidReflection> {
        if !is_pose(&x_m_s) {
            return Err(InvalidReflection::Sensor);
        }
        for (quantity, value) in [("force", max_force), ("moment", max_moment)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(InvalidReflection::Limit { quantity, value });
            }
        }
        Ok(Self { x_m_s, gain, max_force, max_moment })
    }

    /// Returns the same with another K_T.
    #[must_use]
    pub const fn with_gain(self, gain: Gains) -> Self {
        Self { gain, ..self }
    }

    /// Pose of the sensor in {MRF}.
    pub const fn sensor(&self) -> &Isometry3<f64> {
        &self.x_m_s
    }

    /// The most force at the grip, in N.
    pub const fn max_force(&self) -> f64 {
        self.max_force
    }

    /// K_T.
    pub const fn gain(&self) -> &Gains {
        &self.gain
    }

    /// The wrench at the frame under control (Eq. 6).
    pub fn at_object(&self, f_s: &Wrench) -> Wrench {
        f_s.at(&self.x_m_s)
    }

    /// Scales a wrench at {MRF} to the grip: by K_T, then as a whole to at most the limits.
    pub fn at_grip(&self, f_m: &Wrench) -> Wrench {
        let f_g = f_m.scaled(self.gain.values());
        let excess = (f_g.force.norm() / self.max_force).max(f_g.moment.norm() / self.max_moment);
        f_g * excess.max(1.0).recip()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn reflection() -> Reflection {
        let gain = Gains::new([0.5, 0.5, 0.5, 0.25, 0.25, 0.25], "K_T").unwrap();
        Reflection::new(Isometry3::translation(0.0, 0.0, 0.1), gain, 40.0, 4.0).unwrap()
    }

    proptest! {
        #[test]
        fn a_hand_feels_the_direction_and_never_more_than_it_may(
            f in prop::array::uniform6(-1e5..1e5_f64)
        ) {
            let f_m = Wrench::from_components(f);
            let f_g = reflection().at_grip(&f_m);
            prop_assert!(f_g.force.norm() <= 40.0 * (1.0 + 1e-12));
            prop_assert!(f_g.moment.norm() <= 4.0 * (1.0 + 1e-12));
            prop_assert!(f_g.force.cross(&f_m.force).norm() <= 1e-9 * f_m.force.norm() * 40.0);
            prop_assert!(f_g.force.dot(&f_m.force) >= 0.0);
        }
    }

    #[test]
    fn a_small_wrench_is_only_scaled() {
        let f_m = Wrench::from_components([2.0, 4.0, 6.0, 0.4, 0.8, 1.2]);
        let f_g = Wrench::from_components([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]);
        assert_eq!(reflection().at_grip(&f_m), f_g);
    }

    #[test]
    fn without_contact_nothing_is_felt() {
        let reflection = reflection();
        assert_eq!(reflection.at_grip(&reflection.at_object(&Wrench::ZERO)), Wrench::ZERO);
    }

    #[test]
    fn a_limit_is_positive_and_finite() {
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let x_m_s = Isometry3::identity();
            assert!(Reflection::new(x_m_s, Gains::ZERO, wrong, 1.0).is_err());
            assert!(Reflection::new(x_m_s, Gains::ZERO, 1.0, wrong).is_err());
        }
        let nowhere = Isometry3::translation(f64::NAN, 0.0, 0.0);
        let error = Reflection::new(nowhere, Gains::ZERO, 1.0, 1.0).unwrap_err();
        assert_eq!(error, InvalidReflection::Sensor);
    }
}
