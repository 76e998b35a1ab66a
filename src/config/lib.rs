//! Configuration files (TOML), parsed into values that are valid by construction.
//!
//! One run finds every problem of a file, with file, line and key. Other crates trust the values without further checks.
//!
//! | to read about | begin at |
//! |---|---|
//! | the keys and their types | `raw.rs`, `raw_robot.rs`, `raw_gripper.rs` |
//! | a section: range and value of its keys | the file of its name: `control.rs`, `joints.rs`, `safety.rs`, … |
//! | what is checked across sections | `check_sections` |
//! | the errors, with file, line and key | `problem.rs` |
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
mod boot_writes;
mod bus_plan;
mod buses;
pub mod contact_postures;
mod control;
mod devices;
mod drive_object;
pub mod encoding;
mod extensions;
pub mod facts;
mod far_side;
mod figure;
pub mod file_kind;
pub mod files;
pub mod force_cap;
mod friction_share;
mod gain_check;
mod gripper;
mod held_torque;
mod interpretation;
mod joint_plant;
mod joints;
mod layouts;
mod link;
mod loads;
mod lookup;
mod model;
mod nameplate;
mod names;
mod net_ft;
mod operator;
pub mod overlay;
mod parameters;
mod plans;
mod plant;
mod plausibility;
pub mod problem;
mod protection;
mod raw;
mod raw_gripper;
mod raw_robot;
mod remote;
pub mod rest;
mod rest_check;
pub mod robots;
mod safety;
mod scale;
pub mod section;
pub mod shipped;
mod shown_mode;
mod simulated;
mod start;
mod stopping;
mod switch_box;
pub mod switch_inputs;
mod torque_limit;
pub mod trust;
mod units;
pub mod value;
mod value_limits;
mod variants;
pub mod zero;
mod zero_check;
mod zero_cost;
pub mod zeroing;

pub use boot::BootSettings;
pub use buses::{BusSettings, Layout};
pub use far_side::{Agreement, FarSide};
pub use gripper::{GripperInput, GripperTerminals};
pub use held_torque::{HeldTorque, SeenBy, TAKEN_CYCLES};
pub use joints::JointParameters;
pub use link::RemoteLink;
pub use net_ft::NetFtSensor;
pub use operator::OperatorImpedance;
pub use parameters::{EdsFile, Parameters};
pub use plant::{Actuator, Drivetrain, Friction, JointPlant, Plant};
pub use plausibility::Plausibility;
pub use problem::{Invalid, Problem};
pub use protection::timer_tolerance;
pub use safety::{Protection, Safety};
pub use stopping::Stopping;
pub use switch_box::{NoSwitchBox, SwitchBox};
pub use torque_limit::{StatedLimit, TorqueLimit};
pub use value_limits::Caution;

use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use crate::control::OtherSections;
use crate::file_kind::FileKind;
use crate::files::Files;
use crate::overlay::Setting;
use crate::problem::{Problems, Sheet};
use crate::section::{Section, Table};
use crate::trust::Trust;
use crate::value::Place;
use canopen::eds::{Finding, Severity};
use canopen::exchange::Exchange;
use canopen::frame::Channel;

