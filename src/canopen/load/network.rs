//! All buses of one master: load, response times and highest SYNC rate, in the worst case.

use std::time::Duration;

use canopen_rs::NodeId;

use crate::load::abilities::Abilities;
use crate::load::rates::Rates;
use crate::load::response::{self, Contender};
use crate::load::streams::{Role, Stream, sporadic, streams};
use crate::load::timeline::{Pauses, Timeline};
use crate::load::utilisation::BusLoad;
use crate::plan::NodePlan;

/// Node on a bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Member {
    /// Planned configuration, from which the load follows.
    pub plan: NodePlan,
    /// Changes that the node's EDS permits.
    pub abilities: Abilities,
}

/// Bus and its nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct Bus {
    /// Name in the configuration.
    pub name: String,
    /// Bit rate, in bit/s.
    pub bitrate: u32,
    /// Limit of the worst-case load, in percent of the bit rate.
    pub load_limit_percent: f64,
    /// Nodes on the bus.
    pub members: Vec<Member>,
}

/// Master and its buses.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    /// SYNC period, in µs.
    pub period_us: u32,
    /// Node-id of the heartbeat's producer.
    pub master: NodeId,
    /// Producer heartbeat time of the master, in ms.
    pub master_heartbeat_ms: u16,
    /// Buses in the order of their channels.
    pub buses: Vec<Bus>,
}

/// Assumptions that no configuration states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Assumptions {
    /// Processing times of drives and host.
    pub pauses: Pauses,
    /// Minimum time between two emergencies of one node, in µs.
    pub emergency_gap_us: u32,
    /// Minimum time between two SDO exchanges, in µs.
    pub sdo_gap_us: u32,
    /// Minimum time between two bit errors, in µs; `None` for an error-free bus.
    pub error_gap_us: Option<u32>,
}

/// 60 µs for drives and host, one emergency per node and 100 ms, one SDO exchange per 10 ms, no bit errors.
impl Default for Assumptions {
    fn default() -> Self {
        Self {
            pauses: Pauses { drive_us: 60, host_us: 60 },
            emergency_gap_us: 100_000,
            sdo_gap_us: 10_000,
            error_gap_us: None,
        }
    }
}

/// Returns whether a frame with this worst-case `response` may miss its deadline; `None` is unbounded.
pub fn is_late(stream: &Stream, response: Option<Duration>) -> bool {
    let deadline = stream.deadline_us.map(|us| Duration::from_micros(u64::from(us)));
    deadline.is_some_and(|deadline| response.is_none_or(|response| response > deadline))
}

impl Network {
    /// Worst-case load of each bus.
    pub fn loads(&self) -> Vec<BusLoad> {
        let load = |bus| BusLoad::new(&self.planned(bus), bus.bitrate, self.period_us);
        self.buses.iter().map(load).collect()
    }

    /// Returns whether every bus is within its load limit, and a worst-case cycle ends before the next SYNC.
    pub fn fits(&self, assumed: &Assumptions) -> bool {
        let loads = self.loads();
        let mut within = self.buses.iter().zip(loads);
        within.all(|(bus, load)| load.within(bus.load_limit_percent).is_ok())
            && self.cycle_us(assumed) <= f64::from(self.period_us)
    }

    /// Maximum SYNC rate of all buses in the worst case, in Hz.
    pub fn highest_hz(&self, assumed: &Assumptions) -> f64 {
        let rate = |bus: &Bus| {
            let timeline = bus.timeline(&self.planned(bus), worst_bits, assumed);
            self.rates(bus, worst_load, timeline.done_us).highest_hz()
        };
        self.buses.iter().map(rate).fold(f64::INFINITY, f64::min)
    }

    /// Worst-case duration of a cycle on the slowest bus, in µs.
    fn cycle_us(&self, assumed: &Assumptions) -> f64 {
        let timelines =
            self.buses.iter().map(|bus| bus.timeline(&self.planned(bus), worst_bits, assumed));
        timelines.map(|timeline| timeline.done_us).fold(0.0, f64::max)
    }

    /// Worst-case response time of the torques; `None` if one is unbounded.
    pub fn torque_response(&self, assumed: &Assumptions) -> Option<Duration> {
        let responses = self.buses.iter().flat_map(|bus| self.responses(bus, assumed));
        let torques = responses
            .filter(|(stream, _)| stream.is_cyclic() && matches!(stream.role, Role::Rpdo(_)));
        torques
            .map(|(_, response)| response)
            .try_fold(Duration::ZERO, |longest, response| Some(longest.max(response?)))
    }

