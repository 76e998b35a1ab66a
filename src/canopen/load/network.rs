//! Plan of a network: all buses of one master, and every figure of each.

use std::time::Duration;

use canopen_rs::NodeId;

use crate::load::abilities::Abilities;
use crate::load::payload::{self, Signals};
use crate::load::rates::Rates;
use crate::load::response::{self, Contender};
use crate::load::streams::{Role, Stream, sporadic, streams};
use crate::load::timeline::{LoopDelay, Pauses, Timeline};
use crate::load::utilisation::{BusLoad, Margin, Utilisation};
use crate::plan::NodePlan;

/// Node on a bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Member {
    /// Plan of the node.
    pub plan: NodePlan,
    /// Changes that its EDS permits.
    pub abilities: Abilities,
    /// Typical values of its objects.
    pub signals: Signals,
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
    /// Node-id of the master.
    pub master: NodeId,
    /// Producer heartbeat time of the master, in ms.
    pub master_heartbeat_ms: u16,
    /// Buses.
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

/// Frame with its typical length and worst-case response time.
#[derive(Clone, Debug, PartialEq)]
pub struct Planned {
    /// Frame.
    pub stream: Stream,
    /// Typical length, in bits.
    pub typical_bits: f64,
    /// Worst-case response time, from queueing to its end; `None` if unbounded.
    pub response: Option<Duration>,
}

impl Planned {
    /// Returns whether it may miss its deadline.
    pub fn is_late(&self) -> bool {
        is_late(&self.stream, self.response)
    }
}

