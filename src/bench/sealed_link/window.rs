//! Replay protection: a sliding window over the last 1,024 counters (RFC 6479).
//!
//! Counters only; [`freshness`](super::freshness) checks the age.

use crate::reject::Reject;

/// Size of the window, including the newest counter.
pub const SIZE: u64 = 1_024;

/// Counters per word.
const WORD: u64 = 64;

/// Words in the ring: one more than the window needs, so that whole words can be cleared.
const WORDS: u64 = SIZE / WORD + 1;

/// Counters received.
#[derive(Clone, Copy, Debug, Default)]
pub struct Window {
    newest: Option<u64>,
    /// One bit per counter; counter n is in word n / 64, modulo the ring.
    taken: [u64; 17],
}

impl Window {
    /// Checks that a counter is new and inside the window.
    ///
    /// # Errors
    /// [`Reject::Replayed`] and [`Reject::Behind`].
    pub fn check(&self, counter: u64) -> Result<(), Reject> {
        let behind = self.newest.and_then(|newest| newest.checked_sub(counter));
        match behind {
            None => Ok(()),
            Some(SIZE..) => Err(Reject::Behind),
            Some(_) if self.is_taken(counter) => Err(Reject::Replayed),
            Some(_) => Ok(()),
        }
    }

    /// Records a counter.
    pub fn take(&mut self, counter: u64) {
        let newest = self.newest.unwrap_or(0);
        let (block, next) = (newest / WORD, counter / WORD);
        for ahead in 1..=next.saturating_sub(block).min(WORDS) {
            if let Some(word) = self.word(block + ahead) {
                *word = 0;
            }
        }
        if let Some(word) = self.word(next) {
            *word |= bit(counter);
        }
        self.newest = Some(newest.max(counter));
    }

    fn is_taken(&self, counter: u64) -> bool {
        let word = self.taken.get(place(counter / WORD));
        word.is_some_and(|word| word & bit(counter) != 0)
    }

    fn word(&mut self, block: u64) -> Option<&mut u64> {
        self.taken.get_mut(place(block))
    }
}

/// Returns the ring index of a block of counters.
fn place(block: u64) -> usize {
    usize::try_from(block % WORDS).unwrap_or(usize::MAX)
}

const fn bit(counter: u64) -> u64 {
    1 << (counter % WORD)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use proptest::prelude::*;

    use super::*;

    /// Reference model: set of all counters, and the newest.
    #[derive(Default)]
    struct Reference(HashSet<u64>, Option<u64>);

    impl Reference {
        fn check(&self, counter: u64) -> Result<(), Reject> {
            match self.1 {
                Some(newest) if newest >= counter && newest - counter >= SIZE => {
                    Err(Reject::Behind)
                }
                _ if self.0.contains(&counter) => Err(Reject::Replayed),
                _ => Ok(()),
            }
        }

        fn take(&mut self, counter: u64) {
            self.0.insert(counter);
            self.1 = self.1.max(Some(counter));
        }
    }

    /// Generates steps of a counter: mostly small, some across the window, few to the end of the range.
    fn steps() -> impl Strategy<Value = Vec<i64>> {
        let step = prop_oneof![
            8 => -70..70_i64,
            4 => -1_200..1_200_i64,
            1 => -100_000..100_000_i64,
            1 => Just(i64::MAX),
        ];
        prop::collection::vec(step, 1..400)
    }

    proptest! {
        #[test]
        fn property_12_window_matches_a_set_of_all_counters(
            begin in prop_oneof![0..5_000_u64, any::<u64>()], steps in steps(),
        ) {
            let (mut window, mut reference) = (Window::default(), Reference::default());
            let mut counter = begin;
            for step in steps {
                counter = counter.saturating_add_signed(step);
                let verdict = window.check(counter);
                prop_assert_eq!(verdict, reference.check(counter), "{}", counter);
                if verdict.is_ok() {
                    window.take(counter);
                    reference.take(counter);
                }
            }
        }
    }

    #[test]
    fn counters_are_accepted_once_within_the_window() {
        let mut window = Window::default();
        for counter in [0, 1_023, 1] {
            assert_eq!(window.check(counter), Ok(()));
            window.take(counter);
            assert_eq!(window.check(counter), Err(Reject::Replayed));
        }
        window.take(1_024);
        assert_eq!(window.check(0), Err(Reject::Behind));
        assert_eq!(window.check(1), Err(Reject::Replayed));
        assert_eq!(window.check(2), Ok(()));
    }
}
