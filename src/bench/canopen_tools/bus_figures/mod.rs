//! Figures of every bus, as `frhc plan` shows them: worst and typical case.
//!
//! | file | content |
//! |---|---|
//! | [`values`] | typical values of a configuration's drives |
//! | [`typical`] | typical frame lengths, from typical values |
//! | [`utilisation`] | bus load by several measures, and the margin |
//! | [`loop_delay`] | delay from position to torque |

pub mod loop_delay;
pub mod typical;
pub mod utilisation;
pub mod values;

use std::time::Duration;

use crate::bus_figures::loop_delay::LoopDelay;
use crate::bus_figures::typical::SignalLookup;
use crate::bus_figures::utilisation::{Margin, Utilisation};
use crate::bus_figures::values::Values;
use canopen::frame::Channel;
use canopen::load::network::{self, Assumptions, Bus, Network};
use canopen::load::rates::Rates;
use canopen::load::streams::Stream;
use canopen::load::timeline::Timeline;

/// Frame with its typical length and worst-case response time.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedFrame {
    /// COB-ID, sender, length and frequency.
    pub stream: Stream,
    /// Typical length, in bits.
    pub typical_bits: f64,
    /// Worst-case response time, from queueing to its end; `None` if unbounded.
    pub response: Option<Duration>,
}

impl PlannedFrame {
    /// Returns whether it may miss its deadline.
    pub fn is_late(&self) -> bool {
        network::is_late(&self.stream, self.response)
    }
}

/// Worst and typical case.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Both<T> {
    /// With maximum bit stuffing.
    pub worst: T,
    /// With typical lengths.
    pub typical: T,
}

/// Figures of one bus.
#[derive(Clone, Debug, PartialEq)]
pub struct BusPlan {
    /// Name in the configuration.
    pub name: String,
    /// Bit rate, in bit/s.
    pub bitrate: u32,
    /// Limit of the worst-case load, in percent of the bit rate.
    pub load_limit_percent: f64,
    /// Frames by descending priority.
    pub frames: Vec<PlannedFrame>,
    /// Bus load by several measures.
    pub utilisation: Utilisation,
    /// Margin for unplanned traffic.
    pub margin: Margin,
    /// Schedule of a cycle.
    pub timeline: Both<Timeline>,
    /// Delay from position to torque.
    pub loop_delay: Both<LoopDelay>,
    /// Maximum SYNC rates.
    pub rates: Both<Rates>,
}

impl BusPlan {
    /// Returns whether the load is within its limit.
    pub fn fits(&self) -> bool {
        self.utilisation.worst.within(self.load_limit_percent).is_ok()
    }

    /// Returns whether a worst-case cycle ends before the next SYNC.
    pub fn is_done_within(&self, period_us: u32) -> bool {
        self.timeline.worst.done_us <= f64::from(period_us)
    }
}

/// Figures of every bus of `network`, whose drives have the typical `values`.
pub fn plans(network: &Network, values: &Values, assumed: &Assumptions) -> Vec<BusPlan> {
    let buses = (0..).map(Channel).zip(&network.buses);
    let plan = |(channel, bus)| {
        let known = |node| values.get(&(channel, node)).copied().unwrap_or_default();
        plan_of(network, bus, &known, assumed)
    };
    buses.map(plan).collect()
}

