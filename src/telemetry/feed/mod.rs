//! Telemetry of a running node: lines of JSON for viewers (docs/telemetry.md).
//!
//! Frames, records and time are arguments. The caller sends the lines.
//!
//! ```text
//!  description          once, what does not change
//!  mode                 at each change, and every half second
//!  snapshot             every 20 ms, by the number of the cycle
//! ```

mod bus_meter;
mod description;
mod head;
mod pose;
mod snapshot;
mod spans;
mod watchdogs;

pub use self::description::Source;
pub use self::snapshot::Scarce;

use std::time::Duration;

use serde::Serialize;

use self::bus_meter::BusMeter;
use self::description::Description;
use self::head::Head;
use self::snapshot::{Beside, Snapshot};
use self::spans::Spans;
use self::watchdogs::Watchdogs;
use crate::origin::Origin;
use crate::status::JointLabel;
use crate::way_out::Situation;
use canopen::frame::Telegram;
use config::Config;
use node::cause::Cause;
use node::record::{Mode, Record};
use node::zero::ZeroState;
use units::time::Instant;

/// Nominal interval between two snapshots.
const SNAPSHOT_EVERY: Duration = Duration::from_millis(20);

/// Interval between two lines about the mode, and between two readings of slow values.
const MODE_EVERY: Duration = Duration::from_millis(500);

/// Line of telemetry, with its line break.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FeedLine {
    /// Mode and cause. A new reader gets the newest one.
    Mode(String),
    /// Snapshot of a cycle.
    Snapshot(String),
}

/// Mode, cause, and steps that lead on.
#[derive(Debug, Serialize)]
struct ModeLine<'a> {
    #[serde(flatten)]
    head: Head,
    cycle: u64,
    at_us: u64,
    mode: &'static str,
    stopped_by: Option<String>,
    not_off: Vec<&'a str>,
    way_out: Vec<String>,
}

/// Mode with its causes, and the zeros. A change triggers a line.
#[derive(Clone, Copy, Debug, PartialEq)]
struct State {
    mode: Mode,
    cause: Option<Cause>,
    not_off: [bool; 6],
    zeros: [ZeroState; 6],
}

/// Generator of lines from records and frames.
#[derive(Debug)]
pub struct Feed {
    description: String,
    joints: Vec<JointLabel>,
    max_torques: [f64; 6],
    robot_joints: usize,
    has_switch_box: bool,
    cycles_per_snapshot: u64,
    /// Set while readers are connected.
    is_read: bool,
    state: State,
    cycle: u64,
    /// Time of the last cycle or line about the mode, whichever is later.
    active_at: Instant,
    /// Time at which slow values were last sampled; `None` before the first sample for a reader.
    sampled_at: Option<Instant>,
    spans: Spans,
    buses: BusMeter,
    watchdogs: Watchdogs,
    scarce: Scarce,
}

impl Feed {
    /// Creates the feed of a node before its boot. `origin` is the wall clock at time zero; `None` in virtual time.
    pub fn new(config: &Config, source: Source, origin: Option<Origin>) -> Self {
        let cycles_per_snapshot = cycles_per_snapshot(config.period);
        let description = Description::new(config, source, origin, cycles_per_snapshot);
        Self {
            description: line(&description),
            joints: crate::status::labels(config),
            max_torques: config.joints.each_ref().map(|joint| joint.plant.actuator.max_torque),
            robot_joints: config.robot.as_ref().map_or(0, |robot| robot.joints.len()),
            has_switch_box: config.switches.is_some(),
            cycles_per_snapshot,
            is_read: false,
            state: State {
                mode: Mode::Boot,
                cause: None,
                not_off: [false; 6],
                zeros: [ZeroState::Known; 6],
            },
            cycle: 0,
            active_at: Instant::ZERO,
            sampled_at: None,
            spans: Spans::NONE,
            buses: BusMeter::new(config.buses.iter().map(|bus| bus.bitrate)),
            watchdogs: Watchdogs::new(config),
            scarce: Scarce::default(),
        }
    }

