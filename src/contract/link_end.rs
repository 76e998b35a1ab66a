//! Common part of both ends of a link: numbers out, echoes in.

use std::time::Duration;

use crate::head::Head;
use crate::peers::{Admission, Peers};
use crate::reject::{Reject, Rejects};
use crate::sent::Sent;
use units::time::Instant;

/// One end of a link.
#[derive(Clone, Debug)]
pub(crate) struct LinkEnd {
    arm: u16,
    /// Maximum age of an echo that is fresh.
    max_age: Duration,
    sent: Sent,
    pub(crate) peers: Peers,
    pub(crate) rejects: Rejects,
}

impl LinkEnd {
    /// Creates the end of `arm` with a session; one of zero becomes 1.
    pub(crate) fn new(arm: u16, session: u64, max_age: Duration) -> Self {
        let (sent, peers) = (Sent::new(session.max(1)), Peers::new(max_age));
        Self { arm, max_age, sent, peers, rejects: Rejects::default() }
    }

    /// Returns the session.
    pub(crate) const fn session(&self) -> u64 {
        self.sent.session()
    }

    /// Returns the head of the message that is sent now.
    pub(crate) fn head(&mut self, now: Instant, epoch: u32) -> Head {
        Head { arm: self.arm, epoch, own: self.sent.stamp(now), echo: self.peers.echo() }
    }

    /// Checks the head of a message, as [`Peers::admit`] does.
    pub(crate) fn admit(&mut self, now: Instant, head: &Head) -> Result<Option<Admission>, Reject> {
        if head.arm != self.arm {
            return Err(Reject::Arm);
        }
        let sent_at = self.sent.time_of(head.echo, now, self.max_age);
        self.peers.admit(now, head.own, head.echo, sent_at)
    }
}
