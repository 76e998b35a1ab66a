//! Networks of the tests: up to six drives, and the switch box.

use canopen_rs::NodeId;

use crate::layout;
use crate::load::abilities::Abilities;
use crate::load::network::{Assumptions, Bus, Member, Network};
use crate::load::streams::Stream;
use crate::load::timeline::{Pauses, Timeline};
use crate::plan::{ErrorControl, NodePlan};
use crate::testing::plans::{elbow, switch_box};

pub fn node(raw: u8) -> NodeId {
    NodeId::new(raw).unwrap()
}

pub fn master() -> NodeId {
    node(127)
}

/// Drives 1 to `count` with the per-drive layout.
pub fn drives(count: u8) -> Vec<NodePlan> {
    let drive = |raw| {
        let pdos = layout::per_drive(node(raw), Some(5));
        let emcy_cob_id = 0x80 + u16::from(raw);
        NodePlan { node: node(raw), pdos, emcy_cob_id, ..elbow() }
    };
    (1..=count).map(drive).collect()
}

/// Six drives in two groups and the switch box, with heartbeats every 100 ms.
pub fn grouped() -> Vec<NodePlan> {
    let nodes: Vec<NodeId> = (1..=6).map(node).collect();
    let group = |(place, plan): (usize, NodePlan)| {
        let group = layout::Group::threes(&nodes)[place];
        NodePlan { pdos: layout::grouped(plan.node, place, group, Some(5)), ..plan }
    };
    let drives = drives(6).into_iter().enumerate().map(group);
    let plans = drives.chain([switch_box()]);
    let error_control = |plan: &NodePlan| ErrorControl::Heartbeat {
        period_ms: 100,
        lost_after: plan.error_control.lost_after(),
    };
    plans.map(|plan| NodePlan { error_control: error_control(&plan), ..plan }).collect()
}

/// Bus of `plans` at 1 Mbit/s with a limit of 90 %, whose drives permit every change.
pub fn network(plans: Vec<NodePlan>, period_us: u32) -> Network {
    let member = |plan| Member {
        plan,
        abilities: Abilities { no_group: Vec::new(), moves_emergencies: true },
    };
    let bus = Bus {
        name: "joints".into(),
        bitrate: 1_000_000,
        load_limit_percent: 90.0,
        members: plans.into_iter().map(member).collect(),
    };
    Network { period_us, master: master(), master_heartbeat_ms: 5, buses: vec![bus] }
}

/// Pauses of [`worst_timeline`].
pub const PAUSES: Pauses = Pauses { drive_us: 100, host_us: 60 };

/// Timeline of `planned` at 1 Mbit/s with maximum bit stuffing; other frames take 135 µs.
pub fn worst_timeline(planned: &[Stream]) -> Timeline {
    Timeline::new(planned, |stream| f64::from(stream.worst_bits()), 135.0, PAUSES)
}

/// Two drives' network, and assumptions whose pauses and gaps all are `gap_us`, without a check of any figure.
pub fn with_figures(
    period_us: u32,
    bitrate: u32,
    heartbeat_ms: u16,
    load_limit_percent: f64,
    gap_us: u32,
) -> (Network, Assumptions) {
    let mut network = network(drives(2), period_us);
    network.master_heartbeat_ms = heartbeat_ms;
    network.buses[0].bitrate = bitrate;
    network.buses[0].load_limit_percent = load_limit_percent;
    let assumed = Assumptions {
        pauses: Pauses { drive_us: gap_us, host_us: gap_us },
        emergency_gap_us: gap_us,
        sdo_gap_us: gap_us,
        error_gap_us: Some(gap_us),
    };
    (network, assumed)
}

pub fn six_drives_and_switches() -> Vec<NodePlan> {
    let mut plans = drives(6);
    plans.push(switch_box());
    plans
}
