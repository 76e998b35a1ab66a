//! A talk on one bus: the only loop of the bench tools, and the only place where they wait.
//!
//! In no hurry: a frame the driver has no room for is kept and sent a little later. The node's cycle
//! must not do that, a tool may.

use std::collections::VecDeque;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering;
use std::time::Duration;

use bus::Bus;
use bus::BusEvent;
use bus::BusFault;
use bus::SendError;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::frame::Telegram;
use canopen::procedure::Procedure;
use units::time::Instant;

/// Whether to stop is looked at this often.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// A full transmit queue is tried again this often.
const RETRY_EVERY: Duration = Duration::from_millis(1);
/// With no room for so long, nothing leaves at all.
const STUCK_AFTER: Duration = Duration::from_millis(500);

/// Why a talk ended before its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SessionError {
    /// Somebody wanted it to stop.
    Interrupted,
    /// The interface went down or was unplugged.
    Down,
    /// The controller has left the bus.
    BusOff,
    /// Frames do not leave.
    Stuck,
}

impl fmt::Display for SessionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Interrupted => "interrupted",
            Self::Down => "the interface is down",
            Self::BusOff => "bus-off: the controller has left the bus",
            Self::Stuck => {
                "frames do not leave: nobody acknowledges them, or the bit rate is another"
            }
        })
    }
}

impl std::error::Error for SessionError {}

/// One bus, and who talks on it.
#[derive(Debug)]
pub struct Session<B> {
    bus: B,
    channel: Channel,
    stop: Arc<AtomicBool>,
    /// What the driver had no room for yet, and since when.
    queue: VecDeque<Frame>,
    full_since: Option<Instant>,
    /// Time does not run backwards, though stamps of frames may.
    latest: Instant,
}

impl<B: Bus> Session<B> {
    /// On one bus of `bus`, until `stop` is set.
    pub const fn new(bus: B, channel: Channel, stop: Arc<AtomicBool>) -> Self {
        let queue = VecDeque::new();
        Self { bus, channel, stop, queue, full_since: None, latest: Instant::ZERO }
    }

    /// The time now.
    pub fn now(&self) -> Instant {
        self.bus.now().max(self.latest)
    }

    /// The bus.
    pub const fn bus(&self) -> &B {
        &self.bus
    }

    /// Begins a procedure and carries it to its end.
    ///
    /// # Errors
    /// When the bus fails first, or it is to stop; the procedure has been abandoned then.
    pub fn run<P: Procedure>(
        &mut self,
        begin: impl FnOnce(Instant, &mut Vec<Frame>) -> P,
    ) -> Result<P::Outcome, SessionError> {
        let mut out = Vec::new();
        let mut procedure = begin(self.now(), &mut out);
        self.queue.extend(out);
        self.carry(&mut procedure)
    }

    /// Carries a procedure that has begun to its end, or to its next outcome if it has several.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn carry<P: Procedure>(&mut self, procedure: &mut P) -> Result<P::Outcome, SessionError> {
        let mut out = Vec::new();
        loop {
            self.post()?;
            if self.stop.load(Ordering::Relaxed) {
                procedure.abandon(self.now(), &mut out);
                self.queue.extend(out);
                self.flush()?;
                return Err(SessionError::Interrupted);
            }
            let outcome = match self.next(procedure.deadline())? {
                Some(frame) => procedure.on_frame(self.latest, &frame, &mut out),
                None => {
                    let now = self.now();
                    let is_due = procedure.deadline().is_some_and(|due| due <= now);
                    if is_due { procedure.on_time(now, &mut out) } else { None }
                }
            };
            self.queue.extend(out.drain(..));
            if let Some(outcome) = outcome {
                self.flush()?;
                return Ok(outcome);
            }
        }
    }

    /// Sends frames nothing is to come of.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn say(&mut self, frames: impl IntoIterator<Item = Frame>) -> Result<(), SessionError> {
        self.queue(frames);
        self.flush()
    }

    /// What a procedure begins with, to be sent when it is [carried](Self::carry) on.
    pub fn queue(&mut self, frames: impl IntoIterator<Item = Frame>) {
        self.queue.extend(frames);
    }

    /// The next frame until `due`, if one comes that soon.
    fn next(&mut self, due: Option<Instant>) -> Result<Option<Frame>, SessionError> {
        let now = self.now();
        let look = now + if self.queue.is_empty() { LOOK_EVERY } else { RETRY_EVERY };
        let Some(received) = self.bus.receive(due.map_or(look, |due| due.min(look))) else {
            return Ok(None);
        };
        self.latest = self.latest.max(received.at);
        match received.event {
            BusEvent::Frame(frame) if received.channel == self.channel => Ok(Some(frame)),
            BusEvent::Frame(_) => Ok(None),
            BusEvent::Fault(BusFault::Down) => Err(SessionError::Down),
            BusEvent::Fault(BusFault::Off) => Err(SessionError::BusOff),
            BusEvent::Fault(
                fault @ (BusFault::Warning | BusFault::Overrun | BusFault::Passive),
            ) => {
                tracing::warn!("{}", description(fault));
                Ok(None)
            }
        }
    }

    /// Hands over all there is room for.
    fn post(&mut self) -> Result<(), SessionError> {
        while let Some(frame) = self.queue.front() {
            match self.bus.send(Telegram { channel: self.channel, frame: *frame }) {
                Ok(()) => {
                    self.queue.pop_front();
                    self.full_since = None;
                }
                Err(SendError::Down) => return Err(SessionError::Down),
                Err(SendError::Full) => {
                    let now = self.now();
                    let since = *self.full_since.get_or_insert(now);
                    let is_stuck = now.since(since) >= STUCK_AFTER;
                    return if is_stuck { Err(SessionError::Stuck) } else { Ok(()) };
                }
            }
        }
        Ok(())
    }

    /// Hands over everything: the last word must be out before the program ends.
    fn flush(&mut self) -> Result<(), SessionError> {
        self.post()?;
        while !self.queue.is_empty() {
            self.next(None)?;
            self.post()?;
        }
        Ok(())
    }
}

