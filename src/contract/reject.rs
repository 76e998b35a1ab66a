//! Reasons not to act on a message, with counters.

use crate::codes::codes;

codes! {
    /// Reason not to act on a message.
    pub enum Reject {
        /// Not as long as a message of its kind.
        Length = 0, "length";
        /// Not little-endian CDR, or of no kind that this end takes.
        Foreign = 1, "foreign";
        /// Another version of the contract.
        Version = 2, "version";
        /// Another arm.
        Arm = 3, "arm";
        /// A value out of range, NaN, or a code without meaning.
        Impossible = 4, "impossible";
        /// Echo of a session that is not this end's.
        Session = 5, "session";
        /// Echo of a message that was never sent.
        NeverSent = 6, "never sent";
        /// Echo older than what may act.
        Old = 7, "old";
        /// Received after a newer message of its session.
        Overtaken = 8, "overtaken";
        /// Received before, or older than the newest 128 messages of its session.
        Replayed = 9, "replayed";
        /// Another session leads.
        NotLeader = 10, "not leader";
        /// A session or epoch that this end has left.
        Left = 11, "left";
    }
}

impl Reject {
    /// Returns whether the message is foreign to this contract or arm, whatever its sender.
    pub const fn is_foreign(self) -> bool {
        matches!(self, Self::Length | Self::Foreign | Self::Version | Self::Arm)
    }
}

/// Counts of messages that had no effect, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejects([u64; Reject::ALL.len()]);

impl Rejects {
    /// Counts a message.
    pub(crate) fn count(&mut self, reject: Reject) {
        if let Some(count) = self.0.get_mut(usize::from(reject.code())) {
            *count += 1;
        }
    }

    /// Returns the count of a reason.
    pub fn of(&self, reject: Reject) -> u64 {
        self.0.get(usize::from(reject.code())).copied().unwrap_or_default()
    }

    /// Returns the reasons that occurred, with their counts.
    pub fn iter(&self) -> impl Iterator<Item = (Reject, u64)> {
        Reject::ALL.into_iter().zip(self.0).filter(|(_, count)| *count > 0)
    }
}
