//! Station on a real bus: simulated drives on SocketCAN, for any master.

use std::time::Duration;

use crate::transmit_queue::{Down, TransmitQueue};
use bus::{Bus, BusError, BusEvent};
use canopen::frame::Telegram;
use canopen_device::station::Station;
use units::time::Instant;

/// Time between two calls of `is_over`.
const POLL_PERIOD: Duration = Duration::from_millis(50);

/// Interval of retries while a bus is full: a few frames at 1 Mbit/s, one at 125 kbit/s.
const RETRY_AFTER: Duration = Duration::from_millis(1);

/// Runs `station` on `bus` until `is_over` returns true. Frames that a full bus refuses are sent later, up to a bound.
///
/// # Errors
/// Returns an error if the interface of a bus is down.
pub fn run<B: Bus, S: Station>(
    bus: &mut B,
    station: &mut S,
    is_over: &mut dyn FnMut(&mut S) -> bool,
) -> Result<(), Down> {
    let mut frames: Vec<Telegram> = Vec::with_capacity(64);
    let mut queue = TransmitQueue::new();
    let mut latest = Instant::ZERO;
    while !is_over(station) {
        let now = bus.now().max(latest);
        if station.deadline().is_some_and(|due| due <= now) {
            latest = now;
            station.on_time(now, &mut frames);
        }
        queue.send(bus, &mut frames)?;
        let ask = now + if queue.is_empty() { POLL_PERIOD } else { RETRY_AFTER };
        let until = station.deadline().map_or(ask, |due| due.min(ask));
        let Some(received) = bus.receive(until) else { continue };
        // A time stamp may be older than the last step.
        latest = latest.max(received.at);
        match received.event {
            BusEvent::Frame(frame) => {
                station.on_frame(latest, received.channel, &frame, &mut frames);
            }
            BusEvent::Error(BusError::Down) => return Err(Down(received.channel)),
            BusEvent::Error(BusError::Off) => tracing::warn!(bus = received.channel.0, "bus-off"),
            BusEvent::Error(error) => tracing::debug!(fault = ?error, "bus"),
        }
    }
    Ok(())
}
