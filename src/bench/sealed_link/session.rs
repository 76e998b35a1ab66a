//! One session: sealing and opening datagrams.

use snow::StatelessTransportState;
use thiserror::Error;

use crate::datagram::{self, Content, HEADER, Kind, LENGTH, PLAIN, Payload};
use crate::freshness::Freshness;
use crate::reject::Reject;
use crate::window::Window;
use units::time::Instant;

/// Keys and counters of a session.
#[derive(Debug)]
pub struct Session {
    transport: StatelessTransportState,
    epoch: u64,
    /// Number of datagrams sealed: the counter of the next one.
    sealed: u64,
    window: Window,
    freshness: Freshness,
    /// Newest stamp of the peer, on its clock.
    peer_stamp: Option<Instant>,
}

/// Sample time, and the newest stamp received from the peer by then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    at: Instant,
    echo: Option<Instant>,
}

/// Accepted content.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Received {
    /// Lower bound of the sample time, on our clock.
    pub at: Instant,
    /// The peer is armed.
    pub armed: bool,
    /// Content.
    pub content: Content,
}

/// The session has used all its 2⁶⁴ − 1 counters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("session counters exhausted")]
pub struct Exhausted;

impl Session {
    pub(super) fn new(transport: StatelessTransportState, epoch: u64) -> Self {
        Self {
            transport,
            epoch,
            sealed: 0,
            window: Window::default(),
            freshness: Freshness::default(),
            peer_stamp: None,
        }
    }

    /// Returns the epoch.
    pub const fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Returns whether an authentic datagram was received: only the peer has the keys.
    pub const fn is_confirmed(&self) -> bool {
        self.peer_stamp.is_some()
    }

    /// Returns the stamp of a sample taken at `now`; send it with that sample, however often.
    pub const fn stamp(&self, now: Instant) -> Stamp {
        Stamp { at: now, echo: self.peer_stamp }
    }

    /// Seals `content`, sampled at `stamp`.
    ///
    /// # Errors
    /// The counters are exhausted.
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

    /// Opens a datagram if it belongs to this session, and is authentic, new and fresh. One that is not authentic
    /// changes nothing.
    ///
    /// # Errors
    /// The reason to reject it.
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
        self.peer_stamp = self.peer_stamp.max(Some(payload.stamp));
        let at = self.freshness.check(now, counter, payload.echo)?;
        Ok(Received { at, armed: payload.armed, content: payload.content })
    }
}
