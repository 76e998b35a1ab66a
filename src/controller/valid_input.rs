//! Validation of the inputs of a cycle.
//!
//! An invalid value is replaced by a safe one and reported as an [`InvalidValue`]; later equations do not check again. The
//! node checks the age of inputs.

use nalgebra::Isometry3;

use crate::arm::is_pose;
use crate::{Input, InvalidValue};
use units::spatial::Wrench;

/// Maximum valid component of a sensed wrench, in N or N·m.
const MAX_READING: f64 = 1e5;

/// Input with invalid values replaced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ValidInput {
    /// Sensed wrench at {S}; zero in place of an invalid one.
    pub(crate) f_s: Wrench,
    /// Pose of the object, or the last valid one.
    pub(crate) x_b_m: Isometry3<f64>,
    /// Share of gravity compensation, 0 to 1.
    pub(crate) gravity_share: f64,
    /// Share of reflection, 0 to 1.
    pub(crate) reflection_share: f64,
    /// Most severe invalid value.
    pub(crate) invalid_value: Option<InvalidValue>,
}

impl ValidInput {
    /// Validates an input; `x_b_before` is the last valid pose of the object.
    pub(crate) fn from_input(input: &Input, x_b_before: &Isometry3<f64>) -> Self {
        let (f_s, invalid_wrench) = match largest(&input.f_s) {
            size if size <= MAX_READING => (input.f_s, None),
            size if size.is_finite() => (Wrench::ZERO, Some(InvalidValue::WrenchTooLarge)),
            _ => (Wrench::ZERO, Some(InvalidValue::WrenchNotFinite)),
        };
        let (x_b_m, invalid_pose) = if is_pose(&input.x_b_m) {
            (input.x_b_m, None)
        } else {
            (*x_b_before, Some(InvalidValue::ObjectPoseNotFinite))
        };
        let (gravity_share, invalid_gravity) = share(input.gravity_share);
        let (reflection_share, invalid_reflection) = share(input.reflection_share);
        let invalid_value =
            invalid_wrench.or(invalid_pose).or(invalid_gravity).or(invalid_reflection);
        Self { f_s, x_b_m, gravity_share, reflection_share, invalid_value }
    }
}

/// Returns the maximum magnitude of a component; NaN if one is not finite.
fn largest(wrench: &Wrench) -> f64 {
    if wrench.is_finite() {
        wrench.components().iter().fold(0.0, |size: f64, part| size.max(part.abs()))
    } else {
        f64::NAN
    }
}

/// Returns a share within 0 and 1; zero and an [`InvalidValue`] if it is out of range.
fn share(value: f64) -> (f64, Option<InvalidValue>) {
    if (0.0..=1.0).contains(&value) {
        (value, None)
    } else {
        (0.0, Some(InvalidValue::ShareOutOfRange))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::switches::{CommandMode, Switches};
    use units::drive::Counts;

    fn input() -> Input {
        Input {
            counts: [Counts(0); 6],
            f_s: Wrench::from_components([1.0, -2.0, 3.0, 0.1, 0.2, -0.3]),
            x_b_m: Isometry3::translation(0.1, 0.2, 0.3),
            switches: Switches::default(),
            mode: CommandMode::Rate,
            gravity_share: 0.5,
            reflection_share: 0.25,
            hold: false,
            held: None,
            restart: false,
        }
    }

    fn before() -> Isometry3<f64> {
        Isometry3::translation(9.0, 0.0, 0.0)
    }

    /// Returns the invalid value of an input, and asserts that each invalid value was replaced.
    fn invalid_value(input: &Input) -> Option<InvalidValue> {
        ValidInput::from_input(input, &before()).invalid_value
    }

    #[test]
    fn input_of_numbers_is_taken_as_it_is() {
        let trusted = ValidInput::from_input(&input(), &before());
        assert_eq!((trusted.f_s, trusted.x_b_m), (input().f_s, input().x_b_m));
        assert_eq!((trusted.gravity_share, trusted.reflection_share), (0.5, 0.25));
        assert_eq!(trusted.invalid_value, None);
    }

    #[test]
    fn wrench_at_the_largest_reading_is_taken_and_beyond_it_is_zero() {
        for place in 0..6 {
            for sign in [1.0, -1.0] {
                let reads = |value: f64| {
                    let mut parts = [0.0; 6];
                    parts[place] = sign * value;
                    Input { f_s: Wrench::from_components(parts), ..input() }
                };
                let largest = ValidInput::from_input(&reads(MAX_READING), &before());
                assert_eq!((largest.f_s, largest.invalid_value), (reads(MAX_READING).f_s, None));
                let beyond = ValidInput::from_input(&reads(MAX_READING * 1.001), &before());
                assert_eq!(beyond.f_s, Wrench::ZERO);
                assert_eq!(beyond.invalid_value, Some(InvalidValue::WrenchTooLarge));
                let infinite = ValidInput::from_input(&reads(f64::INFINITY), &before());
                assert_eq!(infinite.f_s, Wrench::ZERO);
                assert_eq!(infinite.invalid_value, Some(InvalidValue::WrenchNotFinite));
            }
        }
    }

    #[test]
    fn invalid_pose_leaves_the_one_before() {
        let nowhere = Input { x_b_m: Isometry3::translation(f64::NAN, 0.0, 0.0), ..input() };
        let trusted = ValidInput::from_input(&nowhere, &before());
        assert_eq!(
            (trusted.x_b_m, trusted.invalid_value),
            (before(), Some(InvalidValue::ObjectPoseNotFinite))
        );
    }

    #[test]
    fn wrench_is_named_before_pose_and_shares() {
        let x_b_m = Isometry3::translation(f64::NAN, 0.0, 0.0);
        let f_s = Wrench::from_components([f64::NAN; 6]);
        let all = Input { f_s, x_b_m, gravity_share: 2.0, reflection_share: 2.0, ..input() };
        assert_eq!(invalid_value(&all), Some(InvalidValue::WrenchNotFinite));
        assert_eq!(
            invalid_value(&Input { f_s: input().f_s, ..all }),
            Some(InvalidValue::ObjectPoseNotFinite)
        );
        let shares = Input { f_s: input().f_s, x_b_m: input().x_b_m, ..all };
        assert_eq!(invalid_value(&shares), Some(InvalidValue::ShareOutOfRange));
    }

    proptest! {
        #[test]
        fn share_outside_0_to_1_is_zero_and_invalid(value in any::<f64>()) {
            let is_share = (0.0..=1.0).contains(&value);
            let used = if is_share { value } else { 0.0 };
            let gravity = ValidInput::from_input(&Input { gravity_share: value, ..input() }, &before());
            prop_assert_eq!((gravity.gravity_share, gravity.reflection_share), (used, 0.25));
            let felt = ValidInput::from_input(&Input { reflection_share: value, ..input() }, &before());
            prop_assert_eq!((felt.gravity_share, felt.reflection_share), (0.5, used));
            prop_assert_eq!((gravity.invalid_value.is_none(), felt.invalid_value.is_none()), (is_share, is_share));
        }
    }
}
