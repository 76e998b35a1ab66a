//! TOML to values that cannot be wrong. Every problem of a file is found in one run and says file,
//! line and key; afterwards nothing is checked again.
//!
//! ```
//! use std::path::Path;
//! use config::Config;
//!
//! // The shipped configurations are known without their files.
//! let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
//! assert_eq!(config.period.as_micros(), 1_000);
//!
//! let invalid = Config::parse(Path::new("mine.toml"), "[node]\nperiod_ms = 1").unwrap_err();
//! assert!(invalid.to_string().contains("mine.toml"));
//! ```
#![forbid(unsafe_code)]

mod beyond;
mod bodies;
mod boot;
mod bus_plan;
mod control;
pub mod files;
pub mod force_cap;
mod gain_check;
mod joints;
mod lookup;
mod names;
mod network;
mod plausibility;
mod problem;
mod protection;
mod raw;
mod readings;
mod remote;
pub mod shipped;
mod simulated;
pub mod torque_data;
pub mod trust;
mod units;

pub use boot::BootSettings;
pub use gain_check::Operator;
pub use joints::Joint;
pub use network::BusSettings;
pub use network::Layout;
pub use network::SwitchBox;
pub use plausibility::Plausibility;
pub use problem::Invalid;
pub use problem::Problem;
pub use protection::Protection;
pub use protection::grain;
pub use simulated::Simulated;

use std::path::Path;
use std::path::PathBuf;
use std::time::Duration;

use nalgebra::Isometry3;

use crate::problem::Problems;
use crate::trust::Trust;
use canopen::NodeId;
use canopen::bits;
use canopen::exchange;
use canopen::exchange::Inbox;
use canopen::exchange::Outbox;
use canopen::frame::Channel;
use canopen::listening;
use canopen::listening::Pattern;
use canopen::load::BusLoad;
use canopen::load::network::Network;
use canopen::plan::NodePlan;
use controller::Settings;
use controller::stability::finding::Finding;
use controller::switches::Mode;

/// One hand controller and all around it.
#[derive(Clone, Debug)]
pub struct Config {
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

impl Config {
    /// Reads and checks a file; `config/kraft_like.toml` and its like are known without one.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn load(file: &Path) -> Result<Self, Invalid> {
        Self::load_by(Trust::Any, file)
    }

