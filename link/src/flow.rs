//! Flow rule: an end sends while few of its messages are not echoed, and otherwise one every 20 ms.
//!
//! If a network delays messages, further ones would only wait longer. The rule lowers the rate, so that the age stays
//! limited. The one every 20 ms ensures that neither a start nor a lost burst silences an end.

use std::collections::VecDeque;
use std::time::Duration;

use contract::Echo;
use units::time::Instant;

/// Maximum silence of an end that has messages to send.
pub(crate) const KEEP_SENDING: Duration = Duration::from_millis(20);

/// State of the flow rule at one end.
#[derive(Debug)]
pub(crate) struct Flow {
    limit: usize,
    session: u64,
    /// Numbers of the messages sent and not echoed, oldest first; at most `limit`.
    unechoed: VecDeque<u64>,
    sent_at: Option<Instant>,
}

impl Flow {
    /// Starts with no message sent; `limit` is the maximum number of messages that are not echoed.
    pub(crate) fn new(limit: usize) -> Self {
        Self { limit, session: 0, unechoed: VecDeque::with_capacity(limit), sent_at: None }
    }

    /// Returns whether a message with this session and number may be sent now, and counts it as sent if so.
    pub(crate) fn admits(&mut self, now: Instant, own: Echo) -> bool {
        if own.session != self.session {
            self.session = own.session;
            self.unechoed.clear();
        }
        let is_due = self.sent_at.is_none_or(|at| now.since(at) >= KEEP_SENDING);
        if self.unechoed.len() >= self.limit {
            if !is_due {
                return false;
            }
            self.unechoed.pop_front();
        }
        self.unechoed.push_back(own.sequence);
        self.sent_at = Some(now);
        true
    }

    /// Takes the echo in a message of the other end.
    pub(crate) fn on_echo(&mut self, echo: Echo) {
        if echo.session == self.session {
            let is_echoed = |number: &u64| *number <= echo.sequence;
            while self.unechoed.front().is_some_and(is_echoed) {
                self.unechoed.pop_front();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::from_micros(1_000 * millis)
    }

    fn own(sequence: u64) -> Echo {
        Echo { session: 5, sequence }
    }

    #[test]
    fn unechoed_messages_are_limited_but_one_goes_every_20_ms() {
        let mut flow = Flow::new(4);
        let sent = |flow: &mut Flow, from: u64, to: u64| {
            (from..to).filter(|ms| flow.admits(at(*ms), own(*ms + 1))).collect::<Vec<_>>()
        };
        assert_eq!(sent(&mut flow, 0, 64), [0, 1, 2, 3, 23, 43, 63]);
        flow.on_echo(Echo { session: 6, sequence: 64 });
        assert!(sent(&mut flow, 64, 70).is_empty(), "the echo of another session");
        flow.on_echo(own(64));
        assert_eq!(sent(&mut flow, 70, 80), [70, 71, 72, 73]);
    }

    #[test]
    fn session_that_starts_again_is_not_held_back_by_the_one_before() {
        let mut flow = Flow::new(2);
        assert!(flow.admits(at(0), own(1)) && flow.admits(at(1), own(2)));
        assert!(!flow.admits(at(2), own(3)));
        assert!(flow.admits(at(2), Echo { session: 9, sequence: 1 }));
        flow.on_echo(own(2));
        assert!(flow.admits(at(3), Echo { session: 9, sequence: 2 }));
        assert!(!flow.admits(at(4), Echo { session: 9, sequence: 3 }));
    }

    proptest! {
        /// For any echoes, an end with messages is silent for at most 20 ms plus its own period.
        #[test]
        fn no_end_is_silenced(echoes in prop::collection::vec(0_u64..600, 600), limit in 1_usize..64) {
            let mut flow = Flow::new(limit);
            let mut last = 0;
            for (ms, echo) in (0_u64..).zip(echoes) {
                flow.on_echo(own(echo));
                if flow.admits(at(ms), own(ms + 1)) {
                    last = ms;
                }
                prop_assert!(ms - last < 20);
                prop_assert!(flow.unechoed.len() <= limit);
            }
        }
    }
}
