//! Where frames and time enter: the [`Bus`] is the only thing here that waits or knows the time.
//!
//! ```
//! use bus::candump::{Content, Line};
//!
//! let line = Line::parse("(1700000000.123456) can0 181#3706E803").unwrap();
//! assert_eq!((line.interface, line.id), ("can0", 0x181));
//! assert!(matches!(line.content, Content::Data(data) if data.len() == 4));
//! ```
#![forbid(unsafe_code)]

mod arrival;
pub mod candump;
mod clock;
mod disturbance;
pub mod interface;
mod memory;
mod netlink;
mod raw_frame;
pub mod realtime;
pub mod screen;
mod socket;
mod socketcan;
mod trace;
mod wire;

pub use disturbance::Disturbance;
pub use disturbance::HostFault;
pub use memory::Memory;
pub use memory::Watch;
pub use socketcan::OpenError;
pub use socketcan::SocketCan;
pub use trace::Traced;

use std::time::Duration;

use thiserror::Error;

use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::frame::Telegram;
use units::time::Instant;

/// One or more CAN buses under one clock.
pub trait Bus {
    /// The time now.
    fn now(&self) -> Instant;

    /// What the clock on the wall shows, since 1970, UTC; somebody may set it at any moment.
    fn wall(&self) -> Duration;

    /// How long the host has been suspended so far: only differences mean something. Time as
    /// [`now`](Self::now) tells it stood still then, and the buses did not.
    fn suspended(&self) -> Duration {
        Duration::ZERO
    }

    /// When a SYNC was last seen on the wire of a bus, or time zero if none was yet: what proves that
    /// frames which are taken are also sent. `None` where nobody can tell.
    fn transmit_confirmed_at(&self, _channel: Channel) -> Option<Instant> {
        None
    }

    /// Hands a frame to its bus. It is on the wire within a cycle or never: nothing queues behind.
    ///
    /// # Errors
    /// When the frame was not taken. It will not be sent later.
    fn send(&mut self, telegram: Telegram) -> Result<(), SendError>;

    /// Waits for the next frame or change of a bus, until `until` at the latest.
    fn receive(&mut self, until: Instant) -> Option<Received>;

    /// Begins anew with every bus: what waits to be read is lost, what was unplugged and is back is
    /// found again. Nothing is sent.
    ///
    /// # Errors
    /// The first bus that is not there, or not fit for torques any more.
    fn reopen(&mut self) -> Result<(), ReopenError> {
        Ok(())
    }
}

/// A bus that cannot begin anew.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ReopenError {
    /// Its interface is not there.
    #[error("bus {}: no interface", .0.0)]
    Gone(Channel),
    /// Its interface is there and not [fit](interface::check) for torques: why, and the remedy.
    #[error("{0}")]
    Unfit(String),
}

/// What came in, where and when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// When it was complete on the wire.
    pub at: Instant,
    /// On which bus.
    pub channel: Channel,
    /// What it was.
    pub event: BusEvent,
}

/// A frame, or word of the bus's own state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusEvent {
    /// A data frame with an 11-bit identifier; a remote frame only where it was asked for.
    Frame(Frame),
    /// Something is wrong with the bus itself.
    Fault(BusFault),
}

/// What a CAN controller or its driver reports, mildest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum BusFault {
    /// Error counters above 96: the wire is bad, but frames still pass.
    Warning,
    /// Frames were lost before they were read.
    Overrun,
    /// Error counters above 127, or a frame that did not get out.
    Passive,
    /// The controller has left the bus.
    Off,
    /// The interface went down or was unplugged.
    Down,
}

/// Why a frame was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SendError {
    /// The transmit queue is full: what is in it is already stale.
    #[error("transmit queue full")]
    Full,
    /// The interface is down or gone.
    #[error("interface down")]
    Down,
}

/// Somebody who is shown every frame.
pub trait Tap {
    /// A frame has passed by.
    fn on_wire(&mut self, at: Instant, telegram: &Telegram);

    /// One that the node itself sent, where the bus can tell, as `candump -x` does.
    fn on_sent(&mut self, at: Instant, telegram: &Telegram) {
        self.on_wire(at, telegram);
    }

    /// One that the node gave away, and its bus has taken: it may be on the wire later, or never.
    fn on_taken(&mut self, _at: Instant, _telegram: &Telegram) {}
}

/// Nobody.
impl Tap for () {
    fn on_wire(&mut self, _at: Instant, _telegram: &Telegram) {}
}

/// Whoever can be called with it.
impl<F: FnMut(Instant, &Telegram)> Tap for F {
    fn on_wire(&mut self, at: Instant, telegram: &Telegram) {
        self(at, telegram);
    }
}
