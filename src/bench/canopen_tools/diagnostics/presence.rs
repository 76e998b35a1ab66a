//! Detection of a running master by its SYNC.
//!
//! Sends nothing. A master with a longer period, or without SYNC, is not detected.

use std::time::Duration;

use crate::diagnostics::beats::Beats;
use crate::procedure::Procedure;
use canopen::frame::Frame;
use canopen::sync;
use units::time::Instant;

/// Listening time: ten periods at 100 Hz, the slowest rate of a moving arm.
pub const WINDOW: Duration = Duration::from_millis(100);

/// Detection in progress.
#[derive(Clone, Debug)]
pub struct Presence {
    until: Instant,
    beats: Beats,
}

impl Presence {
    /// Starts to listen for a [`WINDOW`].
    pub fn start(now: Instant) -> Self {
        Self { until: now + WINDOW, beats: Beats::default() }
    }

    /// Returns the heartbeats received meanwhile.
    pub fn into_beats(self) -> Beats {
        self.beats
    }
}

impl Procedure for Presence {
    /// Set if a SYNC was received.
    type Outcome = bool;

    fn on_frame(&mut self, now: Instant, frame: &Frame, _: &mut Vec<Frame>) -> Option<bool> {
        self.beats.on_frame(now, frame);
        let is_sync = frame.cob_id == sync::COB_ID && !frame.is_remote();
        is_sync.then_some(true)
    }

    fn on_time(&mut self, now: Instant, _: &mut Vec<Frame>) -> Option<bool> {
        (now >= self.until).then_some(false)
    }

    fn deadline(&self) -> Option<Instant> {
        Some(self.until)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sync_within_the_window_is_a_master() {
        let mut out = Vec::new();
        let mut presence = Presence::start(Instant::ZERO);
        let now = Instant::ZERO + WINDOW / 2;
        for other in [Frame::new(0x000, [1, 3]), Frame::new(0x703, [5]), Frame::remote(0x080, 0)] {
            assert_eq!(presence.on_frame(now, &other, &mut out), None, "{other}");
        }
        assert_eq!(presence.on_time(now, &mut out), None);
        assert_eq!(presence.on_frame(now, &Frame::new(0x080, [7]), &mut out), Some(true));
        assert_eq!(presence.on_time(Instant::ZERO + WINDOW, &mut out), Some(false));
        assert_eq!(out, [], "it only listens");
    }
}
