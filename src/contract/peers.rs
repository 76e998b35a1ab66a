//! Sessions of the other end: which of them is current, what to echo, and which were left.

use std::time::Duration;

use crate::head::Echo;
use crate::reject::Reject;
use units::time::Instant;

/// Maximum number of sessions that are remembered as left; with more, no new one becomes current.
const MAX_LEFT: usize = 4_096;

/// Sessions of the other end.
#[derive(Clone, Debug)]
pub(crate) struct Peers {
    /// Age of an echo from which the current session may be replaced.
    max_age: Duration,
    current: Option<Peer>,
    /// Newest message of the current session, or of one that may become current.
    echo: Echo,
    left: Vec<u64>,
    /// Messages of current sessions that were not received.
    lost: u64,
}

/// The current session.
#[derive(Clone, Copy, Debug)]
struct Peer {
    session: u64,
    /// Messages received, whatever their echo.
    received: Received,
    /// Send time of the newest echo.
    fresh_at: Instant,
}

/// Numbers of the messages received: the newest, and a bit for each of the 128 up to it.
#[derive(Clone, Copy, Debug)]
struct Received {
    newest: u64,
    bits: u128,
}

impl Received {
    /// Takes a number, and adjusts the count of lost messages.
    fn take(&mut self, sequence: u64, lost: &mut u64) -> Result<(), Reject> {
        if let Some(back) = self.newest.checked_sub(sequence) {
            let bit = u32::try_from(back).ok().and_then(|back| 1_u128.checked_shl(back));
            let bit = bit.filter(|bit| self.bits & bit == 0).ok_or(Reject::Replayed)?;
            self.bits |= bit;
            *lost = lost.saturating_sub(1);
            return Err(Reject::Overtaken);
        }
        let ahead = sequence - self.newest;
        let kept = u32::try_from(ahead).ok().and_then(|ahead| self.bits.checked_shl(ahead));
        *self = Self { newest: sequence, bits: kept.unwrap_or_default() | 1 };
        *lost = lost.saturating_add(ahead - 1);
        Ok(())
    }
}

/// A message that passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Admission {
    /// Send time of its echo: it was made after that.
    pub(crate) at: Instant,
    /// Its session has become current.
    pub(crate) is_new_session: bool,
}

impl Peers {
    pub(crate) const fn new(max_age: Duration) -> Self {
        Self { max_age, current: None, echo: Echo::NONE, left: Vec::new(), lost: 0 }
    }

    /// Returns the message to echo.
    pub(crate) const fn echo(&self) -> Echo {
        self.echo
    }

    /// Returns the current session; zero for none.
    pub(crate) fn session(&self) -> u64 {
        self.current.map_or(0, |current| current.session)
    }

    /// Returns the number of messages lost.
    pub(crate) const fn lost(&self) -> u64 {
        self.lost
    }

    /// Checks a message by its session and number, and by the send time of its echo. `None`: a first message, whose sender
    /// has received nothing yet.
    ///
    /// Only a fresh echo makes a session current, and only when the current one has none. A message of the current session
    /// is echoed even if its own echo is too old, or two ends would never find back to each other after an interruption.
    ///
    /// # Errors
    /// The reason why the message must not act.
    pub(crate) fn admit(
        &mut self,
        now: Instant,
        message: Echo,
        echo: Echo,
        sent_at: Result<Instant, Reject>,
    ) -> Result<Option<Admission>, Reject> {
        if let Some(current) = self.current.as_mut().filter(|one| one.session == message.session) {
            current.received.take(message.sequence, &mut self.lost)?;
            self.echo = message;
            let at = sent_at?;
            current.fresh_at = current.fresh_at.max(at);
            return Ok(Some(Admission { at, is_new_session: false }));
        }
        self.check_other(now, message)?;
        self.echo = message;
        if echo == Echo::NONE {
            return Ok(None);
        }
        let at = sent_at?;
        self.left.extend(self.current.map(|current| current.session));
        let Echo { session, sequence } = message;
        // What comes late of before is not counted as lost.
        let received = Received { newest: sequence, bits: u128::MAX };
        self.current = Some(Peer { session, received, fresh_at: at });
        Ok(Some(Admission { at, is_new_session: true }))
    }

    /// Checks that a session other than the current one may become current.
    fn check_other(&self, now: Instant, message: Echo) -> Result<(), Reject> {
        if self.current.is_some_and(|current| now.since(current.fresh_at) <= self.max_age) {
            return Err(Reject::NotLeader);
        }
        if self.left.contains(&message.session) || self.left.len() >= MAX_LEFT {
            return Err(Reject::Left);
        }
        let is_overtaken =
            self.echo.session == message.session && message.sequence <= self.echo.sequence;
        if is_overtaken { Err(Reject::Overtaken) } else { Ok(()) }
    }
}
