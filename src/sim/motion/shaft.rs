//! Where the motor is: the encoder's 32 bits unwrapped, and the home that positions are counted from.
//!
//! A *place* is in increments and goes on beyond 32 bits, so that no loop sees the counter wrap. What a
//! master reads (6064h) is counted from home, in its units, and wraps.

use crate::motion::Feedback;
use crate::motion::units::Units;
use crate::motion::units::wrapped;

/// The shaft of the motor, as the encoder tells of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Shaft {
    pub(super) units: Units,
    /// What the encoder said last.
    counts: i32,
    /// Where that is.
    place: f64,
    /// The place shown as zero.
    zero: f64,
}

/// What the motor does, in numbers that are there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Actual {
    /// Its place.
    pub(super) place: f64,
    /// In increments/s.
    pub(super) velocity: f64,
    /// In ‰ of rated torque.
    pub(super) per_mille: f64,
}

impl Shaft {
    /// With zero where the encoder has it.
    pub(super) fn new(units: Units) -> Self {
        Self { units, ..Self::default() }
    }

    /// Takes what the encoder says; between two calls it turns less than 2³¹ increments.
    pub(super) fn sense(&mut self, feedback: &Feedback) -> Actual {
        let way = feedback.position.wrapping_sub(self.counts);
        self.counts = feedback.position;
        self.place += f64::from(way);
        Actual {
            place: self.place,
            velocity: bounded(feedback.velocity, FASTEST),
            per_mille: bounded(feedback.per_mille, STRONGEST),
        }
    }

    /// What a place is shown as, in position units.
    pub(super) fn shown(&self, place: f64) -> i32 {
        wrapped(self.units.way_shown(place - self.zero))
    }

    /// The place shown as `units`, on the same side of a wrap as `here`: an axis is linear unless told
    /// otherwise (60F2h, bits 6 and 7).
    pub(super) fn place_beside(&self, here: f64, units: f64) -> f64 {
        here + self.units.way(units - f64::from(self.shown(here))) - self.rest(here)
    }

    /// The place shown as `units` that is nearest to `here`, be there a wrap between them or not.
    pub(super) fn place_nearest(&self, here: f64, units: i32) -> f64 {
        let way = units.wrapping_sub(self.shown(here));
        here + self.units.way(f64::from(way)) - self.rest(here)
    }

    /// From now on `place` is shown as `units`.
    pub(super) fn set_home(&mut self, place: f64, units: f64) {
        self.zero = place - self.units.way(units);
    }

    /// How far `place` is from one that is shown as a whole number.
    fn rest(&self, place: f64) -> f64 {
        let shown = self.units.way_shown(place - self.zero);
        self.units.way(shown - shown.round())
    }
}

/// In increments/s; no encoder is this fast.
const FASTEST: f64 = 1e12;
/// In ‰; no motor is this strong.
const STRONGEST: f64 = 1e6;

/// `number` as far as it goes; zero for none.
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
    fn what_is_no_number_is_nothing() {
        let mut shaft = Shaft::default();
        for (nonsense, taken) in
            [(f64::NAN, 0.0), (f64::INFINITY, FASTEST), (f64::NEG_INFINITY, -FASTEST)]
        {
            let actual = shaft.sense(&Feedback { velocity: nonsense, ..Feedback::default() });
            assert_eq!(actual.velocity, taken);
        }
    }

    #[test]
    fn a_linear_axis_goes_the_long_way_and_a_cyclic_one_the_near_way() {
        let mut shaft = Shaft::default();
        let here = shaft.sense(&at(i32::MAX)).place;
        assert_eq!(shaft.place_nearest(here, i32::MIN) - here, 1.0);
        assert_eq!(shaft.place_beside(here, f64::from(i32::MIN)) - here, -4_294_967_295.0);
    }

    proptest! {
        #[test]
        fn every_step_of_the_counter_is_a_step_of_the_place(
            start: i32, ways in proptest::collection::vec(any::<i32>(), 1..50),
        ) {
            let mut shaft = Shaft::default();
            let begin = shaft.sense(&at(start)).place;
            let (mut counts, mut way_gone) = (start, 0.0);
            for way in ways {
                counts = counts.wrapping_add(way);
                way_gone += f64::from(way);
                let place = shaft.sense(&at(counts)).place;
                prop_assert_eq!(place - begin, way_gone);
                prop_assert_eq!(shaft.shown(place), counts);
            }
        }

        #[test]
        fn home_is_shown_as_told_and_all_else_counts_from_it(
            counts: i32, home in -1_000_000_i32..1_000_000, way in -1_000_000_i32..1_000_000,
        ) {
            let mut shaft = Shaft::default();
            let place = shaft.sense(&at(counts)).place;
            shaft.set_home(place, f64::from(home));
            prop_assert_eq!(shaft.shown(place), home);
            let place = shaft.sense(&at(counts.wrapping_add(way))).place;
            prop_assert_eq!(shaft.shown(place), home + way);
            prop_assert_eq!(shaft.place_nearest(place, home), place - f64::from(way));
        }
    }
}
