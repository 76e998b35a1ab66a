//! The head of every message: kind, version, arm, and the numbers that say how old the message is. docs/link.md has the table.

use crate::codec::{Reader, Writer};
use crate::codes::codes;
use crate::reject::Reject;

/// Version of the contract.
pub const VERSION: u8 = 1;

/// Length of the head, in bytes.
pub(crate) const HEAD_LENGTH: usize = 40;

codes! {
    /// Kind of a message.
    pub(crate) enum Kind {
        /// To the far side.
        Command = 1, "command";
        /// From the far side, every cycle.
        Feedback = 2, "feedback";
        /// From the far side, where asked for.
        Capability = 3, "capability";
    }
}

impl Kind {
    /// Returns the kind of a message.
    pub(crate) fn of(bytes: &[u8]) -> Option<Self> {
        let [code] = Reader::new(bytes).and_then(|mut reader| reader.take()).ok()?;
        Self::from_code(code)
    }
}

/// A message of the other end, by its session and number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Echo {
    /// Session; zero for none.
    pub session: u64,
    /// Number in that session; zero for none.
    pub sequence: u64,
}

impl Echo {
    /// No message.
    pub const NONE: Self = Self { session: 0, sequence: 0 };
}

/// Head of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    /// Number of the arm.
    pub arm: u16,
    /// Epoch of the node's session that the sender is in.
    pub epoch: u32,
    /// Session and number of the message.
    pub own: Echo,
    /// Newest message from the other end.
    pub echo: Echo,
}

impl Head {
    /// Writes the head of a message of this kind.
    pub(crate) fn write(&self, kind: Kind, writer: &mut Writer<'_>) {
        writer.put([kind.code(), VERSION]);
        writer.put(self.arm.to_le_bytes());
        writer.put(self.epoch.to_le_bytes());
        for Echo { session, sequence } in [self.own, self.echo] {
            writer.put(session.to_le_bytes());
            writer.put(sequence.to_le_bytes());
        }
    }

    /// Opens a message of this kind and length; returns its head, and the rest to read.
    pub(crate) fn open(
        bytes: &[u8],
        kind: Kind,
        length: usize,
    ) -> Result<(Self, Reader<'_>), Reject> {
        let mut reader = Reader::new(bytes)?;
        let [code, version] = reader.take()?;
        if version != VERSION {
            return Err(Reject::Version);
        }
        if code != kind.code() {
            return Err(Reject::Foreign);
        }
        if bytes.len() != length {
            return Err(Reject::Length);
        }
        let (arm, epoch) = (u16::from_le_bytes(reader.take()?), u32::from_le_bytes(reader.take()?));
        let mut message = || -> Result<Echo, Reject> {
            let session = u64::from_le_bytes(reader.take()?);
            Ok(Echo { session, sequence: u64::from_le_bytes(reader.take()?) })
        };
        let (own, echo) = (message()?, message()?);
        if own.session == 0 || own.sequence == 0 {
            return Err(Reject::Impossible);
        }
        Ok((Self { arm, epoch, own, echo }, reader))
    }
}