    /// The same of a file, and EDS files, that must be worth that trust.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn load_by(trust: Trust, file: &Path) -> Result<Self, Invalid> {
        Self::checked(file, &files::text(trust, file)?, trust, network::check_loads)
    }

    /// Checks `text`, which stands in `file`; names of other files are seen from there.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn parse(file: &Path, text: &str) -> Result<Self, Invalid> {
        Self::checked(file, text, Trust::Any, network::check_loads)
    }

    /// As [`load`](Self::load), but buses may carry too much. Only for planning: such a network cannot
    /// run.
    ///
    /// # Errors
    /// Everything else that is wrong with it.
    pub fn load_to_plan(file: &Path) -> Result<Self, Invalid> {
        Self::checked(file, &files::text(Trust::Any, file)?, Trust::Any, |_, _| {})
    }

    /// `text` as a configuration that also passes `check`.
    fn checked(
        file: &Path,
        text: &str,
        trust: Trust,
        check: fn(&Self, &mut Problems<'_>),
    ) -> Result<Self, Invalid> {
        let mut problems = Problems::new(file, text, trust);
        let Some(raw) = read(text, &mut problems) else {
            problems.finish()?;
            return Err(Invalid(Vec::new()));
        };
        let config = convert(file, &raw, &mut problems);
        // A load that follows from a period or bit rate that is wrong says nothing.
        if !problems.is_noted("bus[") && !problems.is_noted("node.") {
            config.iter().for_each(|config| check(config, &mut problems));
        }
        problems.finish()?;
        // Without a problem there is a value: every missing one was noted where it went missing.
        config.ok_or_else(|| Invalid(Vec::new()))
    }

    /// A joint by its name or its number, the base's being 1.
    pub fn joint(&self, called: &str) -> Option<&Joint> {
        let place = called.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
        let named = self.joints.iter().find(|joint| joint.name == called);
        named.or_else(|| self.joints.get(place?))
    }

    /// The buses, as the frames' channels.
    pub fn channels(&self) -> Vec<Channel> {
        (0..).zip(&self.buses).map(|(place, _)| Channel(place)).collect()
    }

    /// How long after a SYNC samples are waited for: what a period leaves when the RPDOs that must be
    /// there before the next SYNC are taken off.
    pub fn window(&self) -> Duration {
        self.period.saturating_sub(network::rpdo_time(self))
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

    /// Which bits of which frame are whose. Layouts that contradict each other are a problem of the
    /// file and so never get here.
    pub fn exchange(&self) -> (Inbox, Outbox) {
        exchange::resolve(&self.node_plans()).unwrap_or_default()
    }

    /// The most frames that the node sends in one cycle on each bus, in the order of the channels: SYNC, targets, all
    /// controlwords, heartbeat, TIME and one request. Never less than a boot sends at once: two frames for each node and
    /// two for all.
    pub fn bursts(&self) -> Vec<u32> {
        let (_, outbox) = self.exchange();
        let plans = self.node_plans();
        let at_boot = |channel: Channel| {
            let nodes = plans.iter().filter(|(on, _)| *on == channel).count();
            u32::try_from(2 * nodes + 2).unwrap_or(u32::MAX)
        };
        let others = 3 + u32::from(self.time_period.is_some());
        let channels = self.channels().into_iter();
        channels.map(|channel| (outbox.frames_on(channel) + others).max(at_boot(channel))).collect()
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

/// Types and keys: `None` when the text is no such file at all.
fn read(text: &str, problems: &mut Problems<'_>) -> Option<raw::File> {
    let deserializer = toml::Deserializer::parse(text);
    let deserializer = deserializer
        .map_err(|error| problems.add_at(error.span().map(|span| span.start), error.message()))
        .ok()?;
    let mut unknown = Vec::new();
    let read = serde_ignored::deserialize(deserializer, |path| unknown.push(path.to_string()));
    for path in unknown {
        problems.add(&in_brackets(&path), "unknown key");
    }
    let refused = |error: toml::de::Error| {
        let place = error.span().map(|span| span.start);
        problems.add_at(place, error.message());
    };
    read.map_err(refused).ok()
}

/// `joint.2.name` as `joint[2].name`; the `?` of an optional section is none of the file's.
fn in_brackets(path: &str) -> String {
    let mut key = String::new();
    for part in path.split('.').filter(|part| *part != "?") {
        if part.bytes().all(|byte| byte.is_ascii_digit()) {
            key.push_str(&format!("[{part}]"));
        } else {
            if !key.is_empty() {
                key.push('.');
            }
            key.push_str(part);
        }
    }
    key
}

/// Meanings. `None` only where a problem has been noted.
fn convert(file: &Path, raw: &raw::File, problems: &mut Problems<'_>) -> Option<Config> {
    let period_us = problems.within("node.sync_period_us", raw.node.sync_period_us, 250..=100_000);
    let period = Duration::from_micros(period_us);
    let node_id = lookup::node_id("node.node_id", raw.node.node_id, problems);
    problems.within("node.heartbeat_ms", raw.node.heartbeat_ms, 1..=1_000);

    let sync_counter = raw.node.sync_counter;
    let sync_counter = sync_counter.map(|last| problems.within("node.sync_counter", last, 2..=240));
    let time_period = raw.node.time_period_ms.map(|period| {
        let millis = problems.within("node.time_period_ms", period, 10..=3_600_000);
        Duration::from_millis(u64::from(millis))
    });

    let buses = network::buses(raw, problems);
    let safety = network::safety(raw, period, problems);
    let plausibility = plausibility::read(&raw.safety, problems);
    let joints = joints::joints(file, raw, problems);
    let switches = network::switch_box(file, raw, problems);
    let (x_6_g, gravity) = joints::grip_and_gravity(&raw.arm, problems);
    let controller = joints
        .as_ref()
        .and_then(|joints| control::settings(raw, joints, &x_6_g, gravity, period, problems));
    let command_mode = control::mode(raw, problems);
    let operator = gain_check::operator(&raw.operator, problems);
    let refuses = gain_check::refuses(raw, problems);
    let remote = remote::settings(raw, problems);

    let config = Config {
        file: file.to_path_buf(),
        period,
        node_id: node_id?,
        heartbeat: Duration::from_millis(u64::from(raw.node.heartbeat_ms)),
        sync_counter,
        time_period,
        socket: raw.node.socket.as_ref().map(PathBuf::from),
        stores_configuration: raw.node.store_configuration,
        restores_defaults: raw.node.restore_defaults,
        buses,
        joints: joints?,
        x_6_g,
        gravity,
        switches: switches?,
        controller: controller?,
        command_mode: command_mode?,
        operator,
        remote: remote?,
        safety,
        plausibility,
    };
    network::check(&config, problems);
    bodies::check_start(&config, problems);
    protection::check(&config, problems);
    gain_check::check(&config, refuses, problems);
    Some(config)
}
