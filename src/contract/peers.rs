//! Sessions of the other end: the current one, the message to echo, and former sessions.

use std::time::Duration;

use crate::head::Echo;
use crate::reject::Reject;
use units::time::Instant;

/// Maximum number of former sessions; at the maximum no new session becomes current.
const MAX_LEFT: usize = 4_096;

/// Sessions of the other end.
#[derive(Clone, Debug)]
pub(crate) struct Peers {
    /// Age of the newest echo after which another session may replace the current one.
    max_age: Duration,
    current: Option<Peer>,
    /// Newest message of the current session, or of one that may become current.
    echo: Echo,
    /// Former sessions.
    left: Vec<u64>,
    /// Number of messages of current sessions not received.
    lost: u64,
}

/// Current session.
#[derive(Clone, Copy, Debug)]
struct Peer {
    session: u64,
    /// Numbers of received messages, with any echo.
    received: ReplayWindow,
    /// Send time of the newest echo.
    fresh_at: Instant,
}

/// Replay window: the newest number received, and one bit for each of the 128 numbers up to it.
#[derive(Clone, Copy, Debug)]
struct ReplayWindow {
    newest: u64,
    bits: u128,
}

impl ReplayWindow {
    /// Records a number and adjusts the count of lost messages. Returns an error for a number received before, out of the
    /// window, or overtaken.
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

/// Accepted message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Admission {
    /// Send time of the echoed message: a lower bound of this message's send time.
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

    /// Returns the current session; zero without one.
    pub(crate) fn session(&self) -> u64 {
        self.current.map_or(0, |current| current.session)
    }

    /// Returns the number of messages lost.
    pub(crate) const fn lost(&self) -> u64 {
        self.lost
    }

    /// Checks a message by its session and number, and by the send time of its echo. Returns `None` for a first message,
    /// whose sender has not received one yet.
    ///
    /// Only a fresh echo makes a session current, and only if the current session has no fresh echo. A message of the current
    /// session is echoed even if its own echo is too old. Otherwise both ends could not resume after an interruption.
    ///
    /// # Errors
    /// Returns the reason why the message is rejected.
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
        // Earlier messages that arrive late do not change the count of lost messages.
        let received = ReplayWindow { newest: sequence, bits: u128::MAX };
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