    /// Returns whether a cyclic frame may miss its deadline.
    pub fn is_late(&self, assumed: &Assumptions) -> bool {
        let mut responses = self.buses.iter().flat_map(|bus| self.responses(bus, assumed));
        responses.any(|(stream, response)| stream.is_cyclic() && is_late(&stream, response))
    }

    /// Planned frames of `bus`.
    pub fn planned(&self, bus: &Bus) -> Vec<Stream> {
        streams(bus.plans(), self.period_us, self.master, self.master_heartbeat_ms)
    }

    /// Frames of `bus` with their worst-case response times, by descending priority.
    pub fn responses(&self, bus: &Bus, assumed: &Assumptions) -> Vec<(Stream, Option<Duration>)> {
        let mut all = self.planned(bus);
        all.extend(bus.sporadic(assumed));
        all.sort_by_key(|stream| stream.cob_id);
        let contenders: Vec<Contender> =
            all.iter().map(|stream| contender(stream, assumed)).collect();
        let responses = response::responses(&contenders, bus.bitrate, assumed.error_gap_us);
        all.into_iter().zip(responses).collect()
    }

    /// Maximum SYNC rates of `bus` at `load` bit/s of each frame, with a cycle of `done_us`.
    pub fn rates(&self, bus: &Bus, load: impl Fn(&Stream) -> f64, done_us: f64) -> Rates {
        let allowed = f64::from(bus.bitrate) * bus.load_limit_percent / 100.0;
        Rates::new(&self.planned(bus), load, self.period_us, allowed, done_us)
    }
}

impl Bus {
    fn plans(&self) -> impl Iterator<Item = &NodePlan> {
        self.members.iter().map(|member| &member.plan)
    }

    /// Sporadic frames: emergencies, and one SDO exchange.
    pub fn sporadic(&self, assumed: &Assumptions) -> Vec<Stream> {
        sporadic(self.plans(), assumed.emergency_gap_us, assumed.sdo_gap_us)
    }

    /// Schedule of the `planned` frames, with `length` in bits.
    pub fn timeline(
        &self,
        planned: &[Stream],
        length: impl Fn(&Stream) -> f64,
        assumed: &Assumptions,
    ) -> Timeline {
        let bit_us = 1e6 / f64::from(self.bitrate.max(1));
        let sporadic = self.sporadic(assumed);
        let others = planned.iter().filter(|stream| !stream.is_cyclic()).chain(&sporadic);
        let longest = others.map(&length).fold(0.0, f64::max);
        let span = |stream: &Stream| length(stream) * bit_us;
        Timeline::new(planned, span, longest * bit_us, assumed.pauses)
    }
}

/// Converts a frame for the response time analysis. A synchronous TPDO is queued after its drive has sampled.
fn contender(stream: &Stream, assumed: &Assumptions) -> Contender {
    let is_sampled = stream.syncs.is_some() && matches!(stream.role, Role::Tpdo(_));
    Contender {
        cob_id: stream.cob_id,
        bits: stream.worst_bits(),
        pace: stream.pace,
        jitter_us: if is_sampled { assumed.pauses.drive_us } else { 0 },
    }
}

fn worst_bits(stream: &Stream) -> f64 {
    f64::from(stream.worst_bits())
}

fn worst_load(stream: &Stream) -> f64 {
    stream.pace.planned_per_s() * worst_bits(stream)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::networks::{
        PAUSES, grouped, network, six_drives_and_switches, with_figures,
    };

    #[test]
    fn six_drives_on_one_bus_fit_at_500_hz_only() {
        let assumed = Assumptions::default();
        let fast = network(six_drives_and_switches(), 1_000);
        assert!(!fast.fits(&assumed));
        let slow = network(six_drives_and_switches(), 2_000);
        assert!(slow.fits(&assumed));
    }

    #[test]
    fn grouped_torques_fit_at_1_khz() {
        assert!(network(grouped(), 1_000).fits(&Assumptions::default()));
    }

    #[test]
    fn emergencies_of_higher_priority_delay_torques() {
        let assumed = Assumptions { pauses: PAUSES, ..Assumptions::default() };
        let drives = grouped().into_iter().filter(|plan| plan.profile == 402).collect();
        let mut network = network(drives, 1_000);
        let before = network.torque_response(&assumed).unwrap();
        for member in &mut network.buses[0].members {
            member.plan.emcy_cob_id = 0x680 + u16::from(member.plan.node.raw());
        }
        let after = network.torque_response(&assumed).unwrap();
        // From an independent program.
        assert_eq!([before.as_micros(), after.as_micros()], [4_760, 990]);
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
            prop_assert_eq!(network.loads().len(), 1);
            prop_assert!(!network.highest_hz(&assumed).is_sign_negative());
            network.fits(&assumed);
            network.is_late(&assumed);
            network.torque_response(&assumed);
        }
    }
}
