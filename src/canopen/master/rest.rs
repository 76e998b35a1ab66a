//! Whether what a drive moves has come to rest, told from its position alone: every drive shows that one
//! (6064h), few show a velocity in the mode they are in.

use crate::sdo::Content;

/// So many positions in a row that hardly differ are a rest. They are read 100 ms apart, or later.
const SAMPLES: u32 = 5;

/// What is known of a motion that ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    /// Counts that two positions may differ by.
    tolerance: u32,
    last: Option<i32>,
    still: u32,
}

impl Rest {
    /// Nothing is known yet; positions that are at most `tolerance` counts apart are one.
    pub(super) const fn within(tolerance: u32) -> Self {
        Self { tolerance, last: None, still: 0 }
    }

    /// Takes a position, in counts that may wrap. Whether it has not changed for long enough; never for
    /// what is no position.
    pub(super) fn is_reached(&mut self, content: &Content) -> bool {
        let position = content.exactly(4).and_then(|bytes| bytes.try_into().ok());
        let position = position.map(i32::from_le_bytes);
        let before = std::mem::replace(&mut self.last, position);
        let apart = position.zip(before).map(|(now, before)| now.wrapping_sub(before));
        let is_still = apart.is_some_and(|apart| apart.unsigned_abs() <= self.tolerance);
        self.still = if is_still { self.still.saturating_add(1) } else { 0 };
        self.still >= SAMPLES
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::master::check::tests::content;
    use crate::object::Object;

    /// After how many of these positions it has come to rest.
    fn reached(tolerance: u32, positions: impl IntoIterator<Item = i32>) -> Option<usize> {
        let mut rest = Rest::within(tolerance);
        positions
            .into_iter()
            .position(|at| rest.is_reached(&content(Object::POSITION_ACTUAL, &at.to_le_bytes())))
    }

    #[test]
    fn half_a_second_in_one_place_is_rest_and_a_creep_is_none() {
        assert_eq!(reached(0, [7; 9]), Some(5));
        assert_eq!(reached(10, (0..).step_by(10).take(9)), Some(5), "no faster than it may");
        assert_eq!(reached(10, (0..).step_by(11).take(1_000)), None);
        assert_eq!(reached(2, [0, 1, 2, 3, 50, 51, 52, 53, 54, 55]), Some(9), "it went on");
        let across_the_wrap = [i32::MAX - 1, i32::MAX, i32::MIN, i32::MIN + 1, i32::MIN, i32::MIN];
        assert_eq!(reached(1, across_the_wrap), Some(5));
    }

    proptest! {
        #[test]
        fn what_is_no_position_is_no_rest(bytes in proptest::collection::vec(any::<u8>(), 1..4)) {
            let mut rest = Rest::within(u32::MAX);
            for _ in 0..20 {
                prop_assert!(!rest.is_reached(&content(Object::POSITION_ACTUAL, &bytes)));
            }
        }
    }
}
