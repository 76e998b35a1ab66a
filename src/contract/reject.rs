//! Reasons to reject a message, with counters.

use crate::codes::codes;

codes! {
    /// Reason to reject a message.
    pub enum Reject {
        /// Wrong length for its kind.
        Length = 0, "length";
        /// Not little-endian CDR, or a kind that this end does not receive.
        Foreign = 1, "foreign";
        /// Another version of the contract.
        Version = 2, "version";
        /// Another arm.
        Arm = 3, "arm";
        /// Value out of range, NaN, or an undefined code.
        Impossible = 4, "impossible";
        /// Echo of a session that is not this end's.
        Session = 5, "session";
        /// Echo of a message that was never sent.
        NeverSent = 6, "never sent";
        /// Echo older than the maximum age.
        Old = 7, "old";
        /// Received after a newer message of its session.
        Overtaken = 8, "overtaken";
        /// Received before, or older than the newest 128 messages of its session.
        Replayed = 9, "replayed";
        /// Another session leads.
        NotLeader = 10, "not leader";
        /// Former session or epoch.
        Left = 11, "left";
    }
}

impl Reject {
    /// Returns whether the message belongs to another contract, version or arm, so that its sender cannot be the peer.
    pub const fn is_foreign(self) -> bool {
        matches!(self, Self::Length | Self::Foreign | Self::Version | Self::Arm)
    }
}

/// Counts of rejected messages, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejects([u64; Reject::ALL.len()]);

impl Rejects {
    /// Counts a rejected message.
    pub(crate) fn count(&mut self, reject: Reject) {
        if let Some(count) = self.0.get_mut(usize::from(reject.code())) {
            *count += 1;
        }
    }

    /// Returns the number of messages rejected for a reason.
    pub fn get(&self, reject: Reject) -> u64 {
        self.0.get(usize::from(reject.code())).copied().unwrap_or_default()
    }

    /// Returns the reasons that occurred, with their counts.
    pub fn iter(&self) -> impl Iterator<Item = (Reject, u64)> {
        Reject::ALL.into_iter().zip(self.0).filter(|(_, count)| *count > 0)
    }
}
