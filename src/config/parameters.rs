//! Checked values of a configuration file, before their cyclic PDO exchange is resolved.

use controller::contact_posture::PostureBounds;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use nalgebra::Isometry3;

use crate::buses::BusSettings;
use crate::far_side::FarSide;
use crate::joints::JointParameters;
use crate::link::RemoteLink;
use crate::operator::OperatorImpedance;
use crate::plant::Plant;
use crate::plausibility::Plausibility;
use crate::robots::RobotArm;
use crate::safety::Safety;
use crate::switch_box::{NoSwitchBox, SwitchBox};
use canopen::eds::{Eds, Finding};
use canopen::frame::Channel;
use canopen::{NodeId, bits};
use controller::Settings;
use controller::switches::CommandMode;
use remote::site::Virtual;
use units::numbering::Joint;

/// Values of a configuration file: hand controller, network, commanded side and limits.
#[derive(Clone, Debug)]
pub struct Parameters {
    /// Path of the configuration file.
    pub file: PathBuf,
    /// Communication cycle period (1006h).
    pub period: Duration,
    /// Node-id of the master, for its heartbeat.
    pub node_id: NodeId,
    /// Producer heartbeat time of the master (CiA 301, compare 1017h).
    pub heartbeat: Duration,
    /// SYNC counter overflow value (1019h), if SYNCs are counted.
    pub sync_counter: Option<u8>,
    /// Period of the TIME message, if it is sent.
    pub time_period: Option<Duration>,
    /// Path of the control socket, if configured.
    pub socket: Option<PathBuf>,
    /// Path of the telemetry socket, if configured.
    pub telemetry_socket: Option<PathBuf>,
    /// Stores the configuration in the nodes (1010h).
    pub stores_configuration: bool,
    /// Restores the nodes' defaults (1011h) before configuration.
    pub restores_defaults: bool,
    /// Buses; a [`Channel`] is an index into this list.
    pub buses: Vec<BusSettings>,
    /// EDS files of all nodes, without repetition.
    pub eds_files: Vec<EdsFile>,
    /// Joints, base first.
    pub joints: [JointParameters; 6],
    /// Pose of the grip in the last link.
    pub x_6_g: Isometry3<f64>,
    /// Gravity in {0}, in m/s².
    pub gravity: [f64; 3],
    /// Bounds of singular values and friction in contact postures.
    pub contact_bounds: PostureBounds,
    /// Switch box, which arming requires.
    pub switches: Option<SwitchBox>,
    /// Arm, calibration, gains, limits and extensions of the controller.
    pub controller: Settings,
    /// Command mode at the start: rate or pose.
    pub command_mode: CommandMode,
    /// Impedance of the hand for the stability checks.
    pub operator: OperatorImpedance,
    /// Virtual object and scene of the commanded side.
    pub remote: Virtual,
    /// Arm that holds the commanded object, from its robot file.
    pub robot: Option<RobotArm>,
    /// Link to the commanded side.
    pub link: RemoteLink,
    /// Robot in another process.
    pub far_side: FarSide,
    /// Time limits of faults, and ramps.
    pub safety: Safety,
    /// Bounds of plausible samples.
    pub plausibility: Plausibility,
}

/// EDS file, with findings that do not prevent its use.
#[derive(Clone, Debug)]
pub struct EdsFile {
    /// Path, relative to the current folder.
    pub path: PathBuf,
    /// Parsed content.
    pub eds: Arc<Eds>,
    /// Number of errors, including gaps.
    pub errors: usize,
    /// Objects and parts that the file lists but does not describe, and that no plan uses.
    pub gaps: Vec<Finding>,
}

impl Parameters {
    /// Returns a joint by its name, or by its number from 1 at the base.
    pub fn joint(&self, called: &str) -> Option<&JointParameters> {
        let number = called.parse::<u8>().ok().and_then(Joint::new);
        let named = self.joints.iter().find(|joint| joint.name == called);
        named.or_else(|| self.joints.get(number?.index()))
    }

    /// Returns the switch box, without which nothing can be armed.
    ///
    /// # Errors
    /// When no switch box is configured.
    pub fn switch_box(&self) -> Result<&SwitchBox, NoSwitchBox> {
        self.switches.as_ref().ok_or(NoSwitchBox)
    }

    /// Returns names and EDS of all nodes, in the order of their plans.
    pub fn data_sheets(&self) -> impl Iterator<Item = (&str, &Arc<Eds>)> {
        let joints = self.joints.iter().map(|joint| (joint.name.as_str(), &joint.eds));
        joints.chain(self.switches.iter().map(|switches| ("switch box", &switches.eds)))
    }

    /// Returns the EDS of a node; `None` if no plan has this node on this bus.
    pub fn eds_of(&self, channel: Channel, node: NodeId) -> Option<&Eds> {
        let is_it = |one: (Channel, NodeId)| one == (channel, node);
        let joint = self.joints.iter().find(|joint| is_it((joint.channel, joint.node)));
        let switches =
            self.switches.iter().find(|switches| is_it((switches.channel, switches.node)));
        joint.map(|joint| &*joint.eds).or_else(|| switches.map(|switches| &*switches.eds))
    }

    /// Returns the plant model of the arm, for a simulation.
    pub fn plant(&self) -> Plant {
        Plant {
            joints: self.joints.each_ref().map(|joint| joint.plant),
            x_6_g: self.x_6_g,
            gravity: self.gravity,
            coupling: *self.controller.calibration.coupling(),
        }
    }

    /// Returns the channels of all buses.
    pub fn channels(&self) -> Vec<Channel> {
        (0..).zip(&self.buses).map(|(place, _)| Channel(place)).collect()
    }

    /// Returns the transmission time of the longest frame on the slowest bus, with worst-case stuffing.
    pub fn longest_frame(&self) -> Duration {
        let bitrate = self.buses.iter().map(|bus| bus.bitrate).min().unwrap_or(1);
        Duration::from_secs(1) * bits::worst_case(8) / bitrate.max(1)
    }

    /// Returns the maximum number of frames that all buses together carry in `periods` periods.
    pub fn most_frames(&self, periods: u64) -> u64 {
        let micros = u64::try_from(self.period.as_micros()).unwrap_or(u64::MAX);
        let bitrate: u64 = self.buses.iter().map(|bus| u64::from(bus.bitrate)).sum();
        let bits = bitrate.saturating_mul(micros) / 1_000_000;
        bits.div_ceil(bits::unstuffed(0).into()).saturating_mul(periods)
    }

    /// Returns the communication cycle period (1006h), in µs.
    pub(super) fn period_us(&self) -> u32 {
        u32::try_from(self.period.as_micros()).unwrap_or(u32::MAX)
    }

    /// Returns the producer heartbeat time of the master, in ms.
    pub(super) fn heartbeat_ms(&self) -> u16 {
        u16::try_from(self.heartbeat.as_millis()).unwrap_or(u16::MAX)
    }
}
