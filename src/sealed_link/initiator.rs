//! The node's side: asks for a session, again until it has one, and for a new one at each arming or when
//! nothing is heard any more, as after a start of the robot.

use std::time::Duration;

use snow::HandshakeState;

use crate::datagram;
use crate::datagram::HEADER;
use crate::datagram::Kind;
use crate::handshake;
use crate::handshake::Failed;
use crate::handshake::INITIATION;
use crate::handshake::Keys;
use crate::handshake::RESPONSE;
use crate::reject::Reject;
use crate::reject::Rejects;
use crate::responder::COOKIE_REPLY;
use crate::session::Received;
use crate::session::Session;
use units::time::Instant;

/// What was not answered is asked again after this.
const ASK_AGAIN: Duration = Duration::from_millis(100);

/// A session in which nothing was let in for so long is given up for another.
const SILENT: Duration = Duration::from_secs(1);

/// The side that asks.
#[derive(Debug)]
pub struct Initiator {
    keys: Keys,
    /// Of the session asked for last.
    epoch: u64,
    /// When something of the peer's was last let in, or a session asked for.
    heard_at: Instant,
    session: Option<Session>,
    asking: Option<Asking>,
    rejects: Rejects,
}

/// A handshake under way.
#[derive(Debug)]
struct Asking {
    state: Box<HandshakeState>,
    epoch: u64,
    initiation: [u8; INITIATION],
    due: Instant,
}

impl Initiator {
    /// Nothing is asked for yet. Sessions are numbered from `epoch` on.
    pub fn new(keys: Keys, epoch: u64) -> Self {
        Self {
            keys,
            epoch,
            heard_at: Instant::ZERO,
            session: None,
            asking: None,
            rejects: Rejects::default(),
        }
    }

    /// Asks for a new session; the one there is, if any, goes on until it is granted.
    ///
    /// # Errors
    /// When there is no randomness. Then the old session goes on.
    pub fn begin(&mut self, now: Instant) -> Result<(), Failed> {
        (self.epoch, self.heard_at) = (self.epoch.wrapping_add(1), now);
        let epoch = self.epoch;
        let (state, initiation) = handshake::initiate(&self.keys, epoch)?;
        self.asking = Some(Asking { state: Box::new(state), epoch, initiation, due: now });
        Ok(())
    }

    /// The session, to seal with.
    pub const fn session(&mut self) -> Option<&mut Session> {
        self.session.as_mut()
    }

    /// What had no effect so far.
    pub const fn rejects(&self) -> &Rejects {
        &self.rejects
    }

    /// The initiation, whenever it is due.
    pub fn on_time(&mut self, now: Instant) -> Option<[u8; INITIATION]> {
        if self.asking.is_none() && now.since(self.heard_at) > SILENT {
            self.begin(now).ok()?;
        }
        let asking = self.asking.as_mut().filter(|asking| asking.due <= now)?;
        asking.due = now + ASK_AGAIN;
        Some(asking.initiation)
    }

    /// Takes a datagram: a sample, if it carries one that may act.
    pub fn on_datagram(&mut self, now: Instant, bytes: &[u8]) -> Option<Received> {
        let taken = self.take(now, bytes);
        taken.unwrap_or_else(|reject| {
            self.rejects.count(reject);
            None
        })
    }

    fn take(&mut self, now: Instant, bytes: &[u8]) -> Result<Option<Received>, Reject> {
        let (kind, epoch) = datagram::read_header(bytes)?;
        match kind {
            Kind::Content => {
                let received = self.session.as_mut().ok_or(Reject::Epoch)?.open(now, bytes)?;
                self.heard_at = now;
                Ok(Some(received))
            }
            Kind::Cookie => self.on_cookie(now, epoch, bytes).map(|()| None),
            Kind::Response => self.on_response(now, epoch, bytes).map(|()| None),
            Kind::Initiation => Err(Reject::Foreign),
        }
    }

    /// A cookie is not authentic, but who could not see the initiation does not know its beginning.
    fn on_cookie(&mut self, now: Instant, epoch: u64, bytes: &[u8]) -> Result<(), Reject> {
        let bytes: &[u8; COOKIE_REPLY] = bytes.try_into().map_err(|_| Reject::Length)?;
        let (_, rest) = bytes.split_at(HEADER);
        let (begun, cookie) = rest.split_at(rest.len() / 2);
        let asking = self.asking.as_mut().filter(|asking| asking.epoch == epoch);
        let asking = asking.ok_or(Reject::Epoch)?;
        let (initiation, place) = asking.initiation.split_at_mut(INITIATION - cookie.len());
        if initiation.get(HEADER..).is_none_or(|noise| !noise.starts_with(begun)) {
            return Err(Reject::Epoch);
        }
        // Asked again at once, but for the same cookie only once.
        if place != cookie {
            place.copy_from_slice(cookie);
            asking.due = now;
        }
        Ok(())
    }

    fn on_response(&mut self, now: Instant, epoch: u64, bytes: &[u8]) -> Result<(), Reject> {
        let bytes: &[u8; RESPONSE] = bytes.try_into().map_err(|_| Reject::Length)?;
        let asking = self.asking.as_mut().filter(|asking| asking.epoch == epoch);
        let asking = asking.ok_or(Reject::Epoch)?;
        let (_, message) = bytes.split_at(HEADER);
        asking.state.read_message(message, &mut []).map_err(|_| Reject::Tag)?;
        let Some(asking) = self.asking.take() else { return Err(Reject::Epoch) };
        let transport = asking.state.into_stateless_transport_mode().map_err(|_| Reject::Tag)?;
        self.session = Some(Session::new(transport, epoch));
        self.heard_at = now;
        Ok(())
    }
}
