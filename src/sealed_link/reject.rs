//! Why a datagram had no effect, and how often.

use thiserror::Error;

/// Why a datagram had no effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Error)]
pub enum Reject {
    /// Not as long as a datagram of its kind.
    #[error("not of the length of any datagram")]
    Length,
    /// Not of this protocol or version.
    #[error("none of this link's datagrams")]
    Foreign,
    /// Of another session, or of none that is open.
    #[error("of another session")]
    Epoch,
    /// Its counter was taken already.
    #[error("replayed")]
    Replayed,
    /// Its counter is so far behind the newest that nobody knows whether it was taken.
    #[error("too far behind to tell whether it is a replay")]
    Behind,
    /// Not from the peer, or changed on its way.
    #[error("not authentic")]
    Tag,
    /// Authentic, but older than one before.
    #[error("overtaken by a newer one")]
    Overtaken,
    /// Authentic, but what it carries was sampled too long ago, or nobody knows when.
    #[error("too old")]
    Old,
    /// Authentic, but it answers a stamp that was never given.
    #[error("from the future")]
    Future,
    /// Authentic, but its numbers are none that a sensor or a hand can give.
    #[error("no such numbers")]
    Impossible,
    /// An initiation without this address's cookie.
    #[error("no cookie")]
    Cookie,
    /// More initiations than are worked at.
    #[error("too many initiations")]
    Busy,
    /// An initiation while the session that is open is commanded.
    #[error("a session is in use")]
    InUse,
}

impl Reject {
    /// All of them.
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

/// How many datagrams had no effect, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejects([u64; Reject::ALL.len()]);

impl Rejects {
    /// One more.
    pub fn count(&mut self, reject: Reject) {
        let of = self.0.iter_mut().zip(Reject::ALL).find(|(_, reason)| *reason == reject);
        if let Some((count, _)) = of {
            *count = count.saturating_add(1);
        }
    }

    /// How many of one reason.
    pub fn of(&self, reject: Reject) -> u64 {
        self.each().find(|(reason, _)| *reason == reject).map_or(0, |(_, count)| count)
    }

    /// How many of each.
    pub fn each(&self) -> impl Iterator<Item = (Reject, u64)> + '_ {
        Reject::ALL.into_iter().zip(self.0)
    }

    /// How many in all.
    pub fn total(&self) -> u64 {
        self.0.iter().fold(0, |sum, count| sum.saturating_add(*count))
    }
}
