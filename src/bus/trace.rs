//! A bus with an observer.

use std::time::Duration;

use crate::{Bus, BusEvent, Received, ReopenError, SendError, Tap};
use canopen::frame::{Channel, Telegram};
use canopen::master::event::Event;
use units::time::Instant;

/// Bus `B` observed by `T`. Frames that were not accepted are not observed.
#[derive(Debug)]
pub struct Traced<B, T> {
    bus: B,
    tap: T,
}

impl<B, T> Traced<B, T> {
    /// Observes `bus` with `tap`.
    pub const fn new(bus: B, tap: T) -> Self {
        Self { bus, tap }
    }

    /// Returns the observer.
    pub const fn tap_mut(&mut self) -> &mut T {
        &mut self.tap
    }
}

impl<B: Bus, T: Tap> Bus for Traced<B, T> {
    fn now(&self) -> Instant {
        self.bus.now()
    }

    fn wall(&self) -> Duration {
        self.bus.wall()
    }

    fn suspended(&self) -> Duration {
        self.bus.suspended()
    }

    fn transmit_confirmed_at(&self, channel: Channel) -> Option<Instant> {
        self.bus.transmit_confirmed_at(channel)
    }

    fn send(&mut self, telegram: Telegram) -> Result<(), SendError> {
        self.bus.send(telegram)?;
        self.tap.on_wire(self.bus.now(), &telegram);
        Ok(())
    }

    fn receive(&mut self, until: Instant) -> Option<Received> {
        let received = self.bus.receive(until)?;
        if let BusEvent::Frame(frame) = received.event {
            self.tap.on_wire(received.at, &Telegram { channel: received.channel, frame });
        }
        Some(received)
    }

    fn reopen(&mut self) -> Result<(), ReopenError> {
        self.bus.reopen()
    }

    fn report(&mut self, at: Instant, event: Event) -> Option<Event> {
        self.tap.on_event(at, event)
    }
}
