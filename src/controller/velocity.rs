//! Velocity of the grip, by difference to the last cycle.
//!
//! The drives do not send joint rates. An optional first-order low pass smooths the quantisation of the encoders;
//! without it, the estimate is the difference itself (decision 19). After a gap the estimate restarts at zero.

use nalgebra::{Isometry3, SVector, Vector3};
use thiserror::Error;

use crate::period::Period;
use units::spatial::{Twist, rotation};

/// Time constant out of range, in s.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("the velocity filter must be within 0..=1 s, got {0}")]
pub struct InvalidFilter(pub f64);

/// Time constant of a first-order low pass on velocities, in s. Zero, the default, disables the filter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Filter(f64);

impl Filter {
    /// Creates a filter with this time constant; zero disables it.
    ///
    /// # Errors
    /// Returns an error if the time constant is not within 0 and 1 s.
    pub fn new(seconds: f64) -> Result<Self, InvalidFilter> {
        if (0.0..=1.0).contains(&seconds) { Ok(Self(seconds)) } else { Err(InvalidFilter(seconds)) }
    }

    /// Returns the time constant, in s.
    pub const fn seconds(self) -> f64 {
        self.0
    }
}

/// Joint rates by difference to the last cycle, unfiltered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointRates<const N: usize> {
    period: Period,
    q_before: Option<SVector<f64, N>>,
}

impl<const N: usize> JointRates<N> {
    /// Creates an estimator without a last position: the first rates are zero.
    pub const fn new(period: Period) -> Self {
        Self { period, q_before: None }
    }

    /// Returns the joint rates since the last cycle, in rad/s or m/s; zero with `restart`.
    pub fn update(&mut self, q: &SVector<f64, N>, restart: bool) -> SVector<f64, N> {
        let q_before = self.q_before.replace(*q).filter(|_| !restart).unwrap_or(*q);
        (q - q_before) / self.period.seconds()
    }
}

/// Estimator of the grip's twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Velocity {
    period: f64,
    /// Weight of a new difference, `T / (T + τ)`; 1 without a filter.
    part: f64,
    x_0_before: Option<Isometry3<f64>>,
    linear_in_0: Vector3<f64>,
    angular: Vector3<f64>,
}

/// Twist of the grip in {G}, unfiltered and filtered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GripTwist {
    /// Unfiltered difference, for work and power.
    pub v_g_raw: Twist,
    /// Filtered estimate, for damping.
    pub v_g: Twist,
}

impl Velocity {
    /// Creates an estimator at rest. The low pass is discretised by backward Euler.
    pub fn new(period: Period, filter: Filter) -> Self {
        let period = period.seconds();
        Self {
            period,
            part: period / (period + filter.seconds()),
            x_0_before: None,
            linear_in_0: Vector3::zeros(),
            angular: Vector3::zeros(),
        }
    }

    /// Returns the twist since the last cycle. `restart` resets the estimate to zero: after a gap the last motion took
    /// longer than a cycle.
    pub fn update(&mut self, x_0_g: &Isometry3<f64>, restart: bool) -> GripTwist {
        let last = self.x_0_before.replace(*x_0_g).filter(|_| !restart);
        let r_g_0 = x_0_g.rotation.inverse();
        let Some(x_0_before) = last else {
            (self.linear_in_0, self.angular) = (Vector3::zeros(), Vector3::zeros());
            return GripTwist::default();
        };
        let moved_in_0 = x_0_g.translation.vector - x_0_before.translation.vector;
        let turned = rotation::rotation_vector(&(x_0_before.rotation.inverse() * x_0_g.rotation));
        let (linear_in_0, angular) = (moved_in_0 / self.period, turned / self.period);
        self.linear_in_0 += (linear_in_0 - self.linear_in_0) * self.part;
        self.angular += (angular - self.angular) * self.part;
        GripTwist {
            v_g_raw: Twist { linear: r_g_0 * linear_in_0, angular },
            v_g: Twist { linear: r_g_0 * self.linear_in_0, angular: self.angular },
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn period(seconds: f64) -> Period {
        Period::new(seconds).unwrap()
    }

    fn filter(seconds: f64) -> Filter {
        Filter::new(seconds).unwrap()
    }

    fn pose() -> impl Strategy<Value = Isometry3<f64>> {
        prop::array::uniform6(-0.7..0.7_f64)
            .prop_map(|[x, y, z, a, b, c]| Isometry3::new([x, y, z].into(), [a, b, c].into()))
    }

    fn twist() -> impl Strategy<Value = Twist> {
        prop::array::uniform6(-1.0..1.0_f64).prop_map(Twist::from_components)
    }

    proptest! {
        #[test]
        fn a_steady_motion_is_found_filtered_or_not(x_0_g in pose(), v_g in twist()) {
            for (time_constant, cycles) in [(0.0, 2), (0.005, 200)] {
                let mut velocity = Velocity::new(period(1e-3), filter(time_constant));
                let mut twist = GripTwist::default();
                let mut x_0_now = x_0_g;
                for _ in 0..cycles {
                    twist = velocity.update(&x_0_now, false);
                    x_0_now *= v_g.over(1e-3);
                }
                for found in [twist.v_g_raw, twist.v_g] {
                    for (found, true_) in found.components().iter().zip(v_g.components()) {
                        prop_assert!((found - true_).abs() < 0.02, "{found} for {true_}");
                    }
                }
            }
        }

        #[test]
        fn the_cycle_does_not_matter(x_0_g in pose(), v_g in twist()) {
            let measured = |seconds: f64| {
                let mut velocity = Velocity::new(period(seconds), filter(0.0));
                velocity.update(&(x_0_g * (v_g * -1.0).over(seconds)), false);
                velocity.update(&x_0_g, false).v_g.components()
            };
            for (fast, slow) in measured(1e-4).iter().zip(measured(2e-4)) {
                prop_assert!((fast - slow).abs() < 1e-3, "{fast} at 10 kHz, {slow} at 5 kHz");
            }
        }

        #[test]
        fn a_gap_is_no_motion(x_0_g in pose(), elsewhere in pose()) {
            let mut velocity = Velocity::new(period(1e-3), filter(0.01));
            prop_assert_eq!(velocity.update(&elsewhere, false), GripTwist::default());
            velocity.update(&x_0_g, false);
            prop_assert_eq!(velocity.update(&elsewhere, true), GripTwist::default());
            let GripTwist { v_g_raw, v_g } = velocity.update(&elsewhere, false);
            for still in [v_g_raw, v_g] {
                prop_assert!(still.components().iter().all(|part| part.abs() < 1e-9), "{still:?}");
            }
        }
    }

    #[test]
    fn a_filter_takes_a_second_at_most() {
        for wrong in [-1e-3, 1.001, f64::NAN] {
            assert!(Filter::new(wrong).is_err());
        }
        assert!(Filter::new(0.0).is_ok() && Filter::new(1.0).is_ok());
    }
}
