//! How full a bus is: the worst-case bits its planned frames take in one cycle.
//!
//! Counts what is planned: SYNC, PDOs, heartbeats; event-driven frames at the fastest their inhibit
//! time lets them be. Emergencies and SDO are not planned: what is left is theirs.

use std::fmt;
use std::time::Duration;

use canopen_rs::NodeId;
use canopen_rs::nmt::heartbeat_cob_id;
use thiserror::Error;

use crate::canopen::bits;
use crate::canopen::layout::Direction;
use crate::canopen::layout::Pdo;
use crate::canopen::layout::Service;
use crate::canopen::plan::ErrorControl;
use crate::canopen::plan::NodePlan;
use crate::canopen::sync;

/// A frame that comes again and again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stream {
    /// Its identifier.
    pub cob_id: u16,
    /// Its data bytes.
    pub bytes: u32,
    /// The least time between two of them, in µs, at least 1.
    pub period_us: u32,
}

impl Stream {
    /// SYNC, without a counter.
    pub const fn sync(period_us: u32) -> Self {
        Self { cob_id: sync::COB_ID, bytes: 0, period_us }
    }

    /// The heartbeat of `node`; `None` if it has none.
    pub fn heartbeat(node: NodeId, period_ms: u16) -> Option<Self> {
        let period_us = u32::from(period_ms) * 1_000;
        (period_us > 0).then_some(Self { cob_id: heartbeat_cob_id(node), bytes: 1, period_us })
    }

    /// How a node is watched: its heartbeat, or the question of its guard and the answer.
    pub fn error_control(node: NodeId, control: ErrorControl) -> impl Iterator<Item = Self> {
        let (period_ms, question) = match control {
            ErrorControl::Heartbeat { period_ms, .. } => (period_ms, None),
            ErrorControl::Guarding(guarding) => (guarding.guard_time_ms, Some(0)),
        };
        let answer = Self::heartbeat(node, period_ms);
        let question = answer.zip(question).map(|(answer, bytes)| Self { bytes, ..answer });
        answer.into_iter().chain(question)
    }

    /// A PDO; `None` if it is off. An event-driven one without inhibit time counts once a cycle.
    pub fn pdo(pdo: &Pdo, sync_period_us: u32) -> Option<Self> {
        let service = pdo.service.as_ref()?;
        let inhibit_us = service.inhibit_100us.map(|inhibit| u32::from(inhibit) * 100);
        let period_us = match service.transmission.syncs() {
            Some(syncs) => sync_period_us.saturating_mul(u32::from(syncs)),
            None => inhibit_us.filter(|inhibit| *inhibit > 0).unwrap_or(sync_period_us),
        };
        Some(Self { cob_id: pdo.cob_id, bytes: service.bytes(), period_us })
    }

    /// Its worst-case bits in a time of `cycle_us`, on average.
    pub fn bits_in(&self, cycle_us: u32) -> f64 {
        let bits = f64::from(bits::worst_case(self.bytes));
        bits * f64::from(cycle_us) / f64::from(self.period_us.max(1))
    }
}

/// Everything planned on one bus: SYNC, the master's heartbeat, and what the nodes of `plans` send
/// and take.
pub fn streams<'a>(
    plans: impl IntoIterator<Item = &'a NodePlan>,
    sync_period_us: u32,
    master: NodeId,
    master_heartbeat_ms: u16,
) -> Vec<Stream> {
    let mut streams = vec![Stream::sync(sync_period_us)];
    streams.extend(Stream::heartbeat(master, master_heartbeat_ms));
    for plan in plans {
        streams.extend(plan.pdos.iter().filter_map(|pdo| Stream::pdo(pdo, sync_period_us)));
        streams.extend(Stream::error_control(plan.node, plan.error_control));
    }
    streams
}

/// The worst-case bits of what the master sends to one node in a cycle.
pub fn rpdo_bits(plan: &NodePlan) -> u32 {
    let received = plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Receive);
    let bytes = received.filter_map(|pdo| pdo.service.as_ref()).map(Service::bytes);
    bytes.map(bits::worst_case).sum()
}

/// The worst-case load of one bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BusLoad {
    /// Bits in use, in one SYNC period.
    pub used: f64,
    /// Bits there are, in one SYNC period.
    pub available: f64,
}

