//! Load of the buses, from the frames sent and received.

use serde::Serialize;

use canopen::bits;
use canopen::frame::Telegram;
use units::time::Instant;

/// Traffic of one bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(super) struct BusLoad {
    /// Bus load with stuff bits, in percent.
    load_percent: f64,
    /// Rate of frames, in 1/s.
    frames_per_s: f64,
}

/// Meter of the load of each bus, by counting frames and bits.
#[derive(Clone, Debug)]
pub(super) struct BusMeter {
    buses: Vec<BusCounter>,
    since: Option<Instant>,
}

#[derive(Clone, Copy, Debug)]
struct BusCounter {
    bitrate: u32,
    frames: u32,
    bits: u32,
    load: BusLoad,
}

impl BusMeter {
    /// Creates a meter of buses with these bit rates, in bit/s.
    pub(super) fn new(bitrates: impl IntoIterator<Item = u32>) -> Self {
        let counted =
            |bitrate| BusCounter { bitrate, frames: 0, bits: 0, load: BusLoad::default() };
        Self { buses: bitrates.into_iter().map(counted).collect(), since: None }
    }

    /// Forgets all frames.
    pub(super) fn restart(&mut self) {
        self.since = None;
        self.buses.iter_mut().for_each(|bus| (bus.frames, bus.bits) = (0, 0));
    }

    /// Adds a frame.
    pub(super) fn on_frame(&mut self, at: Instant, telegram: &Telegram) {
        self.since.get_or_insert(at);
        if let Some(bus) = self.buses.get_mut(usize::from(telegram.channel.0)) {
            bus.frames = bus.frames.saturating_add(1);
            bus.bits = bus.bits.saturating_add(bits::exact(&telegram.frame));
        }
    }

    /// Computes the loads since the last call.
    pub(super) fn measure(&mut self, now: Instant) {
        let Some(since) = self.since.replace(now) else { return };
        let seconds = now.since(since).as_secs_f64();
        for bus in &mut self.buses {
            let rate = |count: u32| if seconds > 0.0 { f64::from(count) / seconds } else { 0.0 };
            let load_percent = 100.0 * rate(bus.bits) / f64::from(bus.bitrate.max(1));
            bus.load = BusLoad { load_percent, frames_per_s: rate(bus.frames) };
            (bus.frames, bus.bits) = (0, 0);
        }
    }

    /// Returns the newest loads.
    pub(super) fn loads(&self) -> Vec<BusLoad> {
        self.buses.iter().map(|bus| bus.load).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::frame::{Channel, Frame};

    #[test]
    fn load_is_the_bits_over_those_that_fit() {
        let mut meter = BusMeter::new([1_000_000, 125_000]);
        let frame = Frame::new(0x181, [0x55; 8]);
        let bits = bits::exact(&frame);
        let at = |millis: u64| Instant::from_micros(1_000 * millis);
        for millis in 0..500 {
            meter.on_frame(at(millis), &Telegram { channel: Channel(1), frame });
            // A bus outside the configuration.
            meter.on_frame(at(millis), &Telegram { channel: Channel(7), frame });
        }
        meter.measure(at(500));
        let [idle, busy] = meter.loads()[..] else { panic!("two buses") };
        assert_eq!(idle, BusLoad::default());
        assert!((busy.frames_per_s - 1_000.0).abs() < 1e-9, "{busy:?}");
        assert!((busy.load_percent - f64::from(bits) * 0.8).abs() < 1e-9, "{busy:?}");
        meter.measure(at(500));
        assert_eq!(meter.loads()[1], BusLoad::default(), "no time, no load");
    }
}
