//! What is forgiven once, and no second time soon after.

use std::time::Duration;

use units::time::Instant;

/// When it last happened.
#[derive(Clone, Copy, Debug)]
pub(super) struct Repeated {
    within: Duration,
    last: Option<Instant>,
}

impl Repeated {
    /// Forgiven again when `within` has passed.
    pub(super) const fn new(within: Duration) -> Self {
        Self { within, last: None }
    }

    /// It happens at `now`; whether it had happened already, within the span.
    pub(super) fn happens(&mut self, now: Instant) -> bool {
        let last = self.last.replace(now);
        last.is_some_and(|last| now.since(last) <= self.within)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn once_is_forgiven_and_twice_within_the_span_is_not() {
        let mut repeated = Repeated::new(Duration::from_millis(100));
        let mut at = |millis: u64| repeated.happens(Instant::from_micros(1_000 * millis));
        assert_eq!([at(0), at(101), at(201), at(202)], [false, false, true, true]);
    }
}
