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

mod arm;
mod bodies;
mod boot;
mod bus_plan;
mod buses;
mod control;
mod devices;
mod extensions;
pub mod files;
pub mod force_cap;
mod gain_check;
mod interpretation;
mod joint_plant;
mod joints;
mod loads;
mod lookup;
mod names;
mod operator;
mod parameters;
mod plans;
mod plant;
mod plausibility;
mod problem;
mod protection;
mod raw;
mod remote;
mod safety;
pub mod shipped;
mod simulated;
mod start;
mod switch_box;
pub mod switch_inputs;
pub mod torque_data;
pub mod trust;
mod units;

pub use boot::BootSettings;
pub use buses::BusSettings;
pub use buses::Layout;
pub use joints::JointParameters;
pub use operator::Operator;
pub use parameters::Parameters;
pub use plant::Actuator;
pub use plant::Drivetrain;
pub use plant::Friction;
pub use plant::JointPlant;
pub use plant::Plant;
pub use plausibility::Plausibility;
pub use problem::Invalid;
pub use problem::Problem;
pub use protection::grain;
pub use safety::Protection;
pub use safety::Safety;
pub use switch_box::SwitchBox;

use std::ops::Deref;
use std::path::Path;
use std::path::PathBuf;
use std::time::Duration;

use crate::problem::Problems;
use crate::trust::Trust;
use ::remote::site::Virtual;
use canopen::exchange::Exchange;
use canopen::frame::Channel;
use controller::Settings;

/// One hand controller and all around it: the values of a file, and the cyclic exchange that follows from them.
///
/// The values cannot be changed in place: the exchange must stay that of the values.
#[derive(Clone, Debug)]
pub struct Config {
    parameters: Parameters,
    exchange: Exchange,
}

impl Deref for Config {
    type Target = Parameters;

    fn deref(&self) -> &Parameters {
        &self.parameters
    }
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
        Self::checked(file, &files::text(trust, file)?, trust, loads::check)
    }

    /// Checks `text`, which stands in `file`; names of other files are seen from there.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn parse(file: &Path, text: &str) -> Result<Self, Invalid> {
        Self::checked(file, text, Trust::Any, loads::check)
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
        check: fn(&Parameters, &mut Problems<'_>),
    ) -> Result<Self, Invalid> {
        let mut problems = Problems::new(file, text, trust);
        let Some(raw) = read(text, &mut problems) else {
            problems.finish()?;
            return Err(Invalid(Vec::new()));
        };
        let converted = convert(file, &raw, &mut problems);
        // A load that follows from a period or bit rate that is wrong says nothing.
        if !problems.is_noted("bus[") && !problems.is_noted("node.") {
            converted.iter().for_each(|(parameters, _)| check(parameters, &mut problems));
        }
        problems.finish()?;
        // Without a problem there is a value: every missing one was noted where it went missing.
        let config = converted
            .and_then(|(parameters, exchange)| Some(Self { parameters, exchange: exchange? }));
        config.ok_or_else(|| Invalid(Vec::new()))
    }

    /// The same with another controller: no PDO depends on it.
    #[must_use]
    pub fn with_controller(mut self, controller: Settings) -> Self {
        self.parameters.controller = controller;
        self
    }

    /// The same with another commanded side: no PDO depends on it.
    #[must_use]
    pub fn with_remote(mut self, remote: Virtual) -> Self {
        self.parameters.remote = remote;
        self
    }

    /// The same with every drive's proof at bring-up, whatever the file says: no PDO depends on it.
    #[must_use]
    pub const fn with_proof(mut self) -> Self {
        self.parameters.safety.protection.proves_drives = true;
        self
    }

    /// How long after a SYNC samples are waited for: what a period leaves when the RPDOs that must be
    /// there before the next SYNC are taken off.
    pub fn window(&self) -> Duration {
        self.period.saturating_sub(loads::rpdo_time(self, &self.exchange.outbox))
    }

    /// Returns which bits of which frame are whose, as resolved when the file was read.
    pub const fn exchange(&self) -> &Exchange {
        &self.exchange
    }

    /// The most frames that the node sends in one cycle on each bus, in the order of the channels: SYNC, targets, all
    /// controlwords, heartbeat, TIME and one request. Never less than a boot sends at once: two frames for each node and
    /// two for all.
    pub fn bursts(&self) -> Vec<u32> {
        let outbox = &self.exchange.outbox;
        let plans = self.node_plans();
        let at_boot = |channel: Channel| {
            let nodes = plans.iter().filter(|(on, _)| *on == channel).count();
            u32::try_from(2 * nodes + 2).unwrap_or(u32::MAX)
        };
        let others = 3 + u32::from(self.time_period.is_some());
        let channels = self.channels().into_iter();
        channels.map(|channel| (outbox.frames_on(channel) + others).max(at_boot(channel))).collect()
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
fn convert(
    file: &Path,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<(Parameters, Option<Exchange>)> {
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

    let buses = buses::read(raw, problems);
    let safety = safety::read(raw, period, problems);
    let plausibility = plausibility::read(&raw.safety, problems);
    let joints = joints::read(file, raw, problems);
    let switches = switch_box::read(file, raw, problems);
    let (x_6_g, gravity) = arm::grip_and_gravity(&raw.arm, problems);
    let controller = joints
        .as_ref()
        .and_then(|joints| control::settings(raw, joints, &x_6_g, gravity, period, problems));
    let command_mode = control::mode(raw, problems);
    let operator = operator::read(&raw.operator, problems);
    let refuses = gain_check::refuses(raw, problems);
    let remote = remote::settings(raw, problems);

    let config = Parameters {
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
    let exchange = devices::check(&config, problems);
    start::check(&config, problems);
    protection::check(&config, problems);
    gain_check::check(&config, refuses, problems);
    Some((config, exchange))
}
