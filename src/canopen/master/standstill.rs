//! Standstill of a drive, detected from its position (6064h): every drive reports one, few report a velocity
//! in their current mode.

use crate::sdo::Content;

/// Consecutive positions within the tolerance that make a standstill. They are read 100 ms apart or later.
const STILL_SAMPLES: u32 = 5;

/// Detector of standstill.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standstill {
    /// Maximum difference of two consecutive positions, in counts.
    tolerance: u32,
    last: Option<i32>,
    still: u32,
}

impl Standstill {
    /// Returns a detector without samples that tolerates `tolerance` counts between two positions.
    pub(super) const fn within(tolerance: u32) -> Self {
        Self { tolerance, last: None, still: 0 }
    }

    /// Takes a position in counts, which may wrap. Returns whether the drive is at standstill; an invalid position counts
    /// as motion.
    pub(super) fn on_position(&mut self, content: &Content) -> bool {
        let position = content.exactly(4).and_then(|bytes| bytes.try_into().ok());
        let position = position.map(i32::from_le_bytes);
        let before = std::mem::replace(&mut self.last, position);
        let apart = position.zip(before).map(|(now, before)| now.wrapping_sub(before));
        let is_still = apart.is_some_and(|apart| apart.unsigned_abs() <= self.tolerance);
        self.still = if is_still { self.still.saturating_add(1) } else { 0 };
        self.still >= STILL_SAMPLES
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::master::check::tests::content;
    use crate::object::Object;

    /// Number of positions until standstill.
    fn reached(tolerance: u32, positions: impl IntoIterator<Item = i32>) -> Option<usize> {
        let mut standstill = Standstill::within(tolerance);
        positions.into_iter().position(|at| {
            standstill.on_position(&content(Object::POSITION_ACTUAL, &at.to_le_bytes()))
        })
    }

    #[test]
    fn half_a_second_in_place_is_standstill_and_creep_is_not() {
        assert_eq!(reached(0, [7; 9]), Some(5));
        assert_eq!(reached(10, (0..).step_by(10).take(9)), Some(5), "no faster than it may");
        assert_eq!(reached(10, (0..).step_by(11).take(1_000)), None);
        assert_eq!(reached(2, [0, 1, 2, 3, 50, 51, 52, 53, 54, 55]), Some(9), "moved on");
        let across_the_wrap = [i32::MAX - 1, i32::MAX, i32::MIN, i32::MIN + 1, i32::MIN, i32::MIN];
        assert_eq!(reached(1, across_the_wrap), Some(5));
    }

    proptest! {
        #[test]
        fn invalid_position_is_no_standstill(bytes in proptest::collection::vec(any::<u8>(), 1..4)) {
            let mut standstill = Standstill::within(u32::MAX);
            for _ in 0..20 {
                prop_assert!(!standstill.on_position(&content(Object::POSITION_ACTUAL, &bytes)));
            }
        }
    }
}
