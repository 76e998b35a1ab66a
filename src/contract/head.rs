//! Head of every message: kind, version, arm, and the numbers from which its age follows. docs/link.md has the table.

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
        /// From the node, every cycle.
        Command = 1, "command";
        /// From the far side, every cycle.
        Feedback = 2, "feedback";
        /// From the far side, on request.
        Capability = 3, "capability";
    }
}

impl Kind {
    /// Reads the kind of a message; `None` if it is not CDR, or has another code.
    pub(crate) fn read(bytes: &[u8]) -> Option<Self> {
        let [code] = Reader::new(bytes).and_then(|mut reader| reader.take()).ok()?;
        Self::from_code(code)
    }
}

/// Identity of a message: session of its sender, and its number in that session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Echo {
    /// Session; zero for no message.
    pub session: u64,
    /// Number in the session, from 1; zero for no message.
    pub sequence: u64,
}

impl Echo {
    /// No message.
    pub const NONE: Self = Self { session: 0, sequence: 0 };
}

/// Head of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    /// Arm number, which both ends must share.
    pub arm: u16,
    /// Present epoch of the node's session.
    pub epoch: u32,
    /// Session and number of this message.
    pub own: Echo,
    /// Session and number of the newest message received from the other end.
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

    /// Checks kind, version and length of a message, and decodes its head. Returns it with a reader of the rest.
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
