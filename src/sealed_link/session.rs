//! One session: what is sealed with its keys, and what of the peer's is let in.

use snow::StatelessTransportState;
use thiserror::Error;

use crate::datagram;
use crate::datagram::Content;
use crate::datagram::HEADER;
use crate::datagram::Kind;
use crate::datagram::LENGTH;
use crate::datagram::PLAIN;
use crate::datagram::Payload;
use crate::freshness::Freshness;
use crate::reject::Reject;
use crate::window::Window;
use units::time::Instant;

/// What both sides have in common until the next handshake.
#[derive(Debug)]
pub struct Session {
    transport: StatelessTransportState,
    epoch: u64,
    /// Datagrams sealed so far: the counter of the next one.
    sealed: u64,
    window: Window,
    freshness: Freshness,
    /// The newest stamp of the peer's, on its clock.
    heard: Option<Instant>,
}

/// When something was sampled, and what had been heard of the peer by then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    at: Instant,
    echo: Option<Instant>,
}

/// What was let in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Received {
    /// It was sampled then or later, on our own clock.
    pub at: Instant,
    /// Whether the peer is armed.
    pub armed: bool,
    /// What it says.
    pub content: Content,
}

/// A session that has used up its counters, after 2⁶⁴ − 1 datagrams.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("no counter is left in this session")]
pub struct Exhausted;

impl Session {
    pub(super) fn new(transport: StatelessTransportState, epoch: u64) -> Self {
        Self {
            transport,
            epoch,
            sealed: 0,
            window: Window::default(),
            freshness: Freshness::default(),
            heard: None,
        }
    }

    /// Which session it is.
    pub const fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Whether an authentic datagram has come: only the peer has this session's keys.
    pub const fn is_confirmed(&self) -> bool {
        self.heard.is_some()
    }

    /// To be taken when the sample is taken, and sent with it however often.
    pub const fn stamp(&self, now: Instant) -> Stamp {
        Stamp { at: now, echo: self.heard }
    }

    /// A datagram that carries `content`, sampled at `stamp`.
    ///
    /// # Errors
    /// When the session is at its end.
    pub fn seal(
        &mut self,
        stamp: Stamp,
        armed: bool,
        content: Content,
    ) -> Result<[u8; LENGTH], Exhausted> {
        let Stamp { at, echo } = stamp;
        let plain = Payload { stamp: at, echo, armed, content }.encode();
        let mut bytes = [0; LENGTH];
        let (header, rest) = bytes.split_at_mut(HEADER);
        header.copy_from_slice(&datagram::header(Kind::Content, self.epoch));
        let (counter, sealed) = rest.split_at_mut(size_of::<u64>());
        counter.copy_from_slice(&self.sealed.to_le_bytes());
        self.transport.write_message(self.sealed, &plain, sealed).map_err(|_| Exhausted)?;
        self.sealed = self.sealed.checked_add(1).ok_or(Exhausted)?;
        Ok(bytes)
    }

    /// Lets a datagram with content in, if it is this session's, authentic, new and fresh. One that is not
    /// authentic changes nothing.
    ///
    /// # Errors
    /// Why it is not let in.
    pub fn open(&mut self, now: Instant, bytes: &[u8]) -> Result<Received, Reject> {
        let bytes: &[u8; LENGTH] = bytes.try_into().map_err(|_| Reject::Length)?;
        match datagram::read_header(bytes)? {
            (Kind::Content, epoch) if epoch == self.epoch => {}
            (Kind::Content, _) => return Err(Reject::Epoch),
            (Kind::Initiation | Kind::Cookie | Kind::Response, _) => return Err(Reject::Foreign),
        }
        let (_, rest) = bytes.split_at(HEADER);
        let (counter, sealed) = rest.split_first_chunk().ok_or(Reject::Length)?;
        let counter = u64::from_le_bytes(*counter);
        self.window.check(counter)?;
        let mut plain = [0; PLAIN];
        self.transport.read_message(counter, sealed, &mut plain).map_err(|_| Reject::Tag)?;

        self.window.take(counter);
        let payload = Payload::decode(&plain)?;
        self.heard = self.heard.max(Some(payload.stamp));
        let at = self.freshness.judge(now, counter, payload.echo)?;
        Ok(Received { at, armed: payload.armed, content: payload.content })
    }
}
