//! Values of a configuration file, checked, but not yet resolved into a cyclic exchange.

use std::path::PathBuf;
use std::time::Duration;

use nalgebra::Isometry3;

use crate::BusSettings;
use crate::Joint;
use crate::Operator;
use crate::Plausibility;
use crate::Protection;
use crate::SwitchBox;
use crate::bus_plan;
use crate::gain_check;
use crate::network;
use canopen::NodeId;
use canopen::bits;
use canopen::frame::Channel;
use canopen::listening;
use canopen::listening::Pattern;
use canopen::load::BusLoad;
use canopen::load::network::Network;
use canopen::plan::NodePlan;
use controller::Settings;
use controller::stability::finding::Finding;
use controller::switches::Mode;
use units::numbering::Joint as JointNumber;

/// Values of a configuration file: one hand controller and all around it.
#[derive(Clone, Debug)]
pub struct Parameters {
    /// Where it was read.
    pub file: PathBuf,
    /// From SYNC to SYNC.
    pub period: Duration,
    /// The master's own node-id, for its heartbeat.
    pub node_id: NodeId,
    /// How often the master's heartbeat is sent.
    pub heartbeat: Duration,
    /// Up to what SYNCs are counted (1019h), if they are.
    pub sync_counter: Option<u8>,
    /// How often TIME is told, if it is.
    pub time_period: Option<Duration>,
    /// Where the control socket is, if the file says so.
    pub socket: Option<PathBuf>,
    /// Whether nodes are told to store what is set in them.
    pub stores_configuration: bool,
    /// Whether nodes get their makers' defaults back before they are configured.
    pub restores_defaults: bool,
    /// The buses; a [`Channel`] is a place in this list.
    pub buses: Vec<BusSettings>,
    /// The joints, base first.
    pub joints: [Joint; 6],
    /// Pose of the grip in the last link.
    pub x_6_g: Isometry3<f64>,
    /// Gravity in {0}, in m/s².
    pub gravity: [f64; 3],
    /// The switch box.
    pub switches: SwitchBox,
    /// The controller.
    pub controller: Settings,
    /// What a displacement of the hand means at the start.
    pub command_mode: Mode,
    /// Whose hand the gains are judged with.
    pub operator: Operator,
    /// The commanded side.
    pub remote: ::remote::site::Virtual,
    /// Limits in time.
    pub safety: Safety,
    /// What samples may be before they are not believed.
    pub plausibility: Plausibility,
}

/// How long what may last before torque goes off.
#[derive(Clone, Copy, Debug)]
pub struct Safety {
    /// A drive without a fresh RPDO; 0 where only the heartbeat is to stop it.
    pub rpdo_timer_ms: u16,
    /// A drive without the master's heartbeat.
    pub node_lost_ms: u16,
    /// How often drives send their heartbeat.
    pub drive_heartbeat_ms: u16,
    /// The master without a node's heartbeat.
    pub drive_lost: Duration,
    /// Cycles in a row without a joint's sample.
    pub missing_samples: u32,
    /// Gravity compensation from zero to full.
    pub gravity_ramp: Duration,
    /// Reflection from zero to full.
    pub reflection_ramp: Duration,
    /// What the drives do by themselves.
    pub protection: Protection,
}

impl Parameters {
    /// A joint by its name or its number, the base's being 1.
    pub fn joint(&self, called: &str) -> Option<&Joint> {
        let number = called.parse::<u8>().ok().and_then(JointNumber::new);
        let named = self.joints.iter().find(|joint| joint.name == called);
        named.or_else(|| self.joints.get(number?.index()))
    }

    /// The buses, as the frames' channels.
    pub fn channels(&self) -> Vec<Channel> {
        (0..).zip(&self.buses).map(|(place, _)| Channel(place)).collect()
    }

    /// How often the commanded side is sampled.
    pub const fn link_period(&self) -> Duration {
        self.period
    }

    /// How long the longest frame takes on the slowest bus.
    pub fn longest_frame(&self) -> Duration {
        let bitrate = self.buses.iter().map(|bus| bus.bitrate).min().unwrap_or(1);
        Duration::from_secs(1) * bits::worst_case(8) / bitrate.max(1)
    }

    /// How many frames all buses together can carry in so many periods, at the most.
    pub fn most_frames(&self, periods: u64) -> u64 {
        let micros = u64::try_from(self.period.as_micros()).unwrap_or(u64::MAX);
        let bitrate: u64 = self.buses.iter().map(|bus| u64::from(bus.bitrate)).sum();
        let bits = bitrate.saturating_mul(micros) / 1_000_000;
        bits.div_ceil(bits::unstuffed(0).into()).saturating_mul(periods)
    }

    /// What every node is to be and to be told, in the order of the joints, then the switch box.
    pub fn node_plans(&self) -> Vec<(Channel, NodePlan)> {
        network::plans(self)
    }

    /// What a master must hear of each bus, in the order of the channels.
    pub fn patterns(&self) -> Vec<Vec<Pattern>> {
        let plans = self.node_plans();
        self.channels().into_iter().map(|channel| listening::patterns(channel, &plans)).collect()
    }

    /// What is to be said of the gains: every inequality of every axis, held or not.
    pub fn findings(&self) -> Vec<Finding> {
        gain_check::findings(self)
    }

    /// The network as the bus planner takes it.
    pub fn network(&self) -> Network {
        bus_plan::network(self)
    }

    /// The load of each bus in the worst case.
    pub fn loads(&self) -> Vec<BusLoad> {
        network::loads(self)
    }
}