fn is_late(stream: &Stream, response: Option<Duration>) -> bool {
    let deadline = stream.deadline_us.map(|us| Duration::from_micros(u64::from(us)));
    deadline.is_some_and(|deadline| response.is_none_or(|response| response > deadline))
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
    pub frames: Vec<Planned>,
    /// Bus load.
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

impl Network {
    /// Figures of every bus.
    pub fn plan(&self, assumed: &Assumptions) -> Vec<BusPlan> {
        self.buses.iter().map(|bus| self.plan_of(bus, assumed)).collect()
    }

    fn plan_of(&self, bus: &Bus, assumed: &Assumptions) -> BusPlan {
        let signals = |node: NodeId| {
            let member = bus.members.iter().find(|member| member.plan.node == node);
            member.map(|member| member.signals).unwrap_or_default()
        };
        let frames: Vec<Planned> = self
            .responses(bus, assumed)
            .into_iter()
            .map(|(stream, response)| Planned {
                typical_bits: payload::typical_bits(&stream, &signals),
                stream,
                response,
            })
            .collect();
        let typical_bits = |stream: &Stream| {
            let found = frames.iter().find(|frame| frame.stream.cob_id == stream.cob_id);
            found.map_or_else(|| f64::from(stream.worst_bits()), |frame| frame.typical_bits)
        };
        let (planned, sporadic) = (self.planned(bus), bus.sporadic(assumed));
        let utilisation =
            Utilisation::of(&planned, &sporadic, typical_bits, bus.bitrate, self.period_us);
        let timeline = Both {
            worst: bus.timeline(&planned, worst_bits, assumed),
            typical: bus.timeline(&planned, typical_bits, assumed),
        };
        let period_us = f64::from(self.period_us);
        let typical_load = |stream: &Stream| stream.pace.typical_per_s() * typical_bits(stream);
        BusPlan {
            name: bus.name.clone(),
            bitrate: bus.bitrate,
            load_limit_percent: bus.load_limit_percent,
            margin: utilisation.margin(bus.bitrate),
            loop_delay: Both {
                worst: timeline.worst.loop_delay(period_us),
                typical: timeline.typical.loop_delay(period_us),
            },
            rates: Both {
                worst: self.rates(bus, worst_load, timeline.worst.done_us),
                typical: self.rates(bus, typical_load, timeline.typical.done_us),
            },
            frames,
            utilisation,
            timeline,
        }
    }

    /// Worst-case load of each bus.
    pub fn loads(&self) -> Vec<BusLoad> {
        let load = |bus| BusLoad::of(&self.planned(bus), bus.bitrate, self.period_us);
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
    fn planned(&self, bus: &Bus) -> Vec<Stream> {
        streams(bus.plans(), self.period_us, self.master, self.master_heartbeat_ms)
    }

    /// Frames of `bus` with their worst-case response times, by descending priority.
    fn responses(&self, bus: &Bus, assumed: &Assumptions) -> Vec<(Stream, Option<Duration>)> {
        let mut all = self.planned(bus);
        all.extend(bus.sporadic(assumed));
        all.sort_by_key(|stream| stream.cob_id);
        let contenders: Vec<Contender> =
            all.iter().map(|stream| contender(stream, assumed)).collect();
        let responses = response::responses(&contenders, bus.bitrate, assumed.error_gap_us);
        all.into_iter().zip(responses).collect()
    }

    fn rates(&self, bus: &Bus, load: impl Fn(&Stream) -> f64, done_us: f64) -> Rates {
        let allowed = f64::from(bus.bitrate) * bus.load_limit_percent / 100.0;
        Rates::of(&self.planned(bus), load, self.period_us, allowed, done_us)
    }
}

impl Bus {
    fn plans(&self) -> impl Iterator<Item = &NodePlan> {
        self.members.iter().map(|member| &member.plan)
    }

    fn sporadic(&self, assumed: &Assumptions) -> Vec<Stream> {
        sporadic(self.plans(), assumed.emergency_gap_us, assumed.sdo_gap_us)
    }

    /// Schedule of the `planned` frames, with `length` in bits.
    fn timeline(
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
        Timeline::of(planned, span, longest * bit_us, assumed.pauses)
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
pub(crate) mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::load::streams::tests::{drives, grouped, master};
    use crate::testing::plans::switch_box;

    /// Bus of `plans` at 1 Mbit/s with a limit of 90 %, whose drives permit every change.
    pub(crate) fn network(plans: Vec<NodePlan>, period_us: u32) -> Network {
        let member = |plan| Member {
            plan,
            abilities: Abilities { no_group: Vec::new(), moves_emergencies: true },
            signals: Signals { home: 20_000, travel: 60_000, holding: 100, effort: 200 },
        };
        let bus = Bus {
            name: "joints".into(),
            bitrate: 1_000_000,
            load_limit_percent: 90.0,
            members: plans.into_iter().map(member).collect(),
        };
        Network { period_us, master: master(), master_heartbeat_ms: 5, buses: vec![bus] }
    }

    pub(crate) fn six_drives_and_switches() -> Vec<NodePlan> {
        let mut plans = drives(6);
        plans.push(switch_box());
        plans
    }

    #[test]
    fn six_drives_on_one_bus_fit_at_500_hz_only() {
        let assumed = Assumptions::default();
        let fast = network(six_drives_and_switches(), 1_000);
        assert!(!fast.fits(&assumed) && !fast.plan(&assumed)[0].fits());
        let slow = network(six_drives_and_switches(), 2_000);
        assert!(slow.fits(&assumed) && slow.plan(&assumed)[0].fits());
    }

    #[test]
    fn grouped_torques_fit_at_1_khz_with_bounded_responses() {
        let assumed = Assumptions::default();
        let network = network(grouped(), 1_000);
        assert!(network.fits(&assumed));
        let plan = &network.plan(&assumed)[0];
        assert_eq!(plan.timeline.worst.done_us.to_string(), "975");
        assert!(plan.frames.iter().all(|frame| frame.response.is_some()));
        assert_eq!(plan.loop_delay.worst.synchronous_us.to_string(), "1000");
        let rates = plan.rates;
        assert_eq!(format!("{:.0}", rates.worst.highest_hz()), "1001");
        assert!(rates.typical.highest_hz() > rates.worst.highest_hz());
    }

    #[test]
    fn emergencies_of_higher_priority_delay_torques() {
        let pauses = Pauses { drive_us: 100, host_us: 60 };
        let assumed = Assumptions { pauses, ..Assumptions::default() };
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

    #[test]
    fn figures_of_all_methods_agree() {
        let assumed = Assumptions::default();
        for plans in [grouped(), six_drives_and_switches()] {
            let network = network(plans, 1_000);
            let plan = &network.plan(&assumed)[0];
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
            let mut network = network(drives(2), period_us);
            network.master_heartbeat_ms = heartbeat_ms;
            network.buses[0].bitrate = bitrate;
            network.buses[0].load_limit_percent = limit;
            let pauses = Pauses { drive_us: gap, host_us: gap };
            let assumed = Assumptions {
                pauses,
                emergency_gap_us: gap,
                sdo_gap_us: gap,
                error_gap_us: Some(gap),
            };
            prop_assert_eq!(network.plan(&assumed).len(), 1);
        }
    }
}
