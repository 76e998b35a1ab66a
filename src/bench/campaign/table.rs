//! Figures of a campaign, one line for each kind of fault, and their text.

use std::collections::BTreeMap;
use std::{fmt, iter};

use derive_more::Display;
use serde::Serialize;

/// Figures by kind, and of all kinds together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Table {
    /// Lines of the injected kinds, in the order of the hazard table.
    pub kinds: Vec<Line>,
    /// Line of all kinds together.
    pub total: Line,
    /// Times until the drives of a killed node are torque-free, for each RPDO timer.
    pub killed: Vec<TorqueFreeTimes>,
}

/// Times until the drives of a killed node are torque-free, for one RPDO timer.
#[derive(Clone, Copy, Debug, Display, PartialEq, Serialize)]
#[display(
    "node killed, {count} times: torque-free after {p50_ms:.2}/{p99_ms:.2}/{max_ms:.2} ms, \
             demanded {within_ms:.0} ms"
)]
pub struct TorqueFreeTimes {
    /// Limit, in ms: the RPDO timer plus 1 ms.
    pub within_ms: f64,
    /// Number of cases.
    pub count: usize,
    /// Median, in ms.
    pub p50_ms: f64,
    /// 99th percentile, in ms.
    pub p99_ms: f64,
    /// Maximum, in ms.
    pub max_ms: f64,
}

/// Figures of all cases of one kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Line {
    /// Number of the hazard; 0 for all kinds together.
    pub row: u8,
    /// Name of the kind.
    pub kind: String,
    /// Number of cases.
    pub injected: usize,
    /// Number of cases in which the node latched.
    pub latched: usize,
    /// Number of missed or late reactions.
    pub missed: usize,
    /// Number of stops without a reason.
    pub false_trips: usize,
    /// Number of stops by a cause that the kind does not have.
    pub wrong_causes: usize,
    /// Number of stops in a milder state than the cause demands.
    pub wrong_states: usize,
    /// Number of stops after which a drive's power stage stayed on.
    pub left_on: usize,
    /// Number of stops by each cause.
    pub causes: BTreeMap<String, usize>,
    /// Longest time from the stop until the last power stage was off, in ms.
    pub off_ms: Option<f64>,
    /// Number of violations of an invariant.
    pub breaches: u64,
    /// Time until the node latched, in cycles.
    pub t_detect: Option<Spread>,
    /// Time that the criterion limits, in cycles.
    pub t_zero: Option<Spread>,
    /// Maximum of the time that the criterion limits, in ms.
    pub t_zero_ms: Option<f64>,
    /// Maximum number of cycles between the first and the last joint whose torque was cut to zero.
    pub spread: Option<u64>,
    /// Largest impulse of all motors after the onset where torque had to end, in mN·m·s.
    pub impulse_mnms: f64,
    /// Largest target torque after the onset, in percent of the joint's capacity.
    pub peak_percent: f64,
    /// Highest speed of the grip after the onset, in m/s.
    pub grip_speed_m_per_s: f64,
    /// Largest displacement of the grip, in mm.
    pub grip_travel_mm: f64,
    /// Number of non-zero targets more than two periods old on the wire.
    pub stale_targets: u64,
    /// Number of cycles in which a drive acted on a target more than two periods old.
    pub stale_applied: u64,
    /// Maximum age of a target that a drive acted on, in ms.
    pub oldest_applied_ms: f64,
    /// Number of non-zero targets without arming.
    pub unarmed_targets: u64,
}

/// Median, 99th percentile and maximum, in cycles.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Serialize)]
#[display("{}/{}/{}", self.p50, self.p99, self.max)]
pub struct Spread {
    /// Median.
    pub p50: u64,
    /// 99th percentile.
    pub p99: u64,
    /// Maximum.
    pub max: u64,
}

/// Columns: name with unit, and width.
const COLUMNS: [(&str, usize); 13] = [
    ("row", 3),
    ("fault", 31),
    ("number", 6),
    ("latched", 7),
    ("bad", 3),
    ("T_detect", 11),
    ("T_zero", 11),
    ("spread", 6),
    ("off ms", 6),
    ("mN·m·s", 8),
    ("cap %", 5),
    ("m/s", 5),
    ("mm", 5),
];

impl Line {
    /// Returns the text of each column. Times are p50/p99/max in cycles; impulse, share of capacity, speed and
    /// displacement of the grip are maxima.
    fn cells(&self) -> [String; 13] {
        let or_dash = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
        let bad =
            self.missed + self.false_trips + self.wrong_causes + self.wrong_states + self.left_on;
        [
            if self.row == 0 { String::new() } else { self.row.to_string() },
            self.kind.clone(),
            self.injected.to_string(),
            self.latched.to_string(),
            bad.to_string(),
            or_dash(self.t_detect.map(|spread| spread.to_string())),
            or_dash(self.t_zero.map(|spread| spread.to_string())),
            or_dash(self.spread.map(|spread| spread.to_string())),
            or_dash(self.off_ms.map(|off_ms| format!("{off_ms:.1}"))),
            format!("{:.1}", self.impulse_mnms),
            format!("{:.0}", self.peak_percent),
            format!("{:.2}", self.grip_speed_m_per_s),
            format!("{:.1}", self.grip_travel_mm),
        ]
    }
}

impl Table {
    fn lines(&self) -> impl Iterator<Item = [String; 13]> {
        self.kinds.iter().chain([&self.total]).map(Line::cells)
    }

    /// Returns the figures of all kinds together.
    fn notes(&self) -> Vec<String> {
        let Line { missed, false_trips, breaches, unarmed_targets, .. } = &self.total;
        let Line { stale_targets, stale_applied, oldest_applied_ms, .. } = &self.total;
        let Line { wrong_causes, wrong_states, left_on, .. } = &self.total;
        let mut notes: Vec<String> = self.killed.iter().map(ToString::to_string).collect();
        notes.push(format!("late or not at all: {missed}; false trips: {false_trips}"));
        notes.push(format!(
            "stopped by another cause than demanded: {wrong_causes}; in a milder state: {wrong_states}; \
             a drive left on: {left_on}"
        ));
        notes.push(format!("invariants I1 to I13 broken: {breaches}"));
        notes.push(format!("targets not zero while not armed: {unarmed_targets}"));
        notes.push(format!(
            "stale targets (not zero, older than two periods) on the wire: {stale_targets}; cycles in which a \
             drive acted on one: {stale_applied}; the oldest that acted: {oldest_applied_ms:.2} ms"
        ));
        notes
    }

    /// Returns the table as Markdown.
    pub fn markdown(&self) -> String {
        let row = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let names = COLUMNS.map(|(name, _)| name.to_owned());
        let rules = COLUMNS.map(|(name, _)| if name == "fault" { "---" } else { "--:" }.to_owned());
        let mut text = row(&names) + &row(&rules);
        self.lines().for_each(|cells| text.push_str(&row(&cells)));
        text.push('\n');
        self.notes().iter().for_each(|note| text.push_str(&format!("- {note}\n")));
        text
    }
}

/// Heading, a line for each kind, all kinds together, and notes; 120 columns at most.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = COLUMNS.map(|(name, _)| name.to_owned());
        for cells in iter::once(names).chain(self.lines()) {
            let padded = cells.iter().zip(COLUMNS).map(|(cell, (name, width))| match name {
                "fault" => format!("{cell:<width$}"),
                _ => format!("{cell:>width$}"),
            });
            writeln!(f, "{}", padded.collect::<Vec<_>>().join(" "))?;
        }
        let notes = self.notes();
        write!(f, "\n{}", notes.join("\n"))
    }
}
