//! Bus that replays the recorded answers, and keeps sent frames.

use std::cell::Cell;
use std::time::Duration;

use crate::source::{Source, answer};
use bus::{Bus, ReopenError, SendError, Wake};
use canopen::frame::{Channel, Telegram};
use canopen::master::event::Event;
use inputs::{Checksum, Input};
use units::time::Instant;

/// Buses of a recorded session.
#[derive(Debug)]
pub(super) struct ReplayedBus {
    source: Source,
    /// Last reading of the clock. After the end of the recording, waits advance it.
    now: Cell<Instant>,
    /// Frames sent in this call, and the clock then.
    sent: Vec<(Instant, Telegram)>,
    checksum: Checksum,
}

impl ReplayedBus {
    pub(super) fn new(source: Source) -> Self {
        let now = Cell::new(Instant::ZERO);
        Self { source, now, sent: Vec::new(), checksum: Checksum::default() }
    }

    /// Takes the frames that were sent since the last call, and their checksum.
    pub(super) fn take_sent(&mut self) -> (Vec<(Instant, Telegram)>, Checksum) {
        (std::mem::take(&mut self.sent), std::mem::take(&mut self.checksum))
    }
}

impl Bus for ReplayedBus {
    fn now(&self) -> Instant {
        let now = self.source.take("reads the clock", answer!(Input::Now(now) => *now));
        self.now.set(now.unwrap_or(self.now.get()));
        self.now.get()
    }

    fn wall(&self) -> Duration {
        let wall = self.source.take("reads the wall clock", answer!(Input::Wall(wall) => *wall));
        wall.unwrap_or_default()
    }

    fn suspended(&self) -> Duration {
        let total = self
            .source
            .take("asks for the time of suspension", answer!(Input::Suspended(total) => *total));
        total.unwrap_or_default()
    }

    fn transmit_confirmed_at(&mut self, channel: Channel) -> Option<Instant> {
        let at = self.source.take(
            "asks for a transmit confirmation",
            answer!(Input::Confirmed(of, at) if *of == channel => *at),
        );
        at.flatten()
    }

    fn send_at(&mut self, now: Instant, telegram: Telegram) -> Result<(), SendError> {
        self.sent.push((now, telegram));
        self.checksum.add(&telegram);
        let number = self.checksum.frames();
        let refused = answer!(Input::NotSent(of, error) if *of == number => *error);
        self.source.take_if_next(refused).map_or(Ok(()), Err)
    }

    fn wait(&mut self, _: Instant, _: Instant, until: Instant) -> Wake {
        let wake = self.source.take("waits for a frame", answer!(Input::Woken(wake) => *wake));
        // Without an answer time passes, so that the call comes to its end.
        let wake = wake.unwrap_or(Wake { now: until.max(self.now.get()), received: None });
        self.now.set(wake.now);
        wake
    }

    fn reopen(&mut self) -> Result<(), ReopenError> {
        let outcome = self
            .source
            .take("opens its buses again", answer!(Input::Reopened(outcome) => outcome.clone()));
        outcome.unwrap_or(Ok(()))
    }

    /// Takes every event: there is no log.
    fn report(&mut self, _: Instant, _: Event) -> Option<Event> {
        None
    }
}
