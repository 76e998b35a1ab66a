//! Reasons to reject a datagram, with counters.

use thiserror::Error;

/// Reason to reject a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Error)]
pub enum Reject {
    /// Wrong length for its kind.
    #[error("wrong length")]
    Length,
    /// Other protocol or version.
    #[error("other protocol or version")]
    Foreign,
    /// Another session, or no session is open.
    #[error("another session")]
    Epoch,
    /// The counter was already received.
    #[error("replayed")]
    Replayed,
    /// The counter is too old for the replay window.
    #[error("outside the replay window")]
    Behind,
    /// Not from the peer, or modified.
    #[error("not authentic")]
    Tag,
    /// Authentic, but older than one before.
    #[error("overtaken by a newer one")]
    Overtaken,
    /// Authentic, but the content is too old, or its age is unknown.
    #[error("too old")]
    Old,
    /// Authentic, but it echoes a stamp that was never sent.
    #[error("echo from the future")]
    Future,
    /// Authentic, but values are out of range.
    #[error("values out of range")]
    Impossible,
    /// Initiation without a valid cookie.
    #[error("cookie missing")]
    Cookie,
    /// Initiation above the rate limit.
    #[error("too many initiations")]
    Busy,
    /// Initiation while the present session is armed and active.
    #[error("a session is in use")]
    InUse,
}

impl Reject {
    /// All reasons.
    pub const ALL: [Self; 13] = [
        Self::Length,
        Self::Foreign,
        Self::Epoch,
        Self::Replayed,
        Self::Behind,
        Self::Tag,
        Self::Overtaken,
        Self::Old,
        Self::Future,
        Self::Impossible,
        Self::Cookie,
        Self::Busy,
        Self::InUse,
    ];
}

/// Numbers of rejected datagrams by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejects([u64; Reject::ALL.len()]);

impl Rejects {
    /// Counts a rejected datagram.
    pub fn count(&mut self, reject: Reject) {
        let of = self.0.iter_mut().zip(Reject::ALL).find(|(_, reason)| *reason == reject);
        if let Some((count, _)) = of {
            *count = count.saturating_add(1);
        }
    }

    /// Returns the number for one reason.
    pub fn of(&self, reject: Reject) -> u64 {
        self.each().find(|(reason, _)| *reason == reject).map_or(0, |(_, count)| count)
    }

    /// Returns the number for each reason.
    pub fn each(&self) -> impl Iterator<Item = (Reject, u64)> + '_ {
        Reject::ALL.into_iter().zip(self.0)
    }

    /// Returns the total.
    pub fn total(&self) -> u64 {
        self.0.iter().fold(0, |sum, count| sum.saturating_add(*count))
    }
}
