//! Wrench reflection: from the wrench on the object to that at the grip (3.2, Eq. 6).
//!
//! Wrenches are those of the environment *on* the object; the hand is pushed in the same direction. The commanded side
//! has already removed the payload. The gain applies at {MRF}, and its result is the wrench at the grip, along the axes
//! of the grip (decisions 9, 10 and 30).

use nalgebra::Isometry3;
use thiserror::Error;

use crate::arm::is_pose;
use crate::gains::Gains;
use units::spatial::Wrench;

/// Transformation, gain and limits of reflection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflection {
    x_m_s: Isometry3<f64>,
    gain: Gains,
    max_force: f64,
    max_moment: f64,
}

/// Reason why parameters of reflection are invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidReflection {
    /// Pose of the sensor in {MRF} is not finite.
    #[error("the pose of the sensor in the frame under control is not finite")]
    Sensor,
    /// Limit at the grip is not positive and finite.
    #[error("the maximum {quantity} at the grip must be positive and finite, got {value}")]
    Limit {
        /// `force` or `moment`.
        quantity: &'static str,
        /// Rejected value, in N or N·m.
        value: f64,
    },
}

impl Reflection {
    /// Creates a reflection from the sensor's pose in {MRF}, K_T, and the maximum force and moment at the grip in N and N·m.
    ///
    /// # Errors
    /// Returns an error for an invalid pose, or a limit that is not positive and finite.
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

    /// Replaces K_T.
    #[must_use]
    pub const fn with_gain(self, gain: Gains) -> Self {
        Self { gain, ..self }
    }

    /// Pose of the sensor in {MRF}.
    pub const fn sensor(&self) -> &Isometry3<f64> {
        &self.x_m_s
    }

    /// Maximum force at the grip, in N.
    pub const fn max_force(&self) -> f64 {
        self.max_force
    }

    /// K_T: wrench at the grip per wrench at {MRF}.
    pub const fn gain(&self) -> &Gains {
        &self.gain
    }

    /// Transforms a sensed wrench from {S} to {MRF} (Eq. 6).
    pub fn at_object(&self, f_s: &Wrench) -> Wrench {
        f_s.at(&self.x_m_s)
    }

    /// Multiplies a wrench at {MRF} by K_T, then scales it to the limits of force and moment, keeping its direction.
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
