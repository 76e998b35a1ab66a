//! Session on one bus: the event loop of the live-bus tools.
//!
//! A frame that the driver does not accept is queued and sent later. A tool may do so; the node's cycle must not.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use thiserror::Error;

use bus::{Bus, BusError, BusEvent, SendError};
use canopen::frame::{Channel, Frame, Telegram};
use canopen_tools::procedure::Procedure;
use units::time::Instant;

/// Interval of checks of the stop flag.
const STOP_POLL: Duration = Duration::from_millis(50);
/// Interval of retries while the transmit queue of the driver is full.
const RETRY_INTERVAL: Duration = Duration::from_millis(1);
/// Time for which the transmit queue may be full before the session fails.
const TRANSMIT_TIMEOUT: Duration = Duration::from_millis(500);

/// Reasons why a session ended early.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SessionError {
    /// Stop flag that was set.
    #[error("interrupted")]
    Interrupted,
    /// Interface that went down or was unplugged.
    #[error("the interface is down")]
    Down,
    /// Controller in state bus-off.
    #[error("bus-off: the controller has left the bus")]
    BusOff,
    /// Controller that transmits no frames.
    #[error("no frame is transmitted: no node acknowledges, or the bit rate differs")]
    Stuck,
}

/// Session on one bus.
#[derive(Debug)]
pub struct Session<B> {
    bus: B,
    channel: Channel,
    stop: Arc<AtomicBool>,
    /// Frames that the driver has not accepted yet.
    queue: VecDeque<Frame>,
    full_since: Option<Instant>,
    /// Newest time seen: timestamps of frames may go back, the session's time may not.
    latest: Instant,
}

impl<B: Bus> Session<B> {
    /// Returns a session on one channel of `bus`, which ends when `stop` is set.
    pub const fn new(bus: B, channel: Channel, stop: Arc<AtomicBool>) -> Self {
        let queue = VecDeque::new();
        Self { bus, channel, stop, queue, full_since: None, latest: Instant::ZERO }
    }

    /// Returns the current time.
    pub fn now(&self) -> Instant {
        self.bus.now().max(self.latest)
    }

    /// Returns the bus, which is idle between procedures.
    pub const fn bus(&self) -> &B {
        &self.bus
    }

    /// Starts a procedure and runs it to its outcome.
    ///
    /// # Errors
    /// Returns an error if the bus fails, or `stop` is set; the procedure is then aborted.
    pub fn run<P: Procedure>(
        &mut self,
        begin: impl FnOnce(Instant, &mut Vec<Frame>) -> P,
    ) -> Result<P::Outcome, SessionError> {
        let mut out = Vec::new();
        let mut procedure = begin(self.now(), &mut out);
        self.queue.extend(out);
        self.resume(&mut procedure)
    }

    /// Runs a started procedure to its next outcome.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn resume<P: Procedure>(&mut self, procedure: &mut P) -> Result<P::Outcome, SessionError> {
        let mut out = Vec::new();
        loop {
            self.transmit()?;
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

    /// Sends frames without waiting for responses.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn send(&mut self, frames: impl IntoIterator<Item = Frame>) -> Result<(), SessionError> {
        self.queue(frames);
        self.flush()
    }

    /// Queues the first frames of a procedure; [`resume`](Self::resume) sends them.
    pub fn queue(&mut self, frames: impl IntoIterator<Item = Frame>) {
        self.queue.extend(frames);
    }

    /// Returns the next frame received before `due`, if any.
    fn next(&mut self, due: Option<Instant>) -> Result<Option<Frame>, SessionError> {
        let now = self.now();
        let look = now + if self.queue.is_empty() { STOP_POLL } else { RETRY_INTERVAL };
        let Some(received) = self.bus.receive(due.map_or(look, |due| due.min(look))) else {
            return Ok(None);
        };
        self.latest = self.latest.max(received.at);
        match received.event {
            BusEvent::Frame(frame) if received.channel == self.channel => Ok(Some(frame)),
            BusEvent::Frame(_) => Ok(None),
            BusEvent::Error(BusError::Down) => Err(SessionError::Down),
            BusEvent::Error(BusError::Off) => Err(SessionError::BusOff),
            BusEvent::Error(
                error @ (BusError::Warning | BusError::Overrun | BusError::Passive),
            ) => {
                tracing::warn!("{}", description(error));
                Ok(None)
            }
        }
    }

