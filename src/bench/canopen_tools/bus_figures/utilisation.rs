//! Load of a bus by several measures, and the margin beside the planned frames.

use canopen::bits;
use canopen::load::BusLoad;
use canopen::load::streams::Stream;

/// Worst-case bits of an expedited SDO exchange: request and response of 8 bytes.
const SDO_EXCHANGE: u32 = 2 * bits::worst_case(8);

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
    pub fn new(
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
            worst: BusLoad::new(planned, bitrate, period_us),
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
    /// Bit rate that the worst-case load leaves, in bit/s; zero if it leaves none.
    pub bits_per_s: f64,
    /// Margin in expedited SDO exchanges per second.
    pub expedited_sdo_per_s: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::layout::MappedObject;
    use canopen::load::streams::{sporadic, streams};
    use canopen::object::Object;
    use canopen::testing::networks::{grouped, master};

    const MBIT: u32 = 1_000_000;

    #[test]
    fn every_measure_has_its_value() {
        // As grouped, but with the torque beside the statusword: 4 bytes, as often as every 10 ms.
        let mut plans = grouped();
        let services = plans.iter_mut().flat_map(|plan| &mut plan.pdos);
        for service in services.filter_map(|pdo| pdo.service.as_mut()) {
            if service.mapping.iter().any(|mapped| mapped.object == Object::STATUSWORD) {
                service.mapping.push(MappedObject { object: Object::TORQUE_ACTUAL, bits: 16 });
            }
        }
        let planned = streams(&plans, 1_000, master(), 5);
        let sporadic = sporadic(&plans, 100_000, 10_000);
        let least = |stream: &Stream| f64::from(stream.least_bits());
        let all = Utilisation::new(&planned, &sporadic, least, MBIT, 1_000);
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
}