/// Configuration of one hand controller: the values of a file, and the cyclic PDO exchange resolved from them.
///
/// Values cannot be changed in place, so the exchange always matches them.
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
    /// Reads and checks a file. Shipped files such as `config/kraft_like.toml` need not be on disk.
    ///
    /// # Errors
    /// Returns every problem found, with file, line and key.
    pub fn load(file: &Path) -> Result<Self, Invalid> {
        Self::load_by(Trust::Any, file)
    }

    /// Reads and checks a file that must have the protection `trust`, as must the EDS files that it names.
    ///
    /// # Errors
    /// As [`load`](Self::load), and when the protection is insufficient.
    pub fn load_by(trust: Trust, file: &Path) -> Result<Self, Invalid> {
        Self::load_from(&Files::on_disk(trust), file)
    }

    /// Reads and checks `file` of `files`, and the files that it names.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn load_from(files: &Files, file: &Path) -> Result<Self, Invalid> {
        Self::checked(file, &problem::text(files, file)?, files, &[], loads::check)
    }

    /// As [`load`](Self::load), with these values in place of the file's.
    ///
    /// # Errors
    /// Every problem found; those of the settings have no line.
    pub fn load_with(file: &Path, settings: &[Setting]) -> Result<Self, Invalid> {
        let files = Files::on_disk(Trust::Any);
        Self::checked(file, &problem::text(&files, file)?, &files, settings, loads::check)
    }

    /// Checks `text` as the content of `file`. Paths in it are relative to the folder of `file`.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn parse(file: &Path, text: &str) -> Result<Self, Invalid> {
        Self::checked(file, text, &Files::on_disk(Trust::Any), &[], loads::check)
    }

    /// Reads and checks a file, but accepts buses above their load limit. For planning only: such a network cannot run.
    ///
    /// # Errors
    /// As [`load`](Self::load), the load excepted.
    pub fn load_to_plan(file: &Path) -> Result<Self, Invalid> {
        let files = Files::on_disk(Trust::Any);
        Self::checked(file, &problem::text(&files, file)?, &files, &[], |_, _, _| {})
    }

    /// Returns the configuration of `text`, which must also pass `check`.
    fn checked(
        file: &Path,
        text: &str,
        files: &Files,
        settings: &[Setting],
        check: fn(&Parameters, &raw::File, &mut Problems<'_>),
    ) -> Result<Self, Invalid> {
        let mut problems = Problems::new(file, text, files);
        let raw = read(text, settings, &mut problems);
        let converted = raw.as_ref().and_then(|raw| convert(file, raw, &mut problems));
        if let Some((raw, (parameters, _))) = raw.as_ref().zip(converted.as_ref()) {
            check(parameters, raw, &mut problems);
        }
        problems.finish()?;
        // Every missing value was noted as a problem, so no problem means that all are present.
        let config = converted
            .and_then(|(parameters, exchange)| Some(Self { parameters, exchange: exchange? }));
        config.ok_or_else(|| Invalid(Vec::new()))
    }

    /// Returns the synchronous window after a SYNC (compare 1007h): the period less the time of all RPDOs, which must be
    /// sent before the next SYNC.
    pub fn window(&self) -> Duration {
        self.period.saturating_sub(loads::rpdo_time(self, &self.exchange.rpdos))
    }

    /// Returns the cyclic PDO exchange: the bits of each frame, assigned to nodes and objects.
    pub const fn exchange(&self) -> &Exchange {
        &self.exchange
    }

    /// Returns the maximum number of frames that the node queues at once on each bus, in the order of the channels.
    ///
    /// Counts SYNC, all RPDOs, heartbeat, TIME and one request of a cycle, or a boot's two frames for each node and two for
    /// all nodes, whichever are more.
    pub fn bursts(&self) -> Vec<u32> {
        let rpdos = &self.exchange.rpdos;
        let plans = self.node_plans();
        let at_boot = |channel: Channel| {
            let nodes = plans.iter().filter(|(on, _)| *on == channel).count();
            u32::try_from(2 * nodes + 2).unwrap_or(u32::MAX)
        };
        let others = 3 + u32::from(self.time_period.is_some());
        let channels = self.channels().into_iter();
        channels.map(|channel| (rpdos.frames_on(channel) + others).max(at_boot(channel))).collect()
    }
}

/// Parses sections and keys. Returns `None` if the text is not TOML, or a file of another kind.
fn read(text: &str, settings: &[Setting], problems: &mut Problems<'_>) -> Option<raw::File> {
    let documents = overlay::documents(settings, text.len());
    let mut document = problems.document(text, FileKind::HandController)?;
    if let Err(error) = overlay::apply(document.get_mut(), settings, &documents) {
        problems.add(&Place::new(error.key.to_owned(), None), error.reason);
        return None;
    }
    Some(raw::File::from_table(&Table::root(&document, problems), problems))
}