impl BusLoad {
    /// The load that `streams` put on a bus of `bitrate` bit/s.
    pub fn of(streams: &[Stream], bitrate: u32, sync_period_us: u32) -> Self {
        let used = streams.iter().map(|stream| stream.bits_in(sync_period_us)).sum();
        let cycle = Duration::from_micros(u64::from(sync_period_us));
        Self { used, available: f64::from(bitrate) * cycle.as_secs_f64() }
    }

    /// Percent of the bitrate; infinite where there are no bits at all.
    pub fn percent(&self) -> f64 {
        if self.available > 0.0 { 100.0 * self.used / self.available } else { f64::INFINITY }
    }

    /// Checks the load against a limit in percent.
    ///
    /// # Errors
    /// When it is above.
    pub fn within(self, limit_percent: f64) -> Result<Self, Overload> {
        if self.percent() <= limit_percent {
            Ok(self)
        } else {
            Err(Overload { load: self, limit_percent })
        }
    }
}

/// `833.4 of 1000 bits a cycle, 83.3 %`.
impl fmt::Display for BusLoad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { used, available } = self;
        write!(f, "{used:.1} of {available:.0} bits a cycle, {:.1} %", self.percent())
    }
}

/// More planned than the bus is meant to carry.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("bus load of {load} is above the limit of {limit_percent} %")]
pub struct Overload {
    /// What is planned.
    pub load: BusLoad,
    /// What is allowed, in percent.
    pub limit_percent: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::guarding::Guarding;
    use crate::canopen::plan::tests::elbow;
    use crate::canopen::plan::tests::switch_box;

    const MBIT: u32 = 1_000_000;

    fn master() -> NodeId {
        NodeId::new(127).unwrap()
    }

    fn drives(count: usize) -> Vec<NodePlan> {
        vec![elbow(); count]
    }

    fn cyclic(drives: &[NodePlan], period_us: u32) -> BusLoad {
        let error_control = ErrorControl::Heartbeat { period_ms: 0, lost_after: Duration::ZERO };
        let silent = drives.iter().map(|plan| NodePlan { error_control, ..plan.clone() });
        let plans: Vec<_> = silent.collect();
        BusLoad::of(&streams(&plans, period_us, master(), 0), MBIT, period_us)
    }

    #[test]
    fn six_drives_fill_one_bus_at_500_hz_and_overfill_it_at_1_khz() {
        // SYNC 55 + 6 x (8-byte TPDO 135 + 4-byte RPDO 95), SAFETY and PERFORMANCE of the design.
        let fast = cyclic(&drives(6), 1_000);
        assert_eq!(fast.to_string(), "1435.0 of 1000 bits a cycle, 143.5 %");
        assert!(fast.within(90.0).is_err());
        assert_eq!(cyclic(&drives(6), 2_000).to_string(), "1435.0 of 2000 bits a cycle, 71.8 %");
    }

    #[test]
    fn a_guarded_node_takes_a_question_and_an_answer_every_guard_time() {
        let guarded = Guarding { guard_time_ms: 10, life_time_factor: 3 };
        let node = NodeId::new(3).unwrap();
        let streams: Vec<_> =
            Stream::error_control(node, ErrorControl::Guarding(guarded)).collect();
        let stream = |bytes| Stream { cob_id: 0x703, bytes, period_us: 10_000 };
        assert_eq!(streams, [stream(1), stream(0)]);
    }

    #[test]
    fn two_buses_of_three_drives_carry_1_khz_with_everything_else() {
        let mut plans = drives(3);
        plans.push(switch_box());
        let load = BusLoad::of(&streams(&plans, 1_000, master(), 5), MBIT, 1_000);
        // 745 cyclic, 65 of the switches on each inhibit time, heartbeats 13 + 4 x 2.6.
        assert_eq!(load.to_string(), "833.4 of 1000 bits a cycle, 83.3 %");
        assert_eq!(load.within(90.0), Ok(load));
    }

    #[test]
    fn an_event_driven_frame_counts_as_often_as_its_inhibit_time_lets_it() {
        let pdo = switch_box().pdos.swap_remove(0);
        let bits = |cycle_us| Stream::pdo(&pdo, cycle_us).unwrap().bits_in(cycle_us).to_string();
        assert_eq!([bits(500), bits(1_000), bits(4_000)], ["32.5", "65", "260"]);
    }

    #[test]
    fn an_overload_says_by_how_much() {
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
    fn a_bus_without_bits_carries_nothing() {
        assert!(BusLoad::of(&[Stream::sync(0)], MBIT, 0).within(100.0).is_err());
    }
}
