//! Machine that ends with an outcome: one SDO transfer, one scan, one LSS job.
//!
//! A procedure uses one bus and performs no I/O. The owner of the bus calls its methods until it returns an outcome; frames
//! to send are appended to `out`.

use std::time::Duration;

use canopen::frame::Frame;
use canopen::sdo::{self, Transfer};
use units::time::Instant;

/// Machine with an outcome.
pub trait Procedure {
    /// Result of the procedure.
    type Outcome;

    /// Takes one received frame.
    fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Self::Outcome>;

    /// Performs the actions due at `now`.
    fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Self::Outcome>;

    /// Time of the next call of [`on_time`](Self::on_time); `None` if only a frame can continue the procedure.
    fn deadline(&self) -> Option<Instant>;

    /// Stops the procedure and leaves the bus in a defined state.
    fn abandon(&mut self, _now: Instant, _out: &mut Vec<Frame>) {}
}

impl Procedure for Transfer {
    type Outcome = sdo::Outcome;

    fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Self::Outcome> {
        self.on_frame(now, frame, out)
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Self::Outcome> {
        self.on_time(now, out)
    }

    fn deadline(&self) -> Option<Instant> {
        self.deadline()
    }

    /// Aborts the transfer at the server.
    fn abandon(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.on_time(now + Duration::MAX, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::NodeId;
    use canopen::object::Object;

    #[test]
    fn abandoned_transfer_is_aborted() {
        let (node, mut out) = (NodeId::new(5).unwrap(), Vec::new());
        let timeout = Duration::from_millis(100);
        let now = Instant::from_micros(7);
        let mut transfer = Transfer::read(node, Object::DEVICE_TYPE, timeout, now, &mut out);
        transfer.abandon(now, &mut out);
        assert_eq!(out.last(), Some(&Frame::new(0x605, [0x80, 0, 0x10, 0, 0, 0, 4, 5])));
        assert_eq!(Procedure::deadline(&transfer), None);
    }
}
