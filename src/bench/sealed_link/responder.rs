//! Robot side: grants sessions to its one peer, one at a time.
//!
//! A granted session starts with its first authentic datagram: only the peer can have sent it, whatever the source of
//! the initiation. A session that is armed and active is not replaced.

use std::time::Duration;

use crate::cookie::{COOKIE, Cookies};
use crate::datagram::{self, HEADER, Kind};
use crate::freshness::MAX_AGE;
use crate::handshake::{self, INITIATION, Keys, RESPONSE};
use crate::reject::{Reject, Rejects};
use crate::session::{Received, Session};
use units::time::Instant;

/// Bytes of a cookie reply.
pub const COOKIE_REPLY: usize = HEADER + 2 * COOKIE;

/// Maximum initiations processed per [`LIMIT_PERIOD`]; each costs four curve multiplications.
const MAX_INITIATIONS: u32 = 8;

/// Period of that limit.
const LIMIT_PERIOD: Duration = Duration::from_secs(1);

/// Side that grants sessions.
#[derive(Debug)]
pub struct Responder {
    keys: Keys,
    cookies: Cookies,
    session: Option<Session>,
    granted: Option<Granted>,
    /// Time of the last datagram of an armed peer.
    armed_at: Option<Instant>,
    /// Start of the limit period, and initiations in it.
    worked: (Instant, u32),
    rejects: Rejects,
}

/// A session granted but not started. The same initiation gets the same response, so a delayed or repeated one leads to
/// one session.
#[derive(Debug)]
struct Granted {
    session: Session,
    initiation: [u8; INITIATION],
    response: [u8; RESPONSE],
}

/// Result of a datagram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// No effect.
    Nothing,
    /// Accepted command.
    Command(Received),
    /// Reply to an initiation without a cookie.
    Cookie([u8; COOKIE_REPLY]),
    /// Reply to an initiation.
    Response([u8; RESPONSE]),
}

impl Responder {
    /// Creates a responder without a session. `secret` is for cookies, random at each start.
    pub fn new(keys: Keys, secret: [u8; 32]) -> Self {
        Self {
            keys,
            cookies: Cookies::new(secret),
            session: None,
            granted: None,
            armed_at: None,
            worked: (Instant::ZERO, 0),
            rejects: Rejects::default(),
        }
    }

    /// Returns the session, for sealing.
    pub const fn session(&mut self) -> Option<&mut Session> {
        self.session.as_mut()
    }

    /// Returns the counts of rejected datagrams.
    pub const fn rejects(&self) -> &Rejects {
        &self.rejects
    }

    /// Handles a datagram from `address`.
    pub fn on_datagram(&mut self, now: Instant, address: &[u8], bytes: &[u8]) -> Outcome {
        let taken = datagram::read_header(bytes).and_then(|(kind, epoch)| match kind {
            Kind::Content => self.on_content(now, epoch, bytes),
            Kind::Initiation => self.on_initiation(now, address, epoch, bytes),
            Kind::Cookie | Kind::Response => Err(Reject::Foreign),
        });
        taken.unwrap_or_else(|reject| {
            self.rejects.count(reject);
            Outcome::Nothing
        })
    }

    fn on_content(&mut self, now: Instant, epoch: u64, bytes: &[u8]) -> Result<Outcome, Reject> {
        // The granted session comes first: a restarted node may use the same epochs again.
        if let Some(mut granted) = self.granted.take_if(|granted| granted.session.epoch() == epoch)
        {
            let opened = granted.session.open(now, bytes);
            if granted.session.is_confirmed() {
                self.start_session(now, granted.session)?;
                return opened.map(Outcome::Command);
            }
            self.granted = Some(granted);
        }
        let session = self.session.as_mut().filter(|session| session.epoch() == epoch);
        let received = session.ok_or(Reject::Epoch)?.open(now, bytes)?;
        self.armed_at = received.armed.then_some(now);
        Ok(Outcome::Command(received))
    }

    /// Replaces the session, unless the present one is in use.
    fn start_session(&mut self, now: Instant, session: Session) -> Result<(), Reject> {
        if self.is_in_use(now) {
            return Err(Reject::InUse);
        }
        (self.session, self.armed_at) = (Some(session), None);
        Ok(())
    }

    fn on_initiation(
        &mut self,
        now: Instant,
        address: &[u8],
        epoch: u64,
        bytes: &[u8],
    ) -> Result<Outcome, Reject> {
        let bytes: &[u8; INITIATION] = bytes.try_into().map_err(|_| Reject::Length)?;
        let (rest, cookie) = bytes.split_last_chunk::<COOKIE>().ok_or(Reject::Length)?;
        let (_, message) = rest.split_at(HEADER);
        if !self.cookies.is_valid(now, address, cookie) {
            self.rejects.count(Reject::Cookie);
            return Ok(Outcome::Cookie(self.cookie_reply(now, address, epoch, message)));
        }
        if self.is_in_use(now) {
            return Err(Reject::InUse);
        }
        if let Some(granted) = self.granted.as_ref().filter(|granted| granted.initiation == *bytes)
        {
            return Ok(Outcome::Response(granted.response));
        }
        self.limit_rate(now)?;
        let granted = handshake::respond(&self.keys, epoch, message);
        let (transport, response) = granted.map_err(|_| Reject::Tag)?;
        let session = Session::new(transport, epoch);
        self.granted = Some(Granted { session, initiation: *bytes, response });
        Ok(Outcome::Response(response))
    }

    fn cookie_reply(
        &self,
        now: Instant,
        address: &[u8],
        epoch: u64,
        message: &[u8],
    ) -> [u8; COOKIE_REPLY] {
        let header = datagram::header(Kind::Cookie, epoch);
        let first_bytes = message.iter().copied().take(COOKIE);
        let reply = header.into_iter().chain(first_bytes).chain(self.cookies.of(now, address));
        let mut bytes = [0; COOKIE_REPLY];
        bytes.iter_mut().zip(reply).for_each(|(place, byte)| *place = byte);
        bytes
    }

    /// Returns whether the present session is armed and active.
    fn is_in_use(&self, now: Instant) -> bool {
        self.armed_at.is_some_and(|at| now.since(at) <= MAX_AGE)
    }

    /// Counts an initiation against the rate limit.
    fn limit_rate(&mut self, now: Instant) -> Result<(), Reject> {
        let (since, worked) = self.worked;
        let (since, worked) =
            if now.since(since) >= LIMIT_PERIOD { (now, 0) } else { (since, worked) };
        if worked >= MAX_INITIATIONS {
            return Err(Reject::Busy);
        }
        self.worked = (since, worked + 1);
        Ok(())
    }
}
