//! A station on a bus it does not own: simulated drives on SocketCAN, for any master.

use std::time::Duration;

use crate::outbox::Down;
use crate::outbox::Outbox;
use bus::Bus;
use bus::BusEvent;
use bus::BusFault;
use canopen::frame::Telegram;
use canopen::station::Station;
use units::time::Instant;

/// Whoever may want to end it is asked this often.
const ASK_EVERY: Duration = Duration::from_millis(50);

/// A bus that is full has room again after so long: a few frames at 1 Mbit/s, one at 125 kbit/s.
const RETRY_AFTER: Duration = Duration::from_millis(1);

/// Lets `station` live on `bus` until `is_over` says so, which is asked at every turn. What a bus has no
/// room for is kept, up to a bound, and sent later.
///
/// # Errors
/// A bus whose interface went down, or was down from the start.
pub fn attend<B: Bus, S: Station>(
    bus: &mut B,
    station: &mut S,
    is_over: &mut dyn FnMut(&mut S) -> bool,
) -> Result<(), Down> {
    let mut said: Vec<Telegram> = Vec::with_capacity(64);
    let mut outbox = Outbox::new();
    let mut latest = Instant::ZERO;
    while !is_over(station) {
        let now = bus.now().max(latest);
        if station.deadline().is_some_and(|due| due <= now) {
            latest = now;
            station.on_time(now, &mut said);
        }
        outbox.send(bus, &mut said)?;
        let ask = now + if outbox.is_empty() { ASK_EVERY } else { RETRY_AFTER };
        let until = station.deadline().map_or(ask, |due| due.min(ask));
        let Some(received) = bus.receive(until) else { continue };
        // A stamp may be older than what was already done.
        latest = latest.max(received.at);
        match received.event {
            BusEvent::Frame(frame) => station.on_frame(latest, received.channel, &frame, &mut said),
            BusEvent::Fault(BusFault::Down) => return Err(Down(received.channel)),
            BusEvent::Fault(BusFault::Off) => tracing::warn!(bus = received.channel.0, "bus-off"),
            BusEvent::Fault(fault) => tracing::debug!(?fault, "bus"),
        }
    }
    Ok(())
}
