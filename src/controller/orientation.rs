//! Parametrisation of a relative orientation by three parameters (Eq. 4), with the commanded angular velocity (Eq. 5)
//! and the conjugate moment (Eq. 8). Decisions 3, 4 and 15; [`rotation`] has the conversions.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{UnitQuaternion, Vector3};

use units::math;
use units::spatial::rotation;

/// Distance from the singularity at which commands are held, in rad (decision 4): 10°.
const MARGIN: f64 = PI / 18.0;

/// Parametrisation of an orientation by three parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Orientation {
    /// Z-Y-X Euler angles in the order γ, β, α, as in the paper. Singular at β = ±90°; commands are held beyond 80°.
    #[default]
    EulerZyx,
    /// Rotation vector. Discontinuous at 180°; commands are held beyond 170°.
    RotationVector,
}

impl Orientation {
    /// Converts an orientation to its parameters, in rad.
    pub fn numbers(self, rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
        match self {
            Self::EulerZyx => rotation::euler_zyx(rotation),
            Self::RotationVector => rotation::rotation_vector(rotation),
        }
    }

    /// Converts parameters in rad to an orientation.
    pub fn rotation(self, numbers: &Vector3<f64>) -> UnitQuaternion<f64> {
        match self {
            Self::EulerZyx => rotation::from_euler_zyx(numbers),
            Self::RotationVector => UnitQuaternion::from_scaled_axis(*numbers),
        }
    }

    /// Returns the angular velocity at parameter rates equal to `numbers`, written in the rotated frame, in rad/s for a gain
    /// of 1/s (Eq. 5, decision 5).
    pub fn rate(self, numbers: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::EulerZyx => rotation::euler_rates(numbers) * numbers,
            Self::RotationVector => *numbers,
        }
    }

    /// Returns the moment about the rotated axes, in N·m, that does the same work as `conjugate`, in N·m per rad, on the
    /// parameters (decision 15). The components of `conjugate` themselves would generate energy on closed paths.
    ///
    /// Within 10° of the singularity the moment decreases to zero, and the work is no longer equal.
    pub fn moment(self, conjugate: &Vector3<f64>, numbers: &Vector3<f64>) -> Vector3<f64> {
        let share = self.share(numbers);
        let exact = match self {
            Self::EulerZyx => euler_moment(conjugate, numbers),
            Self::RotationVector => rotation::left_jacobian_inverse(numbers) * conjugate,
        };
        exact * (share * share)
    }

    /// Returns whether the parameters are at least 10° from their singularity, and may command (decision 4).
    pub fn is_within(self, numbers: &Vector3<f64>) -> bool {
        self.share(numbers) >= 1.0
    }

    /// Returns 1 outside the margin of 10°, decreasing to 0 at the singularity.
    fn share(self, numbers: &Vector3<f64>) -> f64 {
        let room = match self {
            Self::EulerZyx => FRAC_PI_2 - numbers.y.abs(),
            Self::RotationVector => PI - numbers.norm(),
        };
        (room / MARGIN).clamp(0.0, 1.0)
    }
}

