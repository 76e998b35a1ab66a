//! Maximum SYNC rate of a bus: within its load limit, and with each cycle complete before the next SYNC.
//!
//! With K bits per cycle governed by SYNC and r bit/s of other frames, the load at rate f is K f + r. The limit L
//! of a bus of b bit/s is reached at f = (L b - r) / K.

use crate::load::streams::Stream;

/// Rates in Hz; infinite if unbounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Maximum rate by the load limit.
    pub load_hz: f64,
    /// Maximum rate by the duration of a cycle.
    pub cycle_hz: f64,
}

impl Rates {
    /// Computes the rates of `planned`, now with a SYNC every `period_us`, on a bus with `allowed` bit/s and a
    /// cycle of `done_us`. `load` returns the bit/s of a stream.
    pub fn new(
        planned: &[Stream],
        load: impl Fn(&Stream) -> f64,
        period_us: u32,
        allowed: f64,
        done_us: f64,
    ) -> Self {
        let sum = |is_governed| {
            let streams = planned.iter().filter(|stream| stream.syncs.is_some() == is_governed);
            streams.map(&load).sum::<f64>()
        };
        let bits_per_cycle: f64 = sum(true) * f64::from(period_us) / 1e6;
        Self {
            load_hz: quotient((allowed - sum(false)).max(0.0), bits_per_cycle),
            cycle_hz: quotient(1e6, done_us),
        }
    }

    /// Lower of the two rates.
    pub const fn highest_hz(&self) -> f64 {
        self.load_hz.min(self.cycle_hz)
    }
}

fn quotient(dividend: f64, divisor: f64) -> f64 {
    if divisor > 0.0 { dividend / divisor } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::load::streams::streams;
    use crate::load::utilisation::BusLoad;
    use crate::plan::NodePlan;
    use crate::testing::networks::{drives, grouped, master};

    fn worst(stream: &Stream) -> f64 {
        stream.pace.planned_per_s() * f64::from(stream.worst_bits())
    }

    #[test]
    fn rates_match_an_independent_program() {
        // SYNC, six positions of 4 bytes, two shared torques of 6: 1170 Hz. One 4-byte RPDO and one 8-byte TPDO per
        // drive: a million divided by 1435.
        let silent = |plans: Vec<NodePlan>| -> Vec<Stream> {
            let all = streams(&plans, 1_000, master(), 0);
            all.into_iter().filter(Stream::is_cyclic).collect()
        };
        let hz = |streams: &[Stream]| {
            format!("{:.0}", Rates::new(streams, worst, 1_000, 1e6, 0.0).highest_hz())
        };
        assert_eq!(hz(&silent(grouped())), "1170");
        assert_eq!(hz(&silent(drives(6))), "697");
    }

    #[test]
    fn longer_cycle_lowers_the_rate() {
        let planned = streams(&grouped(), 1_000, master(), 5);
        let rates = Rates::new(&planned, worst, 1_000, 0.9e6, 1_250.0);
        assert_eq!(format!("{:.0} {:.0}", rates.load_hz, rates.highest_hz()), "1001 800");
    }

    #[test]
    fn empty_plan_has_an_infinite_rate() {
        assert!(Rates::new(&[], worst, 1_000, 1e6, 0.0).highest_hz().is_infinite());
    }

    proptest! {
        #[test]
        fn load_at_the_maximum_rate_is_the_limit(
            count in 1_u8..7,
            period_us in 100_u32..100_000,
            limit in 50.0_f64..100.0,
        ) {
            let plans = drives(count);
            let planned = streams(&plans, period_us, master(), 5);
            let rates = Rates::new(&planned, worst, period_us, 1e4 * limit, 0.0);
            let at = |hz: f64| {
                let others: f64 = planned.iter().filter(|s| s.syncs.is_none()).map(worst).sum();
                let cycle: f64 = planned.iter().filter(|s| s.syncs.is_some()).map(worst).sum();
                let rate = cycle * f64::from(period_us) / 1e6 * hz + others;
                BusLoad::from_rate(rate, 1_000_000, period_us).percent()
            };
            prop_assert!((at(rates.load_hz) - limit).abs() < 1e-9);
        }
    }
}
