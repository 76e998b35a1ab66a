//! The seal of `sealed_link` before each message over UDP.
//!
//! It seals content of its own and no other bytes. So its datagram travels before the contract's message, which acts only
//! where the datagram was accepted: handshake, window and age limit are measured, the cost of sealing 188 bytes is not.

use sealed_link::datagram::{Content, LENGTH};
use sealed_link::handshake::{INITIATION, KEY, Keys, RESPONSE};
use sealed_link::initiator::Initiator;
use sealed_link::responder::{COOKIE_REPLY, Outcome as Answer, Responder};
use sealed_link::session::Session;
use units::spatial::Motion;
use units::time::Instant;

use crate::Outcome;

/// Seal of one end.
#[derive(Debug)]
pub(crate) enum Seal {
    /// The carrier seals.
    Carrier,
    /// The node requests a session.
    Near(Box<Initiator>),
    /// The far side grants it.
    Far(Box<Responder>),
}

/// Result of a packet.
#[derive(Debug)]
pub(crate) enum Opened<'b> {
    /// A message, accepted.
    Message(&'b [u8]),
    /// The answer of a handshake, to be sent.
    Answer(Vec<u8>),
    /// No effect.
    Nothing,
}

impl Seal {
    /// The node's seal, with a session requested.
    pub(crate) fn near(now: Instant, keys: Keys) -> Outcome<Self> {
        let mut initiator = Initiator::new(keys, now.as_micros());
        initiator.begin(now)?;
        Ok(Self::Near(Box::new(initiator)))
    }

    /// The far side's seal.
    pub(crate) fn far(keys: Keys) -> Self {
        // A measurement needs no secret cookies.
        Self::Far(Box::new(Responder::new(keys, [7; 32])))
    }

    /// Returns the packet of a handshake that is due.
    pub(crate) fn on_time(&mut self, now: Instant) -> Option<Vec<u8>> {
        match self {
            Self::Near(initiator) => initiator.on_time(now).map(|bytes| bytes.to_vec()),
            Self::Carrier | Self::Far(_) => None,
        }
    }

    /// Returns the start of a packet; `None` before the session.
    pub(crate) fn start(&mut self, now: Instant) -> Option<Vec<u8>> {
        let session = match self {
            Self::Carrier => return Some(Vec::new()),
            Self::Near(initiator) => initiator.session(),
            Self::Far(responder) => responder.session(),
        };
        session.and_then(|session| seal(session, now))
    }

    /// Opens a packet.
    pub(crate) fn open<'b>(&mut self, now: Instant, packet: &'b [u8]) -> Opened<'b> {
        let is_handshake = matches!(packet.len(), INITIATION | RESPONSE | COOKIE_REPLY);
        let (start, message) = packet.split_at(LENGTH.min(packet.len()));
        let start = if is_handshake { packet } else { start };
        let is_accepted = match self {
            Self::Carrier => return Opened::Message(packet),
            Self::Near(initiator) => initiator.on_datagram(now, start).is_some(),
            Self::Far(responder) => match responder.on_datagram(now, b"near", start) {
                Answer::Cookie(bytes) => return Opened::Answer(bytes.to_vec()),
                Answer::Response(bytes) => return Opened::Answer(bytes.to_vec()),
                Answer::Command(_) => true,
                Answer::Nothing => false,
            },
        };
        if is_accepted { Opened::Message(message) } else { Opened::Nothing }
    }
}

fn seal(session: &mut Session, now: Instant) -> Option<Vec<u8>> {
    let stamp = session.stamp(now);
    session.seal(stamp, true, Content::Command(Motion::Hold)).ok().map(|bytes| bytes.to_vec())
}

/// Keys as hexadecimal numbers, for the far side's arguments.
pub(crate) fn encode(keys: &Keys) -> String {
    keys.secret.iter().chain(&keys.peer).map(|byte| format!("{byte:02x}")).collect()
}

/// Reads such numbers.
pub(crate) fn decode(text: &str) -> Outcome<Keys> {
    let digits = |at: usize| text.get(2 * at..2 * at + 2).ok_or("keys are too short");
    let mut bytes = [0; 2 * KEY];
    for (at, byte) in bytes.iter_mut().enumerate() {
        *byte = u8::from_str_radix(digits(at)?, 16)?;
    }
    let (secret, peer) = bytes.split_at(KEY);
    Ok(Keys { secret: secret.try_into()?, peer: peer.try_into()? })
}

// The length alone separates handshakes from messages.
const _: () = assert!(COOKIE_REPLY < LENGTH && RESPONSE < LENGTH && INITIATION < LENGTH + 40);
