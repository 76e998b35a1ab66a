//! Bus whose answers are recorded.

use std::time::Duration;

use crate::checksum::Checksum;
use crate::input::{Input, InputSink};
use bus::{Bus, ReopenError, SendError, Wake};
use canopen::frame::{Channel, Telegram};
use canopen::master::event::Event;
use units::time::Instant;

/// Bus `B`; its answers go to `S`.
#[derive(Clone, Debug)]
pub struct RecordedBus<B, S> {
    pub(super) bus: B,
    sink: S,
    /// Frames passed to the bus since the last [`take_sent`](Self::take_sent).
    sent: Checksum,
}

impl<B, S> RecordedBus<B, S> {
    pub(super) fn new(bus: B, sink: S) -> Self {
        Self { bus, sink, sent: Checksum::default() }
    }

    /// Takes the checksum of the frames passed to the bus since the last call, accepted or not.
    pub(super) fn take_sent(&mut self) -> Checksum {
        std::mem::take(&mut self.sent)
    }
}

impl<B: Bus, S: InputSink> Bus for RecordedBus<B, S> {
    fn now(&self) -> Instant {
        self.sink.record(self.bus.now(), Input::Now)
    }

    fn wall(&self) -> Duration {
        self.sink.record(self.bus.wall(), Input::Wall)
    }

    fn suspended(&self) -> Duration {
        self.sink.record(self.bus.suspended(), Input::Suspended)
    }

    fn transmit_confirmed_at(&mut self, channel: Channel) -> Option<Instant> {
        let at = self.bus.transmit_confirmed_at(channel);
        self.sink.record(at, |at| Input::Confirmed(channel, at))
    }

    fn send_at(&mut self, now: Instant, telegram: Telegram) -> Result<(), SendError> {
        let outcome = self.bus.send_at(now, telegram);
        if self.sink.is_recording() {
            self.sent.add(&telegram);
            if let Err(error) = outcome {
                self.sink.on_input(Input::NotSent(self.sent.frames(), error));
            }
        }
        outcome
    }

    fn wait(&mut self, now: Instant, from: Instant, until: Instant) -> Wake {
        self.sink.record(self.bus.wait(now, from, until), Input::Woken)
    }

    fn reopen(&mut self) -> Result<(), ReopenError> {
        self.sink.record(self.bus.reopen(), Input::Reopened)
    }

    /// Passes an event to the observer of the bus. Its answer does not affect the frames that the node sends.
    fn report(&mut self, at: Instant, event: Event) -> Option<Event> {
        self.bus.report(at, event)
    }
}
