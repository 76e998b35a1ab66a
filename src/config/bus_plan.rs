//! The configured network as the bus planner takes it: every node with its plan, what its EDS permits, and what its
//! values are while the arm is in use.

use nalgebra::SVector;

use crate::buses::BusSettings;
use crate::parameters::Parameters;
use canopen::frame::Channel;
use canopen::load::abilities::Abilities;
use canopen::load::network::{Bus, Member, Network};
use canopen::load::payload::Signals;
use canopen::plan::NodePlan;

/// A joint in use moves so much of its range to either side of where it starts.
const TRAVEL: f64 = 0.05;

/// And its torque so much of what it may be to either side of gravity's.
const EFFORT: f64 = 0.15;

impl Parameters {
    /// The network as the bus planner takes it.
    pub fn network(&self) -> Network {
        let signals = signals(self);
        let buses = (0..).map(Channel).zip(&self.buses);
        let bus = |(channel, bus): (Channel, &BusSettings)| Bus {
            name: bus.name.clone(),
            bitrate: bus.bitrate,
            load_limit_percent: bus.load_limit_percent,
            members: members(self, channel, &signals),
        };
        Network {
            period_us: self.period_us(),
            master: self.node_id,
            master_heartbeat_ms: self.heartbeat_ms(),
            buses: buses.map(bus).collect(),
        }
    }
}

/// The nodes on one bus.
fn members(config: &Parameters, channel: Channel, signals: &[Signals; 6]) -> Vec<Member> {
    let here = config.node_plans().into_iter().filter(|(place, _)| *place == channel);
    let member = |plan: NodePlan| {
        let eds = config.eds_of(channel, plan.node)?;
        let mut joints = config.joints.iter().zip(signals);
        let joint = joints.find(|(joint, _)| (joint.channel, joint.node) == (channel, plan.node));
        Some(Member {
            abilities: Abilities::of(eds, plan.node),
            signals: joint.map(|(_, signals)| *signals).unwrap_or_default(),
            plan,
        })
    };
    here.filter_map(|(_, plan)| member(plan)).collect()
}

/// Typical values that each joint's drive sends and receives: near the start, holding the arm up.
fn signals(config: &Parameters) -> [Signals; 6] {
    let controller = &config.controller;
    let q = SVector::from(config.joints.each_ref().map(|joint| joint.plant.start));
    let tau = controller.arm.gravity(&controller.arm.posture(&q));
    let homes = controller.calibration.counts(&q).map(|counts| counts.0);
    let holding = controller.calibration.targets(&tau).map(|target| target.0);
    std::array::from_fn(|place| {
        let joint = config.joints.get(place);
        let [low, high] = joint.map_or([0.0, 0.0], |joint| joint.plant.link.range);
        let quantum = joint.map_or(1.0, |joint| joint.calibration.quantum());
        let most = joint.map_or(0, |joint| joint.calibration.max_target().0.unsigned_abs());
        Signals {
            home: homes.get(place).copied().unwrap_or_default(),
            travel: whole(TRAVEL * (high - low) / quantum),
            holding: holding.get(place).copied().unwrap_or_default(),
            effort: u16::try_from(whole(EFFORT * f64::from(most))).unwrap_or(u16::MAX),
        }
    })
}

/// The whole number nearest to one that is not negative.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the range of u32 first; NaN becomes zero"
)]
fn whole(number: f64) -> u32 {
    number.round().clamp(0.0, f64::from(u32::MAX)) as u32
}
