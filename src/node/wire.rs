//! The buses as the node uses them: what is received, what waits to be sent, and what may still be sent.

use std::time::Duration;

use crate::cause::Cause;
use crate::safety::causes;
use crate::transmission::Transmission;
use bus::Bus;
use bus::BusFault;
use bus::Received;
use bus::ReopenError;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::frame::Telegram;
use config::Config;
use units::time::Instant;

/// Capacity of the queue of frames to send, reserved so that the cycle does not allocate.
const FRAMES: usize = 64;

/// The buses, and what may be sent on each.
#[derive(Clone, Debug)]
pub(super) struct Wire<B> {
    pub(super) bus: B,
    channels: Vec<Channel>,
    pub(super) transmission: Transmission,
    /// Frames to send, in this order.
    pub(super) out: Vec<Telegram>,
}

/// Why a frame was not sent.
#[derive(Clone, Copy, Debug)]
pub(super) enum NotSent {
    /// Its bus was closed before.
    Closed,
    /// Its bus did not take it at this time.
    Refused(Instant, Option<Cause>),
}

impl<B: Bus> Wire<B> {
    /// The buses of the configuration; nothing was sent yet.
    pub(super) fn new(config: &Config, bus: B) -> Self {
        let channels = config.channels();
        let transmission = Transmission::on(&channels);
        Self { bus, channels, transmission, out: Vec::with_capacity(FRAMES) }
    }

    /// Time now, on the clock of the bus.
    pub(super) fn now(&self) -> Instant {
        self.bus.now()
    }

    /// Time for which the host has been suspended so far.
    pub(super) fn suspended(&self) -> Duration {
        self.bus.suspended()
    }

    /// Waits until `until` for a frame or a fault.
    pub(super) fn receive(&mut self, until: Instant) -> Option<Received> {
        self.bus.receive(until)
    }

    /// Queues a frame for every bus.
    pub(super) fn queue_on_every_bus(&mut self, frame: Frame) {
        self.out.extend(self.channels.iter().map(|&channel| Telegram { channel, frame }));
    }

    /// Sends a frame now or never.
    ///
    /// # Errors
    /// When its bus is closed or does not take it.
    pub(super) fn send(&mut self, telegram: Telegram) -> Result<(), NotSent> {
        if !self.transmission.may(telegram.channel) {
            return Err(NotSent::Closed);
        }
        let at = self.bus.now();
        let outcome = self.bus.send(telegram);
        let cause = self.transmission.offered(at, &telegram, outcome);
        outcome.map_err(|_| NotSent::Refused(at, cause))
    }

    /// Starts a cycle of transmission; returns a cause if SYNCs taken by a bus do not appear on its wire.
    pub(super) fn watch_sync_echo(&mut self) -> Option<Cause> {
        let bus = &self.bus;
        self.transmission.begin(|channel| bus.transmit_confirmed_at(channel))
    }

    /// Takes a fault of a bus; returns its cause to stop, if it is one.
    pub(super) fn on_fault(&mut self, channel: Channel, fault: BusFault) -> Option<Cause> {
        self.transmission.on_fault(channel, fault);
        causes::of_bus(channel, fault)
    }

    /// Opens the buses again if nothing may be sent on one of them.
    ///
    /// # Errors
    /// When an interface is gone, or not fit for torques.
    pub(super) fn reopen(&mut self) -> Result<(), ReopenError> {
        if self.transmission.is_shut() {
            self.bus.reopen()?;
        }
        self.transmission.reopen();
        Ok(())
    }
}
