//! Bus load: the worst case that the configuration is checked against, other measures, and the margin.

use std::fmt;
use std::time::Duration;

use thiserror::Error;

use crate::bits;
use crate::load::streams::Stream;

/// Worst-case bits of an expedited SDO exchange: request and response of 8 bytes.
const SDO_EXCHANGE: u32 = 2 * bits::worst_case(8);

/// Worst-case load of one bus: every planned frame with maximum bit stuffing. Planned frames are periodic: SYNC,
/// synchronous PDOs, event timers, heartbeats. Changes, emergencies and SDO use the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BusLoad {
    /// Bits used per SYNC period.
    pub used: f64,
    /// Bits available per SYNC period.
    pub available: f64,
}

impl BusLoad {
    /// Computes the load of `streams` on a bus of `bitrate` bit/s.
    pub fn of(streams: &[Stream], bitrate: u32, sync_period_us: u32) -> Self {
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

/// `833.4 of 1000 bits a cycle, 83.3 %`
impl fmt::Display for BusLoad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { used, available } = self;
        write!(f, "{used:.1} of {available:.0} bits a cycle, {:.1} %", self.percent())
    }
}

/// Error of a load above its limit.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("bus load of {load} is above the limit of {limit_percent} %")]
pub struct Overload {
    /// Load.
    pub load: BusLoad,
    /// Limit, in percent.
    pub limit_percent: f64,
}

/// Load of one bus by several measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Utilisation {
    /// SYNC and synchronous PDOs without stuff bits.
    pub cycle_least: BusLoad,
    /// SYNC and synchronous PDOs with maximum bit stuffing.
    pub cycle_worst: BusLoad,
    /// Planned frames without stuff bits.
    pub least: BusLoad,
    /// Typical traffic while the arm moves, with typical lengths.
    pub typical: BusLoad,
    /// Planned frames with maximum bit stuffing: checked against the limit.
    pub worst: BusLoad,
    /// Worst case while all measured values change at their inhibit times.
    pub busiest: BusLoad,
    /// Busiest case with emergencies and SDO.
    pub with_sporadic: BusLoad,
}

impl Utilisation {
    /// Computes all measures from planned and sporadic frames. `typical_bits` returns the typical length.
    pub fn of(
        planned: &[Stream],
        sporadic: &[Stream],
        typical_bits: impl Fn(&Stream) -> f64,
        bitrate: u32,
        period_us: u32,
    ) -> Self {
        let load = |rate: f64| BusLoad::from_rate(rate, bitrate, period_us);
        let sum = |bits_per_s: &dyn Fn(&Stream) -> f64| planned.iter().map(bits_per_s).sum::<f64>();
        let cyclic = |bits: fn(&Stream) -> u32| {
            sum(&|stream| {
                let rate = if stream.is_cyclic() { stream.pace.planned_per_s() } else { 0.0 };
                rate * f64::from(bits(stream))
            })
        };
        let worst = |stream: &Stream| f64::from(stream.worst_bits());
        let busiest = sum(&|stream| stream.pace.busiest_per_s() * worst(stream));
        let sporadic: f64 =
            sporadic.iter().map(|stream| stream.pace.sustained_per_s() * worst(stream)).sum();
        Self {
            cycle_least: load(cyclic(Stream::least_bits)),
            cycle_worst: load(cyclic(Stream::worst_bits)),
            least: load(sum(&|s| s.pace.planned_per_s() * f64::from(s.least_bits()))),
            typical: load(sum(&|s| s.pace.typical_per_s() * typical_bits(s))),
            worst: BusLoad::of(planned, bitrate, period_us),
            busiest: load(busiest),
            with_sporadic: load(busiest + sporadic),
        }
    }

    /// Margin beside the planned frames.
    pub fn margin(&self, bitrate: u32) -> Margin {
        let bits_per_s = f64::from(bitrate) * (1.0 - self.worst.percent() / 100.0).max(0.0);
        Margin { bits_per_s, expedited_sdo_per_s: bits_per_s / f64::from(SDO_EXCHANGE) }
    }
}

