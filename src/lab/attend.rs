//! A station on a bus it does not own: simulated drives on SocketCAN, for any master.

use std::time::Duration;

use crate::bus::Bus;
use crate::bus::Heard;
use crate::canopen::frame::Telegram;
use crate::canopen::station::Station;
use crate::time::Instant;

/// Whoever may want to end it is asked this often.
const ASK_EVERY: Duration = Duration::from_millis(50);

/// Lets `station` live on `bus` until `is_over` says so, asked at every turn. A frame that cannot be
/// sent is lost, as on a real bus.
pub fn attend<B: Bus, S: Station>(
    bus: &mut B,
    station: &mut S,
    is_over: &mut dyn FnMut(&mut S) -> bool,
) {
    let mut out: Vec<Telegram> = Vec::with_capacity(64);
    let mut latest = Instant::ZERO;
    while !is_over(station) {
        let now = bus.now().max(latest);
        if station.deadline().is_some_and(|due| due <= now) {
            latest = now;
            station.on_time(now, &mut out);
        }
        for telegram in out.drain(..) {
            if bus.send(telegram).is_err() {
                tracing::debug!(frame = %telegram.frame, "not sent");
            }
        }
        let ask = now + ASK_EVERY;
        let until = station.deadline().map_or(ask, |due| due.min(ask));
        let Some(received) = bus.receive(until) else { continue };
        // A stamp may be older than what was already done.
        latest = latest.max(received.at);
        if let Heard::Frame(frame) = received.heard {
            station.on_frame(latest, received.channel, &frame, &mut out);
        }
    }
}
