//! Send times of one end's newest messages, from which an echo bounds the age of a received message.

use std::time::Duration;

use crate::head::Echo;
use crate::reject::Reject;
use units::time::Instant;

/// Number of send times in the ring: 1 s at 4 kHz.
const LENGTH: u64 = 4_096;

/// Numbers and send times of the messages of one session.
#[derive(Clone, Debug)]
pub(crate) struct SendTimes {
    session: u64,
    /// Number of the newest message; zero before the first.
    newest: u64,
    times: Vec<Instant>,
}

impl SendTimes {
    /// Creates an empty log of a session. Allocates once.
    pub(crate) fn new(session: u64) -> Self {
        let length = usize::try_from(LENGTH).unwrap_or_default();
        Self { session, newest: 0, times: vec![Instant::ZERO; length] }
    }

    /// Returns the session of this end.
    pub(crate) const fn session(&self) -> u64 {
        self.session
    }

    /// Records a message sent at `now`; returns its session and number.
    pub(crate) fn stamp(&mut self, now: Instant) -> Echo {
        self.newest += 1;
        if let Some(time) = place(self.newest).and_then(|place| self.times.get_mut(place)) {
            *time = now;
        }
        Echo { session: self.session, sequence: self.newest }
    }

    /// Returns the send time of an echoed message. The message with the echo was sent later.
    ///
    /// # Errors
    /// Returns [`Reject::Session`], [`Reject::NeverSent`], or [`Reject::Old`] if it was sent more than `max_age` ago.
    pub(crate) fn time_of(
        &self,
        echo: Echo,
        now: Instant,
        max_age: Duration,
    ) -> Result<Instant, Reject> {
        if echo.session != self.session {
            return Err(Reject::Session);
        }
        if echo.sequence == 0 || echo.sequence > self.newest {
            return Err(Reject::NeverSent);
        }
        let is_kept = self.newest - echo.sequence < LENGTH;
        let time = place(echo.sequence).and_then(|place| self.times.get(place));
        let time = time.copied().filter(|time| is_kept && now.since(*time) <= max_age);
        time.ok_or(Reject::Old)
    }
}

/// Returns the index of a message in the ring.
fn place(sequence: u64) -> Option<usize> {
    usize::try_from(sequence % LENGTH).ok()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MAX_AGE: Duration = Duration::from_millis(100);

    proptest! {
        #[test]
        fn property_13_age_of_an_echo_is_the_time_since_it_was_sent(
            count in 1..10_000_u64, back in 0..12_000_u64, later in 0..200_000_u64,
        ) {
            let mut sent = SendTimes::new(7);
            for at in 1..=count {
                assert_eq!(sent.stamp(Instant::from_micros(at)).sequence, at);
            }
            let now = Instant::from_micros(count + later);
            let echo = Echo { session: 7, sequence: count.saturating_sub(back) };
            let expected = match echo.sequence {
                0 => Err(Reject::NeverSent),
                sequence if back >= LENGTH || back + later > 100_000 => {
                    prop_assert!(sequence > 0);
                    Err(Reject::Old)
                }
                sequence => Ok(Instant::from_micros(sequence)),
            };
            prop_assert_eq!(sent.time_of(echo, now, MAX_AGE), expected);
            let future = Echo { session: 7, sequence: count + 1 + back };
            prop_assert_eq!(sent.time_of(future, now, MAX_AGE), Err(Reject::NeverSent));
            let other = Echo { session: 8, ..echo };
            prop_assert_eq!(sent.time_of(other, now, MAX_AGE), Err(Reject::Session));
        }
    }
}
