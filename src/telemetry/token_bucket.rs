//! A token bucket: so many a second on average, and a few at once. It keeps a flood of the network's
//! from becoming a flood of lines.

use std::time::Duration;

use units::time::Instant;

/// The bucket, told as the time at which it would be full again: an integer, so nothing adds up.
#[derive(Clone, Copy, Debug)]
pub struct TokenBucket {
    /// Until the next token comes.
    every: Duration,
    /// Until all that fit have come.
    depth: Duration,
    full_at: Instant,
}

impl TokenBucket {
    /// A full one: `burst` tokens, and a new one `every` so often.
    pub const fn new(every: Duration, burst: u32) -> Self {
        Self { every, depth: every.saturating_mul(burst), full_at: Instant::ZERO }
    }

    /// Takes a token at `now`, if there is one.
    pub fn take(&mut self, now: Instant) -> bool {
        let full_at = self.full_at.max(now) + self.every;
        let is_there = full_at.since(now) <= self.depth;
        if is_there {
            self.full_at = full_at;
        }
        is_there
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn hazard_32_never_more_pass_than_the_burst_and_the_rate_allow(
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
    fn after_a_rest_the_burst_is_there_again() {
        let mut bucket = TokenBucket::new(Duration::from_millis(100), 5);
        for second in [0, 1, 2] {
            let at = Instant::from_micros(second * 1_000_000);
            let taken = (0..100).filter(|_| bucket.take(at)).count();
            assert_eq!(taken, 5);
        }
    }
}
