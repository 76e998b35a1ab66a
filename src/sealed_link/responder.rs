//! The robot's side: grants sessions to the one peer it knows, one at a time.
//!
//! A session that was granted is taken up when its first authentic datagram comes: only the peer can have
//! sent that, whoever sent the initiation. While the session there is is armed and heard, it is not replaced
//! by any other.

use std::time::Duration;

use crate::cookie::COOKIE;
use crate::cookie::Cookies;
use crate::datagram;
use crate::datagram::HEADER;
use crate::datagram::Kind;
use crate::freshness::OLDEST;
use crate::handshake;
use crate::handshake::INITIATION;
use crate::handshake::Keys;
use crate::handshake::RESPONSE;
use crate::reject::Reject;
use crate::reject::Rejects;
use crate::session::Received;
use crate::session::Session;
use units::time::Instant;

/// Bytes of a cookie reply.
pub const COOKIE_REPLY: usize = HEADER + 2 * COOKIE;

/// Initiations that are worked at within [`REFILL`]; each costs four multiplications on the curve.
const MOST: u32 = 8;

/// How often that many may come.
const REFILL: Duration = Duration::from_secs(1);

/// The side that is asked.
#[derive(Debug)]
pub struct Responder {
    keys: Keys,
    cookies: Cookies,
    session: Option<Session>,
    granted: Option<Granted>,
    /// When the session last said that it is armed.
    armed_at: Option<Instant>,
    /// Initiations worked at, since when.
    worked: (Instant, u32),
    rejects: Rejects,
}

/// A session that was granted and not taken up yet. The same initiation has the same answer, so that one
/// which is answered late or twice leads to one session.
#[derive(Debug)]
struct Granted {
    session: Session,
    initiation: [u8; INITIATION],
    response: [u8; RESPONSE],
}

/// What came of a datagram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Nothing.
    Nothing,
    /// A command that may act.
    Command(Received),
    /// To be answered so: an initiation without its cookie.
    Cookie([u8; COOKIE_REPLY]),
    /// To be answered so: an initiation.
    Response([u8; RESPONSE]),
}

impl Responder {
    /// Nobody has asked yet. `secret` is for cookies, and new at each start.
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

    /// The session, to seal with.
    pub const fn session(&mut self) -> Option<&mut Session> {
        self.session.as_mut()
    }

    /// What had no effect so far.
    pub const fn rejects(&self) -> &Rejects {
        &self.rejects
    }

    /// Takes a datagram that came from `address`.
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
        // Looked at first: a node that has started anew may number its sessions as before.
        if let Some(mut granted) = self.granted.take_if(|granted| granted.session.epoch() == epoch)
        {
            let opened = granted.session.open(now, bytes);
            if granted.session.is_confirmed() {
                self.take_up(now, granted.session)?;
                return opened.map(Outcome::Command);
            }
            self.granted = Some(granted);
        }
        let session = self.session.as_mut().filter(|session| session.epoch() == epoch);
        let received = session.ok_or(Reject::Epoch)?.open(now, bytes)?;
        self.armed_at = received.armed.then_some(now);
        Ok(Outcome::Command(received))
    }

    /// From now on the session is this one, unless the one there is is in use.
    fn take_up(&mut self, now: Instant, session: Session) -> Result<(), Reject> {
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
        if !self.cookies.is_good(now, address, cookie) {
            self.rejects.count(Reject::Cookie);
            return Ok(Outcome::Cookie(self.ask_for_cookie(now, address, epoch, message)));
        }
        if self.is_in_use(now) {
            return Err(Reject::InUse);
        }
        if let Some(granted) = self.granted.as_ref().filter(|granted| granted.initiation == *bytes)
        {
            return Ok(Outcome::Response(granted.response));
        }
        self.work(now)?;
        let granted = handshake::respond(&self.keys, epoch, message);
        let (transport, response) = granted.map_err(|_| Reject::Tag)?;
        let session = Session::new(transport, epoch);
        self.granted = Some(Granted { session, initiation: *bytes, response });
        Ok(Outcome::Response(response))
    }

    fn ask_for_cookie(
        &self,
        now: Instant,
        address: &[u8],
        epoch: u64,
        message: &[u8],
    ) -> [u8; COOKIE_REPLY] {
        let header = datagram::header(Kind::Cookie, epoch);
        let begun = message.iter().copied().take(COOKIE);
        let reply = header.into_iter().chain(begun).chain(self.cookies.of(now, address));
        let mut bytes = [0; COOKIE_REPLY];
        bytes.iter_mut().zip(reply).for_each(|(place, byte)| *place = byte);
        bytes
    }

    /// Whether the session there is is armed and heard.
    fn is_in_use(&self, now: Instant) -> bool {
        self.armed_at.is_some_and(|at| now.since(at) <= OLDEST)
    }

    /// One more initiation, if that is not too many.
    fn work(&mut self, now: Instant) -> Result<(), Reject> {
        let (since, worked) = self.worked;
        let (since, worked) = if now.since(since) >= REFILL { (now, 0) } else { (since, worked) };
        if worked >= MOST {
            return Err(Reject::Busy);
        }
        self.worked = (since, worked + 1);
        Ok(())
    }
}
