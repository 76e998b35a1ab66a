//! CAN buses: frames, time and waiting. Nothing else in a cycle reads a clock or blocks.
#![forbid(unsafe_code)]

mod arrival;
pub mod clock;
mod confirmation;
pub mod interface;
pub mod log_writer;
mod netlink;
mod raw_frame;
pub mod realtime;
mod socket;
mod socketcan;
mod trace;

pub use socket::OpenError;
pub use socketcan::SocketCan;
pub use trace::TappedBus;

use std::time::Duration;

use thiserror::Error;

use canopen::frame::{Channel, Frame, Telegram};
use canopen::master::event::Event;
use units::time::Instant;

/// One or more CAN buses with a common clock.
pub trait Bus {
    /// Reads the clock, which continues while the host is suspended.
    fn now(&self) -> Instant;

    /// Returns the wall clock: UTC since 1970. It may step at any time.
    fn wall(&self) -> Duration;

    /// Returns the total time in which the host was suspended; only differences are meaningful.
    fn suspended(&self) -> Duration {
        Duration::ZERO
    }

    /// Returns the time of the last SYNC confirmed on the wire, zero before the first. It confirms that sent frames reach
    /// the bus. `None` if the bus cannot confirm. Does not wait.
    fn transmit_confirmed_at(&mut self, _channel: Channel) -> Option<Instant> {
        None
    }

    /// Passes a frame to its bus, which transmits it within a cycle or drops it. `now` is the caller's last reading of the
    /// clock, and the time of the frame in logs.
    ///
    /// # Errors
    /// When the frame was not accepted. It will not be sent later.
    fn send_at(&mut self, now: Instant, telegram: Telegram) -> Result<(), SendError>;

    /// Waits for the next frame or bus event, until `until` at the latest. `now` is the caller's last reading of the
    /// clock; time that has passed since then delays the end of the wait.
    ///
    /// What is received before `from` waits until then: who knows when its frames come is woken once for all of them. It
    /// is then returned in the order of reception over all buses, a frame or event each call.
    fn wait(&mut self, now: Instant, from: Instant, until: Instant) -> Wake;

    /// [Sends](Self::send_at) a frame now.
    ///
    /// # Errors
    /// As [`send_at`](Self::send_at).
    fn send(&mut self, telegram: Telegram) -> Result<(), SendError> {
        self.send_at(self.now(), telegram)
    }

    /// [Waits](Self::wait) for the next frame or bus event, until `until` at the latest.
    fn receive(&mut self, until: Instant) -> Option<ReceivedEvent> {
        let now = self.now();
        self.wait(now, now, until).received
    }

    /// Reopens every bus. Discards frames not yet read, finds an interface that was plugged in again, and sends nothing.
    ///
    /// # Errors
    /// Returns the first bus that is missing, or not fit for torques.
    fn reopen(&mut self) -> Result<(), ReopenError> {
        Ok(())
    }

    /// Passes an event on the network to the observer of the bus. Returns it unless the observer takes events.
    fn report(&mut self, _at: Instant, event: Event) -> Option<Event> {
        Some(event)
    }
}

/// Reasons why a bus cannot be opened again.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ReopenError {
    /// Missing interface.
    #[error("bus {}: interface not found", .0.0)]
    Gone(Channel),
    /// Interface that is not [fit](interface::check) for torques: reason and remedy.
    #[error("{0}")]
    Unfit(String),
}

/// End of a wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wake {
    /// Time of the end: the clock was read once.
    pub now: Instant,
    /// Frame or event; `None` if there was none in time.
    pub received: Option<ReceivedEvent>,
}

/// Frame or error received from a bus, with time and channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReceivedEvent {
    /// Time at which the frame or fault was complete on the wire.
    pub at: Instant,
    /// Bus on which the frame or fault was received.
    pub channel: Channel,
    /// Frame or error.
    pub event: BusEvent,
}

/// Frame, or change of the bus state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusEvent {
    /// Data frame with an 11-bit identifier; a remote frame only if requested.
    Frame(Frame),
    /// Worst fault that an error frame or the interface reports.
    Error(BusError),
}

/// Error reported by a CAN controller or its driver, mildest first. `Passive` and `Off` are states of fault confinement
/// (ISO 11898-1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum BusError {
    /// Error warning: an error counter is at least 96. Frames still pass.
    Warning,
    /// Received frames were lost before they were read.
    Overrun,
    /// Error passive: an error counter is at least 128, or a transmit timeout.
    Passive,
    /// Bus-off: the controller neither sends nor receives until the bus is reopened.
    Off,
    /// Interface that went down or was unplugged.
    Down,
}

/// Reasons why a frame was not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SendError {
    /// Full transmit queue, whose frames are already stale.
    #[error("transmit queue full")]
    Full,
    /// Interface that is down or gone.
    #[error("interface down")]
    Down,
}

/// Observer of all frames.
pub trait Tap {
    /// Called for each frame on the wire.
    fn on_wire(&mut self, at: Instant, telegram: &Telegram);

    /// Called for each frame sent by this node, if the bus can distinguish it (as `candump -x`).
    fn on_sent(&mut self, at: Instant, telegram: &Telegram) {
        self.on_wire(at, telegram);
    }

    /// Called for each frame accepted for sending; it may reach the wire later, or never.
    fn on_taken(&mut self, _at: Instant, _telegram: &Telegram) {}

    /// Called for each event that the node has detected on the network. Returns it unless it takes events.
    fn on_event(&mut self, _at: Instant, event: Event) -> Option<Event> {
        Some(event)
    }
}

/// Observer that ignores all frames.
impl Tap for () {
    fn on_wire(&mut self, _at: Instant, _telegram: &Telegram) {}
}

/// Observer that calls a closure.
impl<F: FnMut(Instant, &Telegram)> Tap for F {
    fn on_wire(&mut self, at: Instant, telegram: &Telegram) {
        self(at, telegram);
    }
}
