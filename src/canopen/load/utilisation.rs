//! Bus load in the worst case, which the configuration is checked against.

use std::time::Duration;

use derive_more::Display;
use thiserror::Error;

use crate::load::streams::Stream;

/// Worst-case load of one bus: every planned frame with maximum bit stuffing. Planned frames are periodic: SYNC,
/// synchronous PDOs, event timers, heartbeats. Changes, emergencies and SDO use the rest.
#[derive(Clone, Copy, Debug, Display, PartialEq)]
#[display("{used:.1} of {available:.0} bits a cycle, {:.1} %", self.percent())]
pub struct BusLoad {
    /// Bits used per SYNC period.
    pub used: f64,
    /// Bits available per SYNC period.
    pub available: f64,
}

impl BusLoad {
    /// Computes the load of `streams` on a bus of `bitrate` bit/s.
    pub fn new(streams: &[Stream], bitrate: u32, sync_period_us: u32) -> Self {
        let per_s: f64 = streams
            .iter()
            .map(|stream| stream.pace.planned_per_s() * f64::from(stream.worst_bits()))
            .sum();
        Self::from_rate(per_s, bitrate, sync_period_us)
    }

    /// Computes the load of `bits_per_s`.
    pub fn from_rate(bits_per_s: f64, bitrate: u32, sync_period_us: u32) -> Self {
        let cycle_s = Duration::from_micros(u64::from(sync_period_us)).as_secs_f64();
        Self { used: bits_per_s * cycle_s, available: f64::from(bitrate) * cycle_s }
    }

    /// Load in percent of the bit rate; infinite for a bit rate of zero.
    pub fn percent(&self) -> f64 {
        if self.available > 0.0 { 100.0 * self.used / self.available } else { f64::INFINITY }
    }

    /// Checks the load against a limit in percent.
    ///
    /// # Errors
    /// Returns an error above the limit.
    pub fn within(self, limit_percent: f64) -> Result<Self, Overload> {
        if self.percent() <= limit_percent {
            Ok(self)
        } else {
            Err(Overload { load: self, limit_percent })
        }
    }
}

/// Error of a load above its limit.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("bus load of {load} is above the limit of {limit_percent} %")]
pub struct Overload {
    /// Worst-case load of the bus.
    pub load: BusLoad,
    /// Limit in percent of the bit rate, below `load`.
    pub limit_percent: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::streams::streams;
    use crate::plan::{ErrorControl, NodePlan};
    use crate::testing::networks::{drives, grouped, master};
    use crate::testing::plans::switch_box;

    const MBIT: u32 = 1_000_000;

    fn load_of(plans: &[NodePlan], period_us: u32, heartbeat_ms: u16) -> BusLoad {
        BusLoad::new(&streams(plans, period_us, master(), heartbeat_ms), MBIT, period_us)
    }

    /// Load without heartbeats.
    fn cyclic(drives: &[NodePlan], period_us: u32) -> BusLoad {
        let error_control = ErrorControl::Heartbeat { period_ms: 0, lost_after: Duration::ZERO };
        let silent = drives.iter().map(|plan| NodePlan { error_control, ..plan.clone() });
        load_of(&silent.collect::<Vec<_>>(), period_us, 0)
    }

    #[test]
    fn six_drives_fit_one_bus_at_500_hz_only() {
        // SYNC 55 + 6 x (8-byte TPDO 135 + 4-byte RPDO 95).
        let fast = cyclic(&drives(6), 1_000);
        assert_eq!(fast.to_string(), "1435.0 of 1000 bits a cycle, 143.5 %");
        assert!(fast.within(90.0).is_err());
        assert_eq!(cyclic(&drives(6), 2_000).to_string(), "1435.0 of 2000 bits a cycle, 71.8 %");
    }

    #[test]
    fn two_buses_of_three_drives_carry_1_khz() {
        let mut plans = drives(3);
        plans.push(switch_box());
        let load = load_of(&plans, 1_000, 5);
        // 745 cyclic, 65 of the switches every 5 ms, heartbeats 13 + 4 x 2.6.
        assert_eq!(load.to_string(), "781.4 of 1000 bits a cycle, 78.1 %");
        assert_eq!(load.within(90.0), Ok(load));
    }

    #[test]
    fn grouped_torques_carry_1_khz_on_one_bus() {
        // SYNC 55, 6 positions of 95, 2 times three targets of 115: 855. Six statuswords of 75 about every
        // 50 ms, 8.78, as many torques about every hundredth SYNC, 4.45, switches of 65 every 5 ms, 13.
        // Heartbeats of 65: the master's every 5 ms, 13; seven every 100 ms, 4.55.
        let load = load_of(&grouped(), 1_000, 5);
        assert_eq!(load.to_string(), "898.8 of 1000 bits a cycle, 89.9 %");
        assert!(load.within(90.0).is_ok());
    }

    #[test]
    fn overload_reads_with_load_and_limit() {
        let overload = cyclic(&drives(6), 1_000).within(90.0).unwrap_err();
        let message = "bus load of 1435.0 of 1000 bits a cycle, 143.5 % is above the limit of 90 %";
        assert_eq!(overload.to_string(), message);
    }

    #[test]
    fn every_further_node_adds_load() {
        let loads: Vec<f64> = (0..7).map(|count| cyclic(&drives(count), 1_000).used).collect();
        assert!(loads.windows(2).all(|pair| pair[0] < pair[1]));
    }

    #[test]
    fn bus_without_bits_carries_nothing() {
        assert!(BusLoad::new(&[Stream::sync(0)], MBIT, 0).within(100.0).is_err());
    }
}