/// What the user should look for.
const fn description(fault: BusFault) -> &'static str {
    match fault {
        BusFault::Warning => "many errors on the bus",
        BusFault::Overrun => "frames were lost before they were read",
        BusFault::Passive => "error-passive: nobody acknowledges, or the bit rate is another",
        BusFault::Off => "bus-off",
        BusFault::Down => "the interface is down",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::Received;
    use canopen::NodeId;
    use canopen::object::Object;
    use canopen::sdo::SdoError;
    use canopen::sdo::Transfer;

    /// A bus nobody else is on.
    #[derive(Default)]
    struct Lonely {
        now: Instant,
        room: usize,
        sent: Vec<Frame>,
        fault: Option<BusFault>,
    }

    impl Bus for Lonely {
        fn now(&self) -> Instant {
            self.now
        }

        fn wall(&self) -> Duration {
            Duration::ZERO
        }

        fn send(&mut self, telegram: Telegram) -> Result<(), SendError> {
            if self.room == 0 {
                return Err(SendError::Full);
            }
            self.room -= 1;
            self.sent.push(telegram.frame);
            Ok(())
        }

        fn receive(&mut self, until: Instant) -> Option<Received> {
            self.now = self.now.max(until);
            let event = BusEvent::Fault(self.fault.take()?);
            Some(Received { at: self.now, channel: Channel(0), event })
        }
    }

    const TIMEOUT: Duration = Duration::from_millis(100);

    fn session(bus: Lonely) -> Session<Lonely> {
        Session::new(bus, Channel(0), Arc::default())
    }

    fn read(now: Instant, out: &mut Vec<Frame>) -> Transfer {
        Transfer::read(NodeId::new(5).unwrap(), Object::DEVICE_TYPE, TIMEOUT, now, out)
    }

    #[test]
    fn silence_ends_with_the_deadline_and_the_last_word_is_out() {
        let mut session = session(Lonely { room: 9, ..Lonely::default() });
        assert_eq!(session.run(read), Ok(Err(SdoError::Timeout)));
        assert_eq!(session.bus.sent.len(), 2, "the request and its abort");
        assert_eq!(session.now(), Instant::ZERO + TIMEOUT);
    }

    #[test]
    fn who_is_to_stop_says_so_before() {
        let mut session = session(Lonely { room: 9, ..Lonely::default() });
        session.stop.store(true, Ordering::Relaxed);
        assert_eq!(session.run(read), Err(SessionError::Interrupted));
        assert_eq!(session.bus.sent.len(), 2, "the request and its abort");
    }

    #[test]
    fn what_never_leaves_is_told() {
        let mut session = session(Lonely::default());
        assert_eq!(session.say([Frame::new(0x80, [])]), Err(SessionError::Stuck));
        assert!(session.now() >= Instant::ZERO + STUCK_AFTER);
    }

    #[test]
    fn a_bus_that_fails_ends_the_talk_and_one_that_is_troubled_does_not() {
        for (fault, outcome) in [
            (BusFault::Down, Err(SessionError::Down)),
            (BusFault::Off, Err(SessionError::BusOff)),
            (BusFault::Passive, Ok(Err(SdoError::Timeout))),
        ] {
            let bus = Lonely { room: 9, fault: Some(fault), ..Lonely::default() };
            assert_eq!(session(bus).run(read), outcome);
        }
    }
}
