//! Alignment: turns the commanded orientation to the orientation of the grip, in pose mode.
//!
//! The rate profile is a trapezoid with [`ACCELERATION`] and [`MAX_RATE`], at rest on both ends. The axes of {0} and {b}
//! are assumed parallel.

use nalgebra::UnitQuaternion;

use crate::period::Period;

/// Maximum rate of the turn, in rad/s.
const MAX_RATE: f64 = 0.5;

/// Angular acceleration of the turn, in rad/s².
const ACCELERATION: f64 = 1.0;

/// Alignment in progress.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Alignment {
    /// Rate of the last cycle, in rad/s.
    rate: f64,
}

impl Alignment {
    /// Returns the commanded orientation of the next cycle, turned from `r_b_d` towards `r_0_g`, and whether it has reached
    /// `r_0_g`. The grip may turn between calls.
    pub(crate) fn next(
        &mut self,
        period: Period,
        r_b_d: &UnitQuaternion<f64>,
        r_0_g: &UnitQuaternion<f64>,
    ) -> (UnitQuaternion<f64>, bool) {
        let dt = period.seconds();
        let turn = r_b_d.inverse() * r_0_g;
        let Some((axis, angle)) = turn.axis_angle() else { return (*r_0_g, true) };
        let braking = (2.0 * ACCELERATION * angle).sqrt();
        self.rate = (self.rate + ACCELERATION * dt).min(MAX_RATE).min(braking);
        let step = self.rate * dt;
        if step >= angle {
            return (*r_0_g, true);
        }
        (r_b_d * UnitQuaternion::from_axis_angle(&axis, step), false)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    fn period() -> Period {
        Period::new(1e-3).unwrap()
    }

    proptest! {
        #[test]
        fn turn_reaches_the_grip_at_bounded_rate_and_acceleration(
            parts in prop::array::uniform3(-1.0..1.0_f64), size in 0.0..3.1_f64,
        ) {
            let vector = Vector3::from(parts);
            prop_assume!(vector.norm() > 0.1);
            let goal = UnitQuaternion::from_scaled_axis(vector.normalize() * size);
            let (mut alignment, mut r_b_d, mut last) = (Alignment::default(), UnitQuaternion::identity(), 0.0);
            let mut cycles = 0;
            loop {
                let (next, is_done) = alignment.next(period(), &r_b_d, &goal);
                let rate = r_b_d.angle_to(&next) / 1e-3;
                prop_assert!(rate <= MAX_RATE + 1e-9, "{rate}");
                // The last cycle covers the rest.
                prop_assert!((rate - last).abs() <= 2.0 * ACCELERATION * 1e-3 + 1e-9 || is_done, "{rate} {last}");
                (r_b_d, last, cycles) = (next, rate, cycles + 1);
                if is_done {
                    break;
                }
                prop_assert!(cycles < 8_000);
            }
            prop_assert!(r_b_d.angle_to(&goal) < 1e-9);
        }
    }
}
