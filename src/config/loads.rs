//! Worst-case load of the buses of a configuration, and its limit.

use std::time::Duration;

use crate::buses::BusSettings;
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::raw;
use canopen::bits;
use canopen::exchange::RpdoImage;
use canopen::frame::Channel;
use canopen::load::streams::Stream;
use canopen::load::{self, BusLoad};

impl Parameters {
    /// Returns the worst-case load of each bus.
    pub fn loads(&self) -> Vec<BusLoad> {
        let buses = (0..).map(Channel).zip(&self.buses);
        let load = |(channel, bus): (Channel, &BusSettings)| {
            BusLoad::new(&streams(self, channel), bus.bitrate, self.period_us())
        };
        buses.map(load).collect()
    }
}

/// Refuses every bus whose worst-case load exceeds its limit.
pub(super) fn check(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    // The load is meaningless if the period or a bit rate is invalid.
    if problems.is_noted_within(&raw.bus) || problems.is_noted_within(&raw.node) {
        return;
    }
    for ((bus, load), raw) in config.buses.iter().zip(config.loads()).zip(raw.bus.all()) {
        problems.take(&raw.load_limit_percent, load.within(bus.load_limit_percent));
    }
}

/// Returns the streams of frames planned on one bus.
fn streams(config: &Parameters, channel: Channel) -> Vec<Stream> {
    let plans = config.node_plans();
    let here = plans.iter().filter(|(place, _)| *place == channel).map(|(_, plan)| plan);
    load::streams(here, config.period_us(), config.node_id, config.heartbeat_ms())
}

/// Returns the worst-case time of the RPDOs of a cycle on the slowest bus.
pub(super) fn rpdo_time(config: &Parameters, rpdos: &RpdoImage) -> Duration {
    let time = |(channel, bus): (Channel, &BusSettings)| {
        let bits: u32 = rpdos.bytes_on(channel).map(bits::worst_case).sum();
        Duration::from_secs(1) * bits / bus.bitrate.max(1)
    };
    (0..).map(Channel).zip(&config.buses).map(time).max().unwrap_or_default()
}
