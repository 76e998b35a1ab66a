//! Common part of both ends of a link: numbers of sent messages, and checks of received ones.

use std::time::Duration;

use crate::head::Head;
use crate::peers::{Admission, Peers};
use crate::reject::{Reject, Rejects};
use crate::sent::SendTimes;
use units::time::Instant;

/// Numbers and sessions that both ends keep in the same way.
#[derive(Clone, Debug)]
pub(crate) struct LinkEnd {
    arm: u16,
    /// Maximum age of a fresh echo.
    max_age: Duration,
    sent: SendTimes,
    pub(crate) peers: Peers,
    pub(crate) rejects: Rejects,
}

impl LinkEnd {
    /// Creates the end of `arm` with a session; zero is replaced by 1.
    pub(crate) fn new(arm: u16, session: u64, max_age: Duration) -> Self {
        let (sent, peers) = (SendTimes::new(session.max(1)), Peers::new(max_age));
        Self { arm, max_age, sent, peers, rejects: Rejects::default() }
    }

    /// Returns the random number of this process, never zero.
    pub(crate) const fn session(&self) -> u64 {
        self.sent.session()
    }

    /// Returns the head of a message sent at `now`, and records its send time.
    pub(crate) fn head(&mut self, now: Instant, epoch: u32) -> Head {
        Head { arm: self.arm, epoch, own: self.sent.stamp(now), echo: self.peers.echo() }
    }

    /// Checks the arm of a message, then its session and numbers by [`Peers::admit`].
    pub(crate) fn admit(&mut self, now: Instant, head: &Head) -> Result<Option<Admission>, Reject> {
        if head.arm != self.arm {
            return Err(Reject::Arm);
        }
        let sent_at = self.sent.time_of(head.echo, now, self.max_age);
        self.peers.admit(now, head.own, head.echo, sent_at)
    }
}