    /// Returns the first line for each reader, with its line break.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Returns the line about the current mode, with its line break.
    pub fn mode(&self) -> String {
        let State { mode, cause, not_off, zeros } = &self.state;
        let names: Vec<_> = self.joints.iter().map(|joint| joint.name.as_str()).collect();
        let (mode, cause, has_switch_box) = (*mode, *cause, self.has_switch_box);
        let situation = Situation { mode, cause, not_off, zeros, has_switch_box };
        line(&ModeLine {
            head: Head::new("mode"),
            cycle: self.cycle,
            at_us: self.active_at.as_micros(),
            mode: mode.name(),
            stopped_by: cause.map(|cause| cause.with_name(&names)),
            not_off: situation.not_off(&names),
            way_out: situation.steps(&names),
        })
    }

    /// Sets whether readers are connected. Without readers only changes of the mode make a line, and nothing is counted.
    /// Spans, loads and watchdogs restart with the first reader.
    pub fn set_read(&mut self, is_read: bool) {
        let was_read = std::mem::replace(&mut self.is_read, is_read);
        if is_read && !was_read {
            self.spans = Spans::NONE;
            self.buses.restart();
            self.watchdogs.restart();
            self.sampled_at = None;
        }
    }

    /// Adds a frame. Returns the line about the mode if it is due, because a booting network has no cycles.
    pub fn on_frame(&mut self, at: Instant, telegram: &Telegram) -> Option<FeedLine> {
        if !self.is_read {
            return None;
        }
        self.buses.on_frame(at, telegram);
        self.watchdogs.on_frame(at, telegram);
        (at.since(self.active_at) >= MODE_EVERY).then(|| {
            self.active_at = at;
            FeedLine::Mode(self.mode())
        })
    }

    /// Adds a cycle. Returns the lines that are due; `scarce` is called when the slow values are needed.
    pub fn on_record(
        &mut self,
        record: &Record,
        scarce: impl FnOnce() -> Scarce,
    ) -> [Option<FeedLine>; 2] {
        let Record { at, mode, cause, not_off, zeros, .. } = *record;
        (self.cycle, self.active_at) = (record.cycle, at);
        let state = State { mode, cause, not_off, zeros };
        let has_changed = std::mem::replace(&mut self.state, state) != state;
        if !self.is_read {
            // For the next reader.
            return [has_changed.then(|| FeedLine::Mode(self.mode())), None];
        }
        self.watchdogs.on_record(record);
        self.spans.add(record);
        let is_due = self.sampled_at.is_none_or(|sampled_at| at.since(sampled_at) >= MODE_EVERY);
        if is_due {
            self.sampled_at = Some(at);
            self.buses.measure(at);
            self.scarce = scarce();
        }
        let mode = (has_changed || is_due).then(|| FeedLine::Mode(self.mode()));
        let is_snapshot = record.cycle.is_multiple_of(self.cycles_per_snapshot);
        [mode, is_snapshot.then(|| self.snapshot(record))]
    }

    fn snapshot(&mut self, record: &Record) -> FeedLine {
        let beside = Beside {
            joints: &self.joints,
            max_torques: &self.max_torques,
            robot_joints: self.robot_joints,
            scarce: &self.scarce,
            spans: std::mem::replace(&mut self.spans, Spans::NONE),
            buses: self.buses.loads(),
            watchdogs: self.watchdogs.take(),
        };
        FeedLine::Snapshot(line(&Snapshot::new(record, beside)))
    }
}

/// Returns the number of cycles closest to the interval between two snapshots, at least 1.
fn cycles_per_snapshot(period: Duration) -> u64 {
    let (every, period) = (SNAPSHOT_EVERY.as_micros(), period.as_micros().max(1));
    let nearest = (2 * every + period) / (2 * period);
    u64::try_from(nearest).unwrap_or(u64::MAX).max(1)
}

/// Returns a value as a line of JSON. Numbers that are not finite are `null`.
fn line(value: &impl Serialize) -> String {
    // Structs with string keys serialize always.
    let mut text = serde_json::to_string(value).unwrap_or_default();
    text.push('\n');
    text
}
