//! Transmit confirmation of SYNC (ADR 10).
//!
//! A controller in bus-off accepts frames without transmitting them. A second socket per bus therefore receives SYNC only.
//! Drivers with `IFF_ECHO` loop a frame back to other sockets once it was transmitted. With other drivers the kernel loops
//! it back at once, which confirms nothing.

use crate::clock::{Reading, instant};
use crate::socket::{BACKLOG, OpenError, Purpose, Socket, data_frames};
use canopen::listening::Pattern;
use canopen::sync;
use units::time::Instant;

/// Socket that receives SYNC, also those of this node.
#[derive(Debug)]
pub(super) struct ConfirmationSocket {
    socket: Socket,
    /// Time of the last SYNC seen.
    event: Instant,
    /// Time of the last SYNC of this node.
    sent: Instant,
}

impl ConfirmationSocket {
    pub(super) fn open(interface: &str) -> Result<Self, OpenError> {
        let filters = [data_frames(&Pattern::only(sync::COB_ID))];
        let purpose = Purpose { filters: &filters, receives_errors: false, receives_own: false };
        let socket = Socket::open(interface, &purpose)?;
        Ok(Self { socket, event: Instant::ZERO, sent: Instant::ZERO })
    }

    /// Records that a SYNC was accepted for sending.
    pub(super) const fn on_sync(&mut self, at: Instant) {
        self.sent = at;
    }

    /// Reads up to the SYNC of this cycle, and returns the time of the last one. The socket of the bus reports an
    /// interface that is down.
    pub(super) fn read(&mut self, now: Reading, opened: u64) -> Instant {
        for _ in 0..BACKLOG {
            // Emptiness of the socket is checked only if a stamp would otherwise be of an unknown clock.
            if self.event >= self.sent && !self.socket.is_before_a_step(now) {
                break;
            }
            let Ok(Some(taken)) = self.socket.read(now) else { break };
            self.event = instant(taken.arrived, opened);
        }
        self.event
    }
}
