//! Values of a configuration file, checked, but not yet resolved into a cyclic exchange.

use controller::contact_posture::PostureBounds;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use nalgebra::Isometry3;

use crate::buses::BusSettings;
use crate::far_side::FarSide;
use crate::joints::JointParameters;
use crate::link::RemoteLink;
use crate::operator::Operator;
use crate::plant::Plant;
use crate::plausibility::Plausibility;
use crate::robots::RobotArm;
use crate::safety::Safety;
use crate::switch_box::{NoSwitchBox, SwitchBox};
use canopen::eds::{Eds, Finding};
use canopen::frame::Channel;
use canopen::{NodeId, bits};
use controller::Settings;
use controller::switches::Mode;
use remote::site::Virtual;
use units::numbering::Joint;

/// Values of a configuration file: one hand controller and all around it.
#[derive(Clone, Debug)]
pub struct Parameters {
    /// File it was read from.
    pub file: PathBuf,
    /// Communication cycle period (1006h).
    pub period: Duration,
    /// The master's own node-id, for its heartbeat.
    pub node_id: NodeId,
    /// Period of the master's heartbeat.
    pub heartbeat: Duration,
    /// SYNC counter overflow value (1019h), if SYNCs are counted.
    pub sync_counter: Option<u8>,
    /// Period of TIME, if it is sent.
    pub time_period: Option<Duration>,
    /// Path of the control socket, if configured.
    pub socket: Option<PathBuf>,
    /// Path of the telemetry's socket, if configured.
    pub telemetry_socket: Option<PathBuf>,
    /// Stores the configuration in the nodes (1010h).
    pub stores_configuration: bool,
    /// Restores the nodes' defaults (1011h) before configuration.
    pub restores_defaults: bool,
    /// The buses; a [`Channel`] is a place in this list.
    pub buses: Vec<BusSettings>,
    /// EDS files of all nodes, each once.
    pub eds_files: Vec<EdsFile>,
    /// The joints, base first.
    pub joints: [JointParameters; 6],
    /// Pose of the grip in the last link.
    pub x_6_g: Isometry3<f64>,
    /// Gravity in {0}, in m/s².
    pub gravity: [f64; 3],
    /// Bounds of postures in which contact is rendered well.
    pub contact_bounds: PostureBounds,
    /// The switch box; without it nothing can be armed.
    pub switches: Option<SwitchBox>,
    /// The controller.
    pub controller: Settings,
    /// Meaning of a displacement of the hand at the start.
    pub command_mode: Mode,
    /// Impedance of the hand for the stability checks.
    pub operator: Operator,
    /// The commanded side.
    pub remote: Virtual,
    /// The arm that holds the commanded object, as its file describes it.
    pub robot: Option<RobotArm>,
    /// Link to the commanded side.
    pub link: RemoteLink,
    /// Far side in another process.
    pub far_side: FarSide,
    /// Time limits of faults.
    pub safety: Safety,
    /// Bounds of plausible samples.
    pub plausibility: Plausibility,
}

/// Findings in an EDS file that do not keep it from being used.
#[derive(Clone, Debug)]
pub struct EdsFile {
    /// Path, from the current folder.
    pub path: PathBuf,
    /// Its content.
    pub eds: Arc<Eds>,
    /// Number of errors, missing parts included.
    pub errors: usize,
    /// Missing parts that the file announces, and no plan uses.
    pub gaps: Vec<Finding>,
}

impl Parameters {
    /// A joint by its name or its number, the base's being 1.
    pub fn joint(&self, called: &str) -> Option<&JointParameters> {
        let number = called.parse::<u8>().ok().and_then(Joint::new);
        let named = self.joints.iter().find(|joint| joint.name == called);
        named.or_else(|| self.joints.get(number?.index()))
    }

    /// Returns the switch box, without which nothing can be armed.
    ///
    /// # Errors
    /// When the configuration has none.
    pub fn switch_box(&self) -> Result<&SwitchBox, NoSwitchBox> {
        self.switches.as_ref().ok_or(NoSwitchBox)
    }

    /// The names and data sheets of all nodes, in the order of their plans.
    pub fn data_sheets(&self) -> impl Iterator<Item = (&str, &Arc<Eds>)> {
        let joints = self.joints.iter().map(|joint| (joint.name.as_str(), &joint.eds));
        joints.chain(self.switches.iter().map(|switches| ("switch box", &switches.eds)))
    }

    /// The data sheet of a node.
    pub fn eds_of(&self, channel: Channel, node: NodeId) -> Option<&Eds> {
        let is_it = |one: (Channel, NodeId)| one == (channel, node);
        let joint = self.joints.iter().find(|joint| is_it((joint.channel, joint.node)));
        let switches =
            self.switches.iter().find(|switches| is_it((switches.channel, switches.node)));
        joint.map(|joint| &*joint.eds).or_else(|| switches.map(|switches| &*switches.eds))
    }

    /// The arm as it is built, for a simulation.
    pub fn plant(&self) -> Plant {
        Plant {
            joints: self.joints.each_ref().map(|joint| joint.plant),
            x_6_g: self.x_6_g,
            gravity: self.gravity,
            coupling: *self.controller.calibration.coupling(),
        }
    }

    /// The buses, as the frames' channels.
    pub fn channels(&self) -> Vec<Channel> {
        (0..).zip(&self.buses).map(|(place, _)| Channel(place)).collect()
    }

    /// Time of the longest frame on the slowest bus.
    pub fn longest_frame(&self) -> Duration {
        let bitrate = self.buses.iter().map(|bus| bus.bitrate).min().unwrap_or(1);
        Duration::from_secs(1) * bits::worst_case(8) / bitrate.max(1)
    }

    /// Maximum number of frames that all buses together carry in so many periods.
    pub fn most_frames(&self, periods: u64) -> u64 {
        let micros = u64::try_from(self.period.as_micros()).unwrap_or(u64::MAX);
        let bitrate: u64 = self.buses.iter().map(|bus| u64::from(bus.bitrate)).sum();
        let bits = bitrate.saturating_mul(micros) / 1_000_000;
        bits.div_ceil(bits::unstuffed(0).into()).saturating_mul(periods)
    }

    /// From SYNC to SYNC, in µs.
    pub(super) fn period_us(&self) -> u32 {
        u32::try_from(self.period.as_micros()).unwrap_or(u32::MAX)
    }

    /// From one heartbeat of the master to the next, in ms.
    pub(super) fn heartbeat_ms(&self) -> u16 {
        u16::try_from(self.heartbeat.as_millis()).unwrap_or(u16::MAX)
    }
}
