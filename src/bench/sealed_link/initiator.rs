//! Node side: requests a session, and a new one at each arming or after a silence of the robot.

use std::time::Duration;

use snow::HandshakeState;

use crate::datagram::{self, HEADER, Kind};
use crate::handshake::{self, Failed, INITIATION, Keys, RESPONSE};
use crate::reject::{Reject, Rejects};
use crate::responder::COOKIE_REPLY;
use crate::session::{Received, Session};
use units::time::Instant;

/// Time after which an unanswered initiation is sent again.
const RETRY_PERIOD: Duration = Duration::from_millis(100);

/// Time without an accepted datagram after which a new session is requested.
const SESSION_TIMEOUT: Duration = Duration::from_secs(1);

/// Side that requests sessions.
#[derive(Debug)]
pub struct Initiator {
    keys: Keys,
    /// Epoch of the last session requested.
    epoch: u64,
    /// Time of the last accepted datagram, or of the last request.
    active_at: Instant,
    session: Option<Session>,
    handshake: Option<Handshake>,
    rejects: Rejects,
}

/// A handshake in progress.
#[derive(Debug)]
struct Handshake {
    state: Box<HandshakeState>,
    epoch: u64,
    initiation: [u8; INITIATION],
    due: Instant,
}

impl Initiator {
    /// Creates an initiator without a session. Epochs count from `epoch`.
    pub fn new(keys: Keys, epoch: u64) -> Self {
        Self {
            keys,
            epoch,
            active_at: Instant::ZERO,
            session: None,
            handshake: None,
            rejects: Rejects::default(),
        }
    }

    /// Requests a new session; the present one stays valid until the new one is granted.
    ///
    /// # Errors
    /// No randomness; the present session stays valid.
    pub fn begin(&mut self, now: Instant) -> Result<(), Failed> {
        (self.epoch, self.active_at) = (self.epoch.wrapping_add(1), now);
        let epoch = self.epoch;
        let (state, initiation) = handshake::initiate(&self.keys, epoch)?;
        self.handshake = Some(Handshake { state: Box::new(state), epoch, initiation, due: now });
        Ok(())
    }

    /// Returns the session, for sealing.
    pub const fn session(&mut self) -> Option<&mut Session> {
        self.session.as_mut()
    }

    /// Returns the counts of rejected datagrams.
    pub const fn rejects(&self) -> &Rejects {
        &self.rejects
    }

    /// Returns the initiation when it is due.
    pub fn on_time(&mut self, now: Instant) -> Option<[u8; INITIATION]> {
        if self.handshake.is_none() && now.since(self.active_at) > SESSION_TIMEOUT {
            self.begin(now).ok()?;
        }
        let handshake = self.handshake.as_mut().filter(|handshake| handshake.due <= now)?;
        handshake.due = now + RETRY_PERIOD;
        Some(handshake.initiation)
    }

    /// Handles a datagram; returns its content if that is accepted.
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
                self.active_at = now;
                Ok(Some(received))
            }
            Kind::Cookie => self.on_cookie(now, epoch, bytes).map(|()| None),
            Kind::Response => self.on_response(now, epoch, bytes).map(|()| None),
            Kind::Initiation => Err(Reject::Foreign),
        }
    }

    /// Handles a cookie. It is not authentic, but it must repeat the start of our initiation.
    fn on_cookie(&mut self, now: Instant, epoch: u64, bytes: &[u8]) -> Result<(), Reject> {
        let bytes: &[u8; COOKIE_REPLY] = bytes.try_into().map_err(|_| Reject::Length)?;
        let (_, rest) = bytes.split_at(HEADER);
        let (begun, cookie) = rest.split_at(rest.len() / 2);
        let handshake = self.handshake.as_mut().filter(|handshake| handshake.epoch == epoch);
        let handshake = handshake.ok_or(Reject::Epoch)?;
        let (initiation, place) = handshake.initiation.split_at_mut(INITIATION - cookie.len());
        if initiation.get(HEADER..).is_none_or(|noise| !noise.starts_with(begun)) {
            return Err(Reject::Epoch);
        }
        // Sends the initiation again at once, but only once per cookie.
        if place != cookie {
            place.copy_from_slice(cookie);
            handshake.due = now;
        }
        Ok(())
    }

    fn on_response(&mut self, now: Instant, epoch: u64, bytes: &[u8]) -> Result<(), Reject> {
        let bytes: &[u8; RESPONSE] = bytes.try_into().map_err(|_| Reject::Length)?;
        let handshake = self.handshake.as_mut().filter(|handshake| handshake.epoch == epoch);
        let handshake = handshake.ok_or(Reject::Epoch)?;
        let (_, message) = bytes.split_at(HEADER);
        handshake.state.read_message(message, &mut []).map_err(|_| Reject::Tag)?;
        let Some(handshake) = self.handshake.take() else { return Err(Reject::Epoch) };
        let transport = handshake.state.into_stateless_transport_mode().map_err(|_| Reject::Tag)?;
        self.session = Some(Session::new(transport, epoch));
        self.active_at = now;
        Ok(())
    }
}