/// Margin for unplanned traffic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margin {
    /// Margin in bit/s.
    pub bits_per_s: f64,
    /// Margin in expedited SDO exchanges per second.
    pub expedited_sdo_per_s: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Mapped;
    use crate::load::streams::tests::{drives, grouped, master};
    use crate::load::streams::{sporadic, streams};
    use crate::object::Object;
    use crate::plan::{ErrorControl, NodePlan};
    use crate::testing::plans::switch_box;

    const MBIT: u32 = 1_000_000;

    fn of(plans: &[NodePlan], period_us: u32, heartbeat_ms: u16) -> BusLoad {
        BusLoad::of(&streams(plans, period_us, master(), heartbeat_ms), MBIT, period_us)
    }

    /// Load without heartbeats.
    fn cyclic(drives: &[NodePlan], period_us: u32) -> BusLoad {
        let error_control = ErrorControl::Heartbeat { period_ms: 0, lost_after: Duration::ZERO };
        let silent = drives.iter().map(|plan| NodePlan { error_control, ..plan.clone() });
        of(&silent.collect::<Vec<_>>(), period_us, 0)
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
        let load = of(&plans, 1_000, 5);
        // 745 cyclic, 65 of the switches every 5 ms, heartbeats 13 + 4 x 2.6.
        assert_eq!(load.to_string(), "781.4 of 1000 bits a cycle, 78.1 %");
        assert_eq!(load.within(90.0), Ok(load));
    }

    #[test]
    fn grouped_torques_carry_1_khz_on_one_bus() {
        // SYNC 55, 6 positions of 95, 2 times three targets of 115: 855. Six statuswords of 75 about every
        // 50 ms, 8.78, as many torques about every hundredth SYNC, 4.45, switches of 65 every 5 ms, 13.
        // Heartbeats of 65: the master's every 5 ms, 13; seven every 100 ms, 4.55.
        let load = of(&grouped(), 1_000, 5);
        assert_eq!(load.to_string(), "898.8 of 1000 bits a cycle, 89.9 %");
        assert!(load.within(90.0).is_ok());
    }

    #[test]
    fn every_measure_has_its_value() {
        // As grouped, but with the torque beside the statusword: 4 bytes, as often as every 10 ms.
        let mut plans = grouped();
        let services = plans.iter_mut().flat_map(|plan| &mut plan.pdos);
        for service in services.filter_map(|pdo| pdo.service.as_mut()) {
            if service.mapping.iter().any(|mapped| mapped.object == Object::STATUSWORD) {
                service.mapping.push(Mapped { object: Object::TORQUE_ACTUAL, bits: 16 });
            }
        }
        let planned = streams(&plans, 1_000, master(), 5);
        let sporadic = sporadic(&plans, 100_000, 10_000);
        let least = |stream: &Stream| f64::from(stream.least_bits());
        let all = Utilisation::of(&planned, &sporadic, least, MBIT, 1_000);
        assert_eq!(all.cycle_worst.to_string(), "855.0 of 1000 bits a cycle, 85.5 %");
        assert_eq!(all.cycle_least.to_string(), "711.0 of 1000 bits a cycle, 71.1 %");
        // Six statuswords of 95 bits about every 50 ms, 11.12; every 10 ms, 57.
        assert_eq!(all.worst.to_string(), "901.1 of 1000 bits a cycle, 90.1 %");
        assert_eq!(all.busiest.to_string(), "947.0 of 1000 bits a cycle, 94.7 %");
        // Seven emergencies every 100 ms and an SDO exchange every 10 ms.
        assert_eq!(all.with_sporadic.to_string(), "983.5 of 1000 bits a cycle, 98.3 %");
    }

    #[test]
    fn margin_is_available_to_sdo() {
        // A cycle of 855 bits at 1 kHz and six heartbeats at 10 Hz leave 141 kbit/s, 523 exchanges a
        // second, by an independent program.
        let left = |worst: f64| {
            let load = BusLoad::from_rate(worst, MBIT, 1_000);
            let all = Utilisation {
                cycle_least: load,
                cycle_worst: load,
                least: load,
                typical: load,
                worst: load,
                busiest: load,
                with_sporadic: load,
            };
            all.margin(MBIT)
        };
        let margin = left(858_900.0);
        assert_eq!(format!("{:.0}", margin.bits_per_s), "141100");
        assert_eq!(format!("{:.0}", margin.expedited_sdo_per_s), "523");
        assert_eq!(left(2e6).bits_per_s.to_string(), "0");
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
        assert!(BusLoad::of(&[Stream::sync(0)], MBIT, 0).within(100.0).is_err());
    }
}
