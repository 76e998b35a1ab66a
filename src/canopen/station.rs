//! The contract of everything that lives on a bus without being the bus: frames and time go in,
//! frames come out. No I/O, no clock, the same inputs give the same outputs.

use crate::frame::Channel;
use crate::frame::Frame;
use crate::frame::Telegram;
use units::time::Instant;

/// One or more devices on one or more buses.
pub trait Station {
    /// Takes one frame received on `channel`; frames to send are appended to `out`.
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>);

    /// Does what is due at `now`.
    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>);

    /// When [`on_time`](Self::on_time) must next be called.
    fn deadline(&self) -> Option<Instant>;
}
