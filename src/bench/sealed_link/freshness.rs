//! Age check of datagrams without synchronized clocks.
//!
//! A sender puts two stamps beside each sample: its own, and the newest stamp of its peer that it had received *at
//! sample time*. The peer recognizes its own stamp: the sample is no older than that. Delays in either direction, and
//! old samples sent again, only make the result older.

use std::time::Duration;

use crate::reject::Reject;
use units::time::Instant;

/// Maximum age of content that takes effect.
pub const MAX_AGE: Duration = Duration::from_millis(100);

/// Newest counter accepted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Freshness {
    newest: Option<u64>,
}

impl Freshness {
    /// Checks an authentic datagram by its counter and the echo of our stamp. Accepts it if it is newer than all
    /// before, and not older than [`MAX_AGE`]; returns the echo.
    ///
    /// # Errors
    /// [`Reject::Overtaken`], [`Reject::Old`] and [`Reject::Future`].
    pub fn check(
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
            Some(echo) if now.since(echo) <= MAX_AGE => Ok(echo),
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
        fn property_13_stale_content_stays_stale(
            echo in 0..1_000_000_u64, age in 0..200_000_u64, more in 0..200_000_u64,
        ) {
            let check = |age| Freshness::default().check(at(echo + age), 1, Some(at(echo)));
            prop_assert!(check(age).is_ok() || check(age + more).is_err());
            prop_assert_eq!(check(age).is_ok(), age <= 100_000);
        }

        #[test]
        fn hazard_36_shuffled_datagrams_take_effect_in_order_only(
            counters in prop::collection::vec(0..50_u64, 1..100),
        ) {
            let mut freshness = Freshness::default();
            let is_fresh = |counter: &u64| freshness.check(at(5), *counter, Some(at(4))).is_ok();
            let acted: Vec<u64> = counters.into_iter().filter(is_fresh).collect();
            prop_assert!(acted.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }

    #[test]
    fn missing_or_future_echoes_are_rejected() {
        let mut freshness = Freshness::default();
        assert_eq!(freshness.check(at(10), 1, None), Err(Reject::Old));
        assert_eq!(freshness.check(at(10), 2, Some(at(11))), Err(Reject::Future));
        assert_eq!(freshness.check(at(10), 3, Some(at(10))), Ok(at(10)));
    }
}
