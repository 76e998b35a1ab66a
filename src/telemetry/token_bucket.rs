//! Token bucket: limits messages about network events to a rate and a burst.

use std::time::Duration;

use units::time::Instant;

/// Token bucket, stored as the time at which it is full again: integer arithmetic does not accumulate errors.
#[derive(Clone, Copy, Debug)]
pub struct TokenBucket {
    /// Time per token.
    every: Duration,
    /// Time to fill an empty bucket.
    depth: Duration,
    full_at: Instant,
}

impl TokenBucket {
    /// Creates a full bucket of `burst` tokens with one new token per `every`.
    pub const fn new(every: Duration, burst: u32) -> Self {
        Self { every, depth: every.saturating_mul(burst), full_at: Instant::ZERO }
    }

    /// Takes a token at `now`; returns whether there was one.
    pub fn take(&mut self, now: Instant) -> bool {
        let full_at = self.full_at.max(now) + self.every;
        let is_available = full_at.since(now) <= self.depth;
        if is_available {
            self.full_at = full_at;
        }
        is_available
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn hazard_32_rate_and_burst_limit_the_tokens(
            steps in proptest::collection::vec(0..400_000_u64, 1..300),
            every in 1_000..1_000_000_u64,
            burst in 1..50_u32,
        ) {
            let mut bucket = TokenBucket::new(Duration::from_micros(every), burst);
            let (mut now, mut taken) = (0, 0_u64);
            for step in steps {
                now += step;
                taken += u64::from(bucket.take(Instant::from_micros(now)));
                prop_assert!(taken <= u64::from(burst) + now / every, "{taken} by {now} µs");
            }
        }
    }

    #[test]
    fn pause_refills_the_burst() {
        let mut bucket = TokenBucket::new(Duration::from_millis(100), 5);
        for second in [0, 1, 2] {
            let at = Instant::from_micros(second * 1_000_000);
            let taken = (0..100).filter(|_| bucket.take(at)).count();
            assert_eq!(taken, 5);
        }
    }
}