    /// Hands queued frames to the driver, as far as it accepts them.
    fn transmit(&mut self) -> Result<(), SessionError> {
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
                    let is_stuck = now.since(since) >= TRANSMIT_TIMEOUT;
                    return if is_stuck { Err(SessionError::Stuck) } else { Ok(()) };
                }
            }
        }
        Ok(())
    }

    /// Hands all queued frames to the driver, so that an abort is sent before the program ends.
    fn flush(&mut self) -> Result<(), SessionError> {
        self.transmit()?;
        while !self.queue.is_empty() {
            self.next(None)?;
            self.transmit()?;
        }
        Ok(())
    }
}

/// Describes a bus error.
const fn description(error: BusError) -> &'static str {
    match error {
        BusError::Warning => "many errors on the bus",
        BusError::Overrun => "frames were lost before they were read",
        BusError::Passive => "error-passive: no node acknowledges, or the bit rate differs",
        BusError::Off => "bus-off",
        BusError::Down => "the interface is down",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::{ReceivedEvent, Wake};
    use canopen::NodeId;
    use canopen::object::Object;
    use canopen::sdo::{SdoError, Transfer};

    /// Bus without other nodes.
    #[derive(Default)]
    struct EmptyBus {
        now: Instant,
        room: usize,
        sent: Vec<Frame>,
        error: Option<BusError>,
    }

    impl Bus for EmptyBus {
        fn now(&self) -> Instant {
            self.now
        }

        fn wall(&self) -> Duration {
            Duration::ZERO
        }

        fn send_at(&mut self, _: Instant, telegram: Telegram) -> Result<(), SendError> {
            if self.room == 0 {
                return Err(SendError::Full);
            }
            self.room -= 1;
            self.sent.push(telegram.frame);
            Ok(())
        }

        fn wait(&mut self, _: Instant, _: Instant, until: Instant) -> Wake {
            let now = self.now.max(until);
            self.now = now;
            let received = |error| ReceivedEvent {
                at: now,
                channel: Channel(0),
                event: BusEvent::Error(error),
            };
            Wake { now, received: self.error.take().map(received) }
        }
    }

    const TIMEOUT: Duration = Duration::from_millis(100);

    fn session(bus: EmptyBus) -> Session<EmptyBus> {
        Session::new(bus, Channel(0), Arc::default())
    }

    fn read(now: Instant, out: &mut Vec<Frame>) -> Transfer {
        Transfer::read(NodeId::new(5).unwrap(), Object::DEVICE_TYPE, TIMEOUT, now, out)
    }

    #[test]
    fn timeout_ends_the_session_after_the_abort_is_sent() {
        let mut session = session(EmptyBus { room: 9, ..EmptyBus::default() });
        assert_eq!(session.run(read), Ok(Err(SdoError::Timeout)));
        assert_eq!(session.bus.sent.len(), 2, "the request and its abort");
        assert_eq!(session.now(), Instant::ZERO + TIMEOUT);
    }

    #[test]
    fn interrupted_session_sends_the_abort_first() {
        let mut session = session(EmptyBus { room: 9, ..EmptyBus::default() });
        session.stop.store(true, Ordering::Relaxed);
        assert_eq!(session.run(read), Err(SessionError::Interrupted));
        assert_eq!(session.bus.sent.len(), 2, "the request and its abort");
    }

    #[test]
    fn full_transmit_queue_ends_the_session_as_stuck() {
        let mut session = session(EmptyBus::default());
        assert_eq!(session.send([Frame::new(0x80, [])]), Err(SessionError::Stuck));
        assert!(session.now() >= Instant::ZERO + TRANSMIT_TIMEOUT);
    }

    #[test]
    fn bus_errors_end_the_session_but_warnings_do_not() {
        for (error, outcome) in [
            (BusError::Down, Err(SessionError::Down)),
            (BusError::Off, Err(SessionError::BusOff)),
            (BusError::Passive, Ok(Err(SdoError::Timeout))),
        ] {
            let bus = EmptyBus { room: 9, error: Some(error), ..EmptyBus::default() };
            assert_eq!(session(bus).run(read), outcome);
        }
    }
}
