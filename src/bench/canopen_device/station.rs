//! Contract of a device on a bus: frames and time in, frames out. No I/O and no clock; the same inputs give
//! the same outputs.

use canopen::frame::{Channel, Frame, Telegram};
use units::time::Instant;

/// One or more devices on one or more buses.
pub trait Station {
    /// Takes one frame received on `channel`; frames to send are appended to `out`.
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>);

    /// Performs the actions due at `now`.
    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>);

    /// Time of the next call of [`on_time`](Self::on_time).
    fn deadline(&self) -> Option<Instant>;
}

/// Returns the earlier of two deadlines.
pub fn earlier(one: Option<Instant>, other: Option<Instant>) -> Option<Instant> {
    match (one, other) {
        (Some(one), Some(other)) => Some(one.min(other)),
        (one, other) => one.or(other),
    }
}