/// Checks and converts all sections. Returns `None` only after a problem.
fn convert(
    file: &Path,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<(Parameters, Option<Exchange>)> {
    let node = &raw.node;
    let period = problems.within(&node.sync_period_us, 250..=100_000).map(Duration::from_micros);
    let node_id = lookup::node_id(&node.node_id, problems);
    let heartbeat = problems.within(&node.heartbeat_ms, 1..=1_000);
    let sync_counter = problems.within(&node.sync_counter, 2..=240);
    let time_period = problems.within(&node.time_period_ms, 10..=3_600_000);

    let buses = buses::read(raw, problems);
    let safety = safety::read(raw, period, problems);
    let plausibility = plausibility::read(&raw.safety, problems);
    let joints = joints::read(file, raw, problems);
    let switches = switch_box::given(file, raw, problems);
    let (x_6_g, gravity) = (arm::grip(&raw.arm, problems), bodies::gravity(&raw.arm, problems));
    let contact_bounds = contact_postures::bounds(&raw.arm, problems);
    let around = OtherSections { joints: joints.as_ref(), x_6_g, gravity, period };
    let controller = control::settings(raw, &around, problems);
    let (mode, operator) = (control::mode(raw, problems), operator::read(&raw.operator, problems));
    let refuses = gain_check::refuses(raw, problems);
    let coupling = controller.as_ref().and_then(|law| law.extensions.virtual_coupling.as_ref());
    let remote = remote::settings(raw, file, coupling, problems);
    let link = link::read(raw, period, problems);
    let far_side = far_side::read(raw, period, link.as_ref(), remote.as_ref(), problems);
    let (remote, robot) = remote?;
    let mut controller = controller?;
    controller.bounds.yields = remote.interaction.accommodation.gain().map(|gain| gain > 0.0);
    let config = Parameters {
        file: file.to_path_buf(),
        period: period?,
        node_id: node_id?,
        heartbeat: Duration::from_millis(u64::from(heartbeat?)),
        sync_counter,
        time_period: time_period.map(|millis| Duration::from_millis(u64::from(millis))),
        socket: node.socket.as_ref().map(PathBuf::from),
        telemetry_socket: node.telemetry_socket.as_ref().map(PathBuf::from),
        stores_configuration: node.store_configuration.or(false).get()?,
        restores_defaults: node.restore_defaults.or(false).get()?,
        buses: buses?,
        eds_files: eds_files(problems),
        joints: joints?,
        x_6_g: x_6_g?,
        gravity: gravity?,
        contact_bounds,
        switches: switches?,
        controller,
        command_mode: mode?,
        operator: operator?,
        remote,
        robot,
        link: link?,
        far_side: far_side?,
        safety: safety?,
        plausibility: plausibility?,
    };
    let exchange = check_sections(&config, refuses, raw, problems);
    Some((config, exchange))
}

/// Returns the EDS files that were read, with their gaps as warnings.
fn eds_files(problems: &mut Problems<'_>) -> Vec<EdsFile> {
    let as_warning = |gap: &Finding| Finding { severity: Severity::Warning, ..gap.clone() };
    let read = problems.sheets().iter().filter_map(|(path, sheet)| {
        let Sheet { eds, errors, gaps } = sheet.as_ref().ok()?;
        let gaps = gaps.iter().map(as_warning).collect();
        Some(EdsFile { path: path.clone(), eds: Arc::clone(eds), errors: *errors, gaps })
    });
    read.collect()
}

/// Checks the sections against each other. Returns the cyclic exchange, unless the layouts contradict each other.
fn check_sections(
    config: &Parameters,
    refuses: bool,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<Exchange> {
    let exchange = devices::check(config, raw, problems);
    start::check(config, raw, problems);
    stopping::check(config, raw, problems);
    facts::check_config(config, raw, problems);
    rest_check::check(config, raw, problems);
    zero_check::check(config, raw, problems);
    protection::check(config, raw, problems);
    switch_box::check(config.switches.as_ref(), &config.controller.bounds, raw, problems);
    gain_check::check(config, refuses, raw, problems);
    exchange
}
