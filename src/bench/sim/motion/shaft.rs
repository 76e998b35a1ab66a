//! Shaft position: the 32-bit encoder count unwrapped, and the home position.
//!
//! The loops use the unwrapped position in increments. 6064h is relative to home, in position units,
//! and wraps.

use crate::motion::units::Units;

/// Values of encoder and current loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Feedback {
    /// Position in increments, 32 bits, wraps.
    pub position: i32,
    /// Position of an index pulse, in increments; there is one per motor revolution.
    pub index: f64,
    /// Velocity, in increments/s.
    pub velocity: f64,
    /// Actual torque, in ‰ of rated torque.
    pub per_mille: f64,
}

/// Shaft of the motor, as the encoder measures it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Shaft {
    pub(super) units: Units,
    /// Last encoder count.
    counts: i32,
    /// Unwrapped position of that count.
    position: f64,
    /// Unwrapped position that reads as zero.
    zero: f64,
}

/// Motor values after range checks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Actual {
    /// Unwrapped position, in increments.
    pub(super) position: f64,
    /// Position of an index pulse, in increments.
    pub(super) index: f64,
    /// Velocity, in increments/s.
    pub(super) velocity: f64,
    /// Torque, in ‰ of rated torque.
    pub(super) per_mille: f64,
}

impl Shaft {
    /// Creates the shaft with zero at that of the encoder.
    pub(super) fn new(units: Units) -> Self {
        Self { units, ..Self::default() }
    }

    /// Takes the feedback; between two calls the encoder moves less than 2³¹ increments.
    pub(super) fn sense(&mut self, feedback: &Feedback) -> Actual {
        let distance = feedback.position.wrapping_sub(self.counts);
        self.counts = feedback.position;
        self.position += f64::from(distance);
        Actual {
            position: self.position,
            index: feedback.index,
            velocity: bounded(feedback.velocity, MAX_VELOCITY),
            per_mille: bounded(feedback.per_mille, MAX_TORQUE),
        }
    }

    /// Converts an unwrapped position to position units.
    pub(super) fn position_units(&self, position: f64) -> i32 {
        self.units.shown(position - self.zero)
    }

    /// Converts position units to the unwrapped position in the same turn of the counter as `here`. The axis is
    /// linear (60F2h, bits 6 and 7, absent).
    pub(super) fn linear_target(&self, here: f64, units: f64) -> f64 {
        here + self.units.increments(units - f64::from(self.position_units(here))) - self.rest(here)
    }

    /// Converts position units to the unwrapped position nearest to `here`, across a wrap if need be.
    pub(super) fn nearest_target(&self, here: f64, units: i32) -> f64 {
        let distance = units.wrapping_sub(self.position_units(here));
        here + self.units.increments(f64::from(distance)) - self.rest(here)
    }

    /// Sets home: from now on `position` reads as `units`.
    pub(super) fn set_home(&mut self, position: f64, units: f64) {
        self.zero = position - self.units.increments(units);
    }

    /// Returns the remainder of `position` beyond an integral number of position units, in increments.
    fn rest(&self, position: f64) -> f64 {
        let shown = self.units.position_units(position - self.zero);
        self.units.increments(shown - shown.round())
    }
}

/// Velocity limit of the feedback, in increments/s.
const MAX_VELOCITY: f64 = 1e12;
/// Torque limit of the feedback, in ‰.
const MAX_TORQUE: f64 = 1e6;

/// Returns `number` within the bound, 0 for NaN.
const fn bounded(number: f64, bound: f64) -> f64 {
    if number.is_nan() { 0.0 } else { number.clamp(-bound, bound) }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "whole numbers are exact, and limits are kept exactly")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(position: i32) -> Feedback {
        Feedback { position, ..Feedback::default() }
    }

    #[test]
    fn nan_and_infinite_feedback_is_bounded() {
        let mut shaft = Shaft::default();
        for (nonsense, taken) in
            [(f64::NAN, 0.0), (f64::INFINITY, MAX_VELOCITY), (f64::NEG_INFINITY, -MAX_VELOCITY)]
        {
            let actual = shaft.sense(&Feedback { velocity: nonsense, ..Feedback::default() });
            assert_eq!(actual.velocity, taken);
        }
    }

    #[test]
    fn wrap_is_crossed_by_the_nearest_target_only() {
        let mut shaft = Shaft::default();
        let here = shaft.sense(&at(i32::MAX)).position;
        assert_eq!(shaft.nearest_target(here, i32::MIN) - here, 1.0);
        assert_eq!(shaft.linear_target(here, f64::from(i32::MIN)) - here, -4_294_967_295.0);
    }

    proptest! {
        #[test]
        fn counter_steps_add_up_across_wraps(
            start: i32, distances in proptest::collection::vec(any::<i32>(), 1..50),
        ) {
            let mut shaft = Shaft::default();
            let begin = shaft.sense(&at(start)).position;
            let (mut counts, mut total) = (start, 0.0);
            for distance in distances {
                counts = counts.wrapping_add(distance);
                total += f64::from(distance);
                let position = shaft.sense(&at(counts)).position;
                prop_assert_eq!(position - begin, total);
                prop_assert_eq!(shaft.position_units(position), counts);
            }
        }

        #[test]
        fn positions_are_relative_to_home(
            counts: i32, home in -1_000_000_i32..1_000_000, distance in -1_000_000_i32..1_000_000,
        ) {
            let mut shaft = Shaft::default();
            let position = shaft.sense(&at(counts)).position;
            shaft.set_home(position, f64::from(home));
            prop_assert_eq!(shaft.position_units(position), home);
            let position = shaft.sense(&at(counts.wrapping_add(distance))).position;
            prop_assert_eq!(shaft.position_units(position), home + distance);
            prop_assert_eq!(shaft.nearest_target(position, home), position - f64::from(distance));
        }
    }
}
