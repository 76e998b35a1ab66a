//! Figures of a campaign, one line for each kind of fault.

use std::collections::BTreeMap;
use std::time::Duration;
use std::{fmt, iter};

use derive_more::Display;
use serde::Serialize;

use crate::catalogue;
use crate::criterion::Criterion;
use crate::kind::{CaseKind, KILLED};
use crate::verdict::{Outcome, Verdict};

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

impl Table {
    /// Computes the figures of these verdicts.
    pub fn from_verdicts(verdicts: &[Verdict]) -> Self {
        let line = |kind: &'static CaseKind| {
            let of: Vec<&Verdict> = verdicts.iter().filter(|one| one.kind == kind.name).collect();
            (!of.is_empty()).then(|| Line::from_verdicts(kind.hazard, kind.name, &of))
        };
        let mut kinds: Vec<Line> = catalogue::kinds().filter_map(line).collect();
        kinds.sort_by_key(|line| line.row);
        let all: Vec<&Verdict> = verdicts.iter().collect();
        Self {
            kinds,
            total: Line::from_verdicts(0, "all", &all),
            killed: TorqueFreeTimes::from_verdicts(verdicts),
        }
    }
}

impl TorqueFreeTimes {
    fn from_verdicts(verdicts: &[Verdict]) -> Vec<Self> {
        let killed = verdicts.iter().filter(|one| one.kind == KILLED);
        let timed = killed.filter_map(|one| match (one.criterion, one.observed.torque_free) {
            (Criterion::TorqueFree(within), Some(quiet)) => Some((within, quiet)),
            _ => None,
        });
        let mut by_timer: BTreeMap<Duration, Vec<u64>> = BTreeMap::new();
        for (within, quiet) in timed {
            let micros = u64::try_from(quiet.as_micros()).unwrap_or(u64::MAX);
            by_timer.entry(within).or_default().push(micros);
        }
        by_timer.into_iter().filter_map(Self::from_times).collect()
    }

    fn from_times((within, micros): (Duration, Vec<u64>)) -> Option<Self> {
        let count = micros.len();
        let millis = |micros: u64| rounded(Duration::from_micros(micros).as_secs_f64() * 1e3);
        let Spread { p50, p99, max } = Spread::from_values(micros)?;
        let [p50_ms, p99_ms, max_ms] = [p50, p99, max].map(millis);
        Some(Self { within_ms: within.as_secs_f64() * 1e3, count, p50_ms, p99_ms, max_ms })
    }
}

impl Line {
    fn from_verdicts(row: u8, kind: &str, verdicts: &[&Verdict]) -> Self {
        let count = |of: fn(&Verdict) -> bool| verdicts.iter().filter(|one| of(one)).count();
        let most = |of: fn(&Verdict) -> f64| verdicts.iter().map(|one| of(one)).fold(0.0, f64::max);
        let cycles = |of: fn(&Verdict) -> Option<Duration>| {
            let times = verdicts.iter().filter_map(|one| Some(in_cycles(of(one)?, one.period)));
            Spread::from_values(times.collect())
        };
        let times = verdicts.iter().filter_map(|one| one.limited_time());
        let off = verdicts.iter().filter_map(|one| one.observed.off);
        Self {
            row,
            kind: kind.to_owned(),
            injected: verdicts.len(),
            latched: count(|one| one.observed.detected.is_some()),
            missed: count(|one| matches!(one.outcome, Outcome::Missed | Outcome::Late)),
            false_trips: count(|one| one.outcome == Outcome::FalseTrip),
            wrong_causes: count(|one| one.outcome == Outcome::WrongCause),
            wrong_states: count(|one| one.outcome == Outcome::WrongState),
            left_on: count(|one| one.outcome == Outcome::LeftOn),
            causes: causes(verdicts),
            off_ms: off.max().map(|time| rounded(time.as_secs_f64() * 1e3)),
            breaches: verdicts.iter().map(|one| one.observed.violation_count).sum(),
            t_detect: cycles(|one| one.observed.detected),
            t_zero: cycles(Verdict::limited_time),
            t_zero_ms: times.max().map(|time| rounded(time.as_secs_f64() * 1e3)),
            spread: verdicts.iter().filter_map(|one| one.observed.spread).max(),
            impulse_mnms: rounded(most(|one| match one.limited_time() {
                Some(_) => 1e3 * one.observed.impulse,
                None => 0.0,
            })),
            peak_percent: rounded(most(|one| 100.0 * one.observed.peak)),
            grip_speed_m_per_s: rounded(most(|one| one.observed.speed)),
            grip_travel_mm: rounded(most(|one| 1e3 * one.observed.travel)),
            stale_targets: verdicts.iter().map(|one| one.observed.stale).sum(),
            stale_applied: verdicts.iter().map(|one| one.observed.applied).sum(),
            oldest_applied_ms: rounded(most(|one| one.observed.oldest.as_secs_f64() * 1e3)),
            unarmed_targets: verdicts.iter().map(|one| one.observed.unarmed).sum(),
        }
    }
}

/// Returns the number of stops by each cause.
fn causes(verdicts: &[&Verdict]) -> BTreeMap<String, usize> {
    let mut causes = BTreeMap::new();
    for cause in verdicts.iter().filter_map(|one| one.observed.cause) {
        *causes.entry(format!("{:?}", cause.kind())).or_default() += 1;
    }
    causes
}

/// Converts a time to cycles, rounded up.
fn in_cycles(time: Duration, period: Duration) -> u64 {
    let cycles = time.as_micros().div_ceil(period.as_micros().max(1));
    u64::try_from(cycles).unwrap_or(u64::MAX)
}

/// Returns the value rounded to three decimals.
fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

impl Spread {
    fn from_values(mut values: Vec<u64>) -> Option<Self> {
        values.sort_unstable();
        let at = |percent: usize| values.get((values.len() * percent).div_ceil(100).max(1) - 1);
        Some(Self { p50: *at(50)?, p99: *at(99)?, max: *values.last()? })
    }
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