/// Returns `E⁻ᵀ μ`. Its denominator cos β, zero only at β = ±90°, is bounded from below.
fn euler_moment(conjugate: &Vector3<f64>, angles: &Vector3<f64>) -> Vector3<f64> {
    let (sin_gamma, cos_gamma) = math::sin_cos(angles.x);
    let (sin_beta, cos_beta) = math::sin_cos(angles.y);
    let about_alpha = (conjugate.z + conjugate.x * sin_beta) / cos_beta.max(1e-9);
    Vector3::new(
        conjugate.x,
        conjugate.y * cos_gamma + about_alpha * sin_gamma,
        about_alpha * cos_gamma - conjugate.y * sin_gamma,
    )
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const BOTH: [Orientation; 2] = [Orientation::EulerZyx, Orientation::RotationVector];

    fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-size..size).prop_map(Vector3::from)
    }

    proptest! {
        #[test]
        fn the_numbers_name_the_orientation(r in vector(3.0)) {
            let rotation = UnitQuaternion::from_scaled_axis(r);
            for orientation in BOTH {
                let again = orientation.rotation(&orientation.numbers(&rotation));
                prop_assert!(rotation.angle_to(&again) < 1e-7);
            }
        }

        #[test]
        fn the_moment_does_the_work_of_the_numbers(
            numbers in vector(1.3), conjugate in vector(1.0), omega in vector(1.0)
        ) {
            // For a small rotation, the work of the moment equals that of the conjugate on the change.
            let step = 1e-6;
            for orientation in BOTH {
                let rotation = orientation.rotation(&numbers);
                let turned = |by: f64| {
                    orientation.numbers(&(rotation * UnitQuaternion::from_scaled_axis(omega * by)))
                };
                let change = (turned(step) - turned(-step)) / (2.0 * step);
                let work = orientation.moment(&conjugate, &numbers).dot(&omega);
                prop_assert!((work - conjugate.dot(&change)).abs() < 1e-6);
            }
        }

        #[test]
        fn the_rate_of_a_turn_about_its_own_axis_is_the_turn(angle in -1.3..1.3_f64) {
            for orientation in BOTH {
                for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
                    prop_assert!((orientation.rate(&(axis * angle)) - axis * angle).norm() < 1e-14);
                }
            }
        }
    }

    #[test]
    fn property_04_the_moment_has_no_step_where_the_numbers_jump() {
        let mu = Vector3::new(0.3, -0.2, 0.1);
        let around = |y: f64| UnitQuaternion::from_scaled_axis(Vector3::new(0.0, y, 0.0));
        for (orientation, jump) in
            [(Orientation::EulerZyx, FRAC_PI_2), (Orientation::RotationVector, PI)]
        {
            let moment = |y: f64| {
                let numbers = orientation.numbers(&around(y));
                let signs = numbers.map(f64::signum);
                orientation.moment(&mu.component_mul(&signs), &numbers)
            };
            let (before, after) = (moment(jump - 1e-6), moment(jump + 1e-6));
            assert!((before - after).norm() < 1e-3, "{orientation:?}: {before} then {after}");
            assert!(!orientation.is_within(&orientation.numbers(&around(jump - MARGIN / 2.0))));
            assert!(orientation.is_within(&orientation.numbers(&around(jump - MARGIN * 1.1))));
        }
    }

    #[test]
    fn moment_is_bounded_at_every_pitch() {
        // One parameter at its plateau of 1, and two.
        for (conjugate, most) in
            [(Vector3::new(0.0, 0.0, 1.0), 5.76), (Vector3::new(1.0, 0.0, 1.0), 11.5)]
        {
            let moment = |degrees: f64| {
                let numbers = Vector3::new(0.3, degrees.to_radians(), 0.2);
                Orientation::EulerZyx.moment(&conjugate, &numbers).norm()
            };
            let highest =
                (0..=9_000).map(|step| moment(f64::from(step) * 1e-2)).fold(0.0, f64::max);
            assert!(highest <= most && highest > 0.99 * most, "{highest}");
            assert!((moment(80.0) - highest).abs() < 1e-9, "the highest is at 80°");
        }
        let one = |degrees: f64| {
            let numbers = Vector3::new(0.3, degrees.to_radians(), 0.2);
            Orientation::EulerZyx.moment(&Vector3::z(), &numbers).norm()
        };
        // 1/cos β up to 80°, less beyond: the plateau at 88.25°, zero at 90°.
        assert!((one(60.0) - 2.0).abs() < 1e-9);
        assert!((one(88.0) - 1.146).abs() < 1e-3 && (one(88.25) - 1.0).abs() < 5e-3);
        assert!((1..=170).all(|step| one(88.3 + 1e-2 * f64::from(step)) < 1.0));
        assert!(one(90.0) < 1e-9);
    }

    #[test]
    fn round_a_closed_loop_the_moment_gives_off_no_work() {
        // The loop of the oracle `euler_moment_loop_work`; a constant conjugate, as on the plateau.
        let phi = |t: f64| {
            Vector3::new(0.5, 0.6, 0.5)
                + Vector3::new(math::cos(t), math::sin(t), math::sin(2.0 * t)) * 0.35
        };
        let mu = Vector3::new(-0.3, -0.3, -0.3);
        let (mut conjugate, mut literal) = (0.0, 0.0);
        let steps = 20_000;
        for step in 0..steps {
            let at = |part: f64| 2.0 * PI * (f64::from(step) + part) / f64::from(steps);
            let orientation = Orientation::EulerZyx;
            let (from, to) =
                (orientation.rotation(&phi(at(0.0))), orientation.rotation(&phi(at(1.0))));
            let turn = rotation::rotation_vector(&(from.inverse() * to));
            conjugate += orientation.moment(&mu, &phi(at(0.5))).dot(&turn);
            literal += mu.dot(&turn);
        }
        assert!(conjugate.abs() < 1e-6, "{conjugate} J from nowhere");
        assert!((literal - 0.165_576_786).abs() < 1e-4, "as components it gives off {literal} J");
    }
}
