//! Bus with an observer of its frames.

use std::time::Duration;

use crate::{Bus, BusEvent, ReceivedEvent, ReopenError, SendError, Tap, Wake};
use canopen::frame::{Channel, Telegram};
use canopen::master::event::Event;
use units::time::Instant;

/// Bus `B` observed by `T`. Frames that were not accepted are not observed.
#[derive(Debug)]
pub struct TappedBus<B, T> {
    bus: B,
    tap: T,
}

impl<B, T> TappedBus<B, T> {
    /// Observes `bus` with `tap`.
    pub const fn new(bus: B, tap: T) -> Self {
        Self { bus, tap }
    }

    /// Returns the observer.
    pub const fn tap_mut(&mut self) -> &mut T {
        &mut self.tap
    }
}

impl<B: Bus, T: Tap> Bus for TappedBus<B, T> {
    fn now(&self) -> Instant {
        self.bus.now()
    }

    fn wall(&self) -> Duration {
        self.bus.wall()
    }

    fn suspended(&self) -> Duration {
        self.bus.suspended()
    }

    fn transmit_confirmed_at(&mut self, channel: Channel) -> Option<Instant> {
        self.bus.transmit_confirmed_at(channel)
    }

    fn send_at(&mut self, now: Instant, telegram: Telegram) -> Result<(), SendError> {
        self.bus.send_at(now, telegram)?;
        self.tap.on_wire(now, &telegram);
        Ok(())
    }

    fn wait(&mut self, now: Instant, from: Instant, until: Instant) -> Wake {
        let wake = self.bus.wait(now, from, until);
        if let Some(ReceivedEvent { at, channel, event: BusEvent::Frame(frame) }) = wake.received {
            self.tap.on_wire(at, &Telegram { channel, frame });
        }
        wake
    }

    fn reopen(&mut self) -> Result<(), ReopenError> {
        self.bus.reopen()
    }

    fn report(&mut self, at: Instant, event: Event) -> Option<Event> {
        self.tap.on_event(at, event)
    }
}