fn plan_of(
    network: &Network,
    bus: &Bus,
    known: SignalLookup<'_>,
    assumed: &Assumptions,
) -> BusPlan {
    let responses = network.responses(bus, assumed).into_iter();
    let planned = |(stream, response)| {
        let typical_bits = typical::typical_bits(&stream, known);
        PlannedFrame { stream, typical_bits, response }
    };
    let frames: Vec<PlannedFrame> = responses.map(planned).collect();
    let worst_bits = |stream: &Stream| f64::from(stream.worst_bits());
    let typical_bits = |stream: &Stream| {
        let found = frames.iter().find(|frame| frame.stream.cob_id == stream.cob_id);
        found.map_or_else(|| worst_bits(stream), |frame| frame.typical_bits)
    };
    let worst_load = |stream: &Stream| stream.pace.planned_per_s() * worst_bits(stream);
    let typical_load = |stream: &Stream| stream.pace.typical_per_s() * typical_bits(stream);
    let (planned, sporadic) = (network.planned(bus), bus.sporadic(assumed));
    let utilisation =
        Utilisation::new(&planned, &sporadic, typical_bits, bus.bitrate, network.period_us);
    let timeline = Both {
        worst: bus.timeline(&planned, worst_bits, assumed),
        typical: bus.timeline(&planned, typical_bits, assumed),
    };
    let period_us = f64::from(network.period_us);
    BusPlan {
        name: bus.name.clone(),
        bitrate: bus.bitrate,
        load_limit_percent: bus.load_limit_percent,
        margin: utilisation.margin(bus.bitrate),
        loop_delay: Both {
            worst: LoopDelay::new(&timeline.worst, period_us),
            typical: LoopDelay::new(&timeline.typical, period_us),
        },
        rates: Both {
            worst: network.rates(bus, worst_load, timeline.worst.done_us),
            typical: network.rates(bus, typical_load, timeline.typical.done_us),
        },
        frames,
        utilisation,
        timeline,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::bus_figures::typical::Signals;
    use canopen::testing::networks::{
        drives, grouped, network, six_drives_and_switches, with_figures,
    };

    /// Typical values of drives 1 to 6.
    fn values() -> Values {
        let signals = Signals { home: 20_000, travel: 60_000, holding: 100, effort: 200 };
        drives(6).iter().map(|plan| ((Channel(0), plan.node), signals)).collect()
    }

    #[test]
    fn six_drives_on_one_bus_fit_at_500_hz_only() {
        let assumed = Assumptions::default();
        let fast = network(six_drives_and_switches(), 1_000);
        assert!(!plans(&fast, &values(), &assumed)[0].fits());
        let slow = network(six_drives_and_switches(), 2_000);
        assert!(plans(&slow, &values(), &assumed)[0].fits());
    }

    #[test]
    fn grouped_torques_fit_at_1_khz_with_bounded_responses() {
        let assumed = Assumptions::default();
        let network = network(grouped(), 1_000);
        assert!(network.fits(&assumed));
        let plan = &plans(&network, &values(), &assumed)[0];
        assert_eq!(plan.timeline.worst.done_us.to_string(), "975");
        assert!(plan.frames.iter().all(|frame| frame.response.is_some()));
        assert_eq!(plan.loop_delay.worst.synchronous_us.to_string(), "1000");
        let rates = plan.rates;
        assert_eq!(format!("{:.0}", rates.worst.highest_hz()), "1001");
        assert!(rates.typical.highest_hz() > rates.worst.highest_hz());
    }

    #[test]
    fn figures_of_all_methods_agree() {
        let assumed = Assumptions::default();
        for nodes in [grouped(), six_drives_and_switches()] {
            let network = network(nodes, 1_000);
            let plan = &plans(&network, &values(), &assumed)[0];
            assert_eq!(network.loads(), [plan.utilisation.worst]);
            let highest = network.highest_hz(&assumed) - plan.rates.worst.highest_hz();
            assert_eq!(highest.to_string(), "0");
            let late = plan.frames.iter().any(|f| f.stream.is_cyclic() && f.is_late());
            assert_eq!(network.is_late(&assumed), late);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn absurd_figures_never_panic(
            period_us in any::<u32>(),
            bitrate in prop_oneof![Just(0_u32), Just(10_000), any::<u32>()],
            heartbeat_ms in any::<u16>(),
            limit in any::<f64>(),
            gap in any::<u32>(),
        ) {
            let (network, assumed) = with_figures(period_us, bitrate, heartbeat_ms, limit, gap);
            prop_assert_eq!(plans(&network, &values(), &assumed).len(), 1);
        }
    }
}
