//! Whether what a datagram carries may still act.
//!
//! Two clocks that nobody has set alike: so a sender stamps each sample with its own, and beside it puts the
//! newest stamp of its peer that it had received *when it took the sample*. The peer takes its own stamp
//! from its own clock and knows the sample to be no older than that. Whatever holds the datagram up on
//! either way, and whoever sends an old sample anew, only makes the answer older.

use std::time::Duration;

use crate::reject::Reject;
use units::time::Instant;

/// What is older than this acts no more.
pub const OLDEST: Duration = Duration::from_millis(100);

/// How far the newest datagram was counted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Freshness {
    newest: Option<u64>,
}

impl Freshness {
    /// Judges an authentic datagram: its counter, and the stamp of ours that it echoes. Only one that is
    /// newer than all before is fresh, and only if it is not too old.
    ///
    /// # Errors
    /// [`Reject::Overtaken`], [`Reject::Old`] and [`Reject::Future`].
    pub fn judge(
        &mut self,
        now: Instant,
        counter: u64,
        echo: Option<Instant>,
    ) -> Result<Instant, Reject> {
        if self.newest.is_some_and(|newest| counter <= newest) {
            return Err(Reject::Overtaken);
        }
        self.newest = Some(counter);
        match echo {
            Some(echo) if echo > now => Err(Reject::Future),
            Some(echo) if now.since(echo) <= OLDEST => Ok(echo),
            Some(_) | None => Err(Reject::Old),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    proptest! {
        #[test]
        fn property_13_what_is_too_old_does_not_become_fresh_again(
            echo in 0..1_000_000_u64, age in 0..200_000_u64, more in 0..200_000_u64,
        ) {
            let judge = |age| Freshness::default().judge(at(echo + age), 1, Some(at(echo)));
            prop_assert!(judge(age).is_ok() || judge(age + more).is_err());
            prop_assert_eq!(judge(age).is_ok(), age <= 100_000);
        }

        #[test]
        fn hazard_36_however_datagrams_are_shuffled_only_ever_newer_ones_act(
            counters in prop::collection::vec(0..50_u64, 1..100),
        ) {
            let mut freshness = Freshness::default();
            let is_fresh = |counter: &u64| freshness.judge(at(5), *counter, Some(at(4))).is_ok();
            let acted: Vec<u64> = counters.into_iter().filter(is_fresh).collect();
            prop_assert!(acted.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }

    #[test]
    fn what_answers_no_stamp_or_one_of_tomorrow_does_not_act() {
        let mut freshness = Freshness::default();
        assert_eq!(freshness.judge(at(10), 1, None), Err(Reject::Old));
        assert_eq!(freshness.judge(at(10), 2, Some(at(11))), Err(Reject::Future));
        assert_eq!(freshness.judge(at(10), 3, Some(at(10))), Ok(at(10)));
    }
}
