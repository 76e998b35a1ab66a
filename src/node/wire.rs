//! Buses of the node: reception, the queue of frames to send, and the permission to send.

use std::time::Duration;

use crate::cause::Cause;
use crate::lateness::MIN_SUSPENSION;
use crate::safety::causes;
use crate::transmission::Transmission;
use bus::{Bus, BusError, ReceivedEvent, ReopenError};
use canopen::frame::{Channel, Frame, Telegram};
use config::Config;
use units::time::Instant;

/// Capacity of the queue of frames to send, reserved so that the cycle does not allocate.
const QUEUE_CAPACITY: usize = 64;

/// Buses, with the permission to send on each.
#[derive(Clone, Debug)]
pub(super) struct Wire<B> {
    pub(super) bus: B,
    /// Last reading of the clock.
    now: Instant,
    /// Time of host suspension so far, and when it was read.
    suspended: (Duration, Instant),
    channels: Vec<Channel>,
    pub(super) transmission: Transmission,
    /// Frames to send, in order.
    pub(super) out: Vec<Telegram>,
}

/// Reason why a frame was not sent.
#[derive(Clone, Copy, Debug)]
pub(super) enum SendRefusal {
    /// Sending on its bus is not permitted.
    Closed,
    /// Its bus did not accept it at this time.
    NotAccepted(Instant, Option<Cause>),
}

impl<B: Bus> Wire<B> {
    /// Returns the buses of the configuration. Sends no frame.
    pub(super) fn new(config: &Config, bus: B) -> Self {
        let channels = config.channels();
        let transmission = Transmission::on(&channels);
        let now = bus.now();
        let suspended = (bus.suspended(), now);
        Self {
            bus,
            now,
            suspended,
            channels,
            transmission,
            out: Vec::with_capacity(QUEUE_CAPACITY),
        }
    }

    /// Returns the last reading of the bus's clock: the end of the last wait, unless it was [read](Self::read_clock)
    /// since.
    pub(super) const fn now(&self) -> Instant {
        self.now
    }

    /// Reads the bus's clock.
    pub(super) fn read_clock(&mut self) -> Instant {
        self.now = self.bus.now();
        self.now
    }

    /// Returns the time of host suspension so far. The clock goes on in a suspension, so no other clock is read where
    /// too little time has passed for one.
    pub(super) fn suspended(&mut self) -> Duration {
        let (_, read_at) = self.suspended;
        if self.now.since(read_at) > MIN_SUSPENSION {
            self.suspended = (self.bus.suspended(), self.now);
        }
        self.suspended.0
    }

    /// Waits until `until` for a frame or an error of a bus.
    pub(super) fn receive(&mut self, until: Instant) -> Option<ReceivedEvent> {
        self.receive_from(self.now, until)
    }

    /// Waits as [`receive`](Self::receive), and sleeps until `from` whatever comes.
    pub(super) fn receive_from(&mut self, from: Instant, until: Instant) -> Option<ReceivedEvent> {
        let wake = self.bus.wait(self.now, from, until);
        self.now = wake.now;
        wake.received
    }

    /// Returns the buses, in their order.
    pub(super) fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Queues a frame for every bus.
    pub(super) fn queue_on_every_bus(&mut self, frame: Frame) {
        self.out.extend(self.channels.iter().map(|&channel| Telegram { channel, frame }));
    }

    /// Sends a frame at once or drops it.
    ///
    /// # Errors
    /// When sending on its bus is not permitted, or the bus does not accept it.
    pub(super) fn send(&mut self, telegram: Telegram) -> Result<(), SendRefusal> {
        if !self.transmission.is_open(telegram.channel) {
            return Err(SendRefusal::Closed);
        }
        let at = self.now;
        let outcome = self.bus.send_at(at, telegram);
        let cause = self.transmission.on_send(at, &telegram, outcome);
        outcome.map_err(|_| SendRefusal::NotAccepted(at, cause))
    }

    /// Returns whether an open bus was left without the SYNC sent at `sync_at` on others.
    pub(super) fn lacks_sync(&self, channel: Channel, sync_at: Instant) -> bool {
        self.transmission.lacks_sync(channel, sync_at)
    }

    /// Starts a cycle of transmission; returns a cause if accepted SYNCs are not confirmed as transmitted.
    pub(super) fn watch_transmit_confirmation(&mut self) -> Option<Cause> {
        self.read_transmit_confirmation();
        self.transmission.start_cycle()
    }

    /// Reads the transmit confirmation of the last SYNC on each bus, if it is still to come.
    pub(super) fn read_transmit_confirmation(&mut self) {
        let bus = &mut self.bus;
        self.transmission.confirm(|channel| bus.transmit_confirmed_at(channel));
    }

    /// Updates the permission to send after a bus error; returns its cause, if it has one.
    pub(super) fn on_bus_error(&mut self, channel: Channel, error: BusError) -> Option<Cause> {
        self.transmission.on_bus_error(channel, error);
        causes::of_bus(channel, error)
    }

    /// Reopens all buses if one is shut, and permits sending on them.
    ///
    /// # Errors
    /// When an interface is missing, or not fit for torques.
    pub(super) fn reopen(&mut self) -> Result<(), ReopenError> {
        if self.transmission.is_shut() {
            self.bus.reopen()?;
        }
        self.transmission.reopen();
        Ok(())
    }
}
