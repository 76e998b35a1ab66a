//! The figures of a campaign, one line for each kind of fault.

use std::fmt;
use std::time::Duration;

use serde::Serialize;

use crate::lab::campaign::catalogue;
use crate::lab::campaign::verdict::Outcome;
use crate::lab::campaign::verdict::Verdict;

/// All lines, and what they come to together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Table {
    /// One for each kind that was injected, in the order of the hazard table.
    pub kinds: Vec<Line>,
    /// All kinds together.
    pub total: Line,
}

/// What came of all faults of one kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Line {
    /// The row of the hazard table; 0 for all.
    pub row: u8,
    /// The kind.
    pub kind: String,
    /// How often it was injected.
    pub injected: usize,
    /// How often the node latched.
    pub latched: usize,
    /// How often it was not answered, or not in time.
    pub missed: usize,
    /// How often it stopped without need.
    pub false_trips: usize,
    /// Breaches of a law.
    pub breaches: u64,
    /// Until the node latched, in cycles.
    pub t_detect: Option<Spread>,
    /// Until all is as demanded (zero, silent, not felt), in cycles.
    pub t_zero: Option<Spread>,
    /// The same in ms, at most.
    pub t_zero_ms: Option<f64>,
    /// Cycles between the first joint and the last one to be told zero, at most.
    pub spread: Option<u64>,
    /// What the motors pushed after the onset where torque had to end, in mN·m·s, at most.
    pub impulse_mnms: f64,
    /// The largest share of a capacity that was told after the onset, in percent.
    pub peak_percent: f64,
    /// Of the grip after the onset, in m/s, at most.
    pub grip_speed_m_per_s: f64,
    /// Of the grip, in mm, at most.
    pub grip_travel_mm: f64,
    /// Torque frames that acted in another cycle than their own.
    pub stale_frames: u64,
    /// Targets that were not zero although nothing was armed.
    pub unarmed_frames: u64,
}

/// The middle, the worst in a hundred, and the worst, in cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Spread {
    /// Half of them are no worse.
    pub p50: u64,
    /// 99 of 100 are no worse.
    pub p99: u64,
    /// None is worse.
    pub max: u64,
}

impl Table {
    /// Of these verdicts.
    pub fn of(verdicts: &[Verdict]) -> Self {
        let line = |kind: &'static catalogue::Kind| {
            let of: Vec<&Verdict> = verdicts.iter().filter(|one| one.kind == kind.name).collect();
            (!of.is_empty()).then(|| Line::of(kind.row, kind.name, &of))
        };
        let mut kinds: Vec<Line> = catalogue::kinds().filter_map(line).collect();
        kinds.sort_by_key(|line| line.row);
        let all: Vec<&Verdict> = verdicts.iter().collect();
        Self { kinds, total: Line::of(0, "all", &all) }
    }
}

impl Line {
    fn of(row: u8, kind: &str, verdicts: &[&Verdict]) -> Self {
        let count = |of: fn(&Verdict) -> bool| verdicts.iter().filter(|one| of(one)).count();
        let most = |of: fn(&Verdict) -> f64| verdicts.iter().map(|one| of(one)).fold(0.0, f64::max);
        let cycles = |of: fn(&Verdict) -> Option<Duration>| {
            let times = verdicts.iter().filter_map(|one| Some(in_cycles(of(one)?, one.period)));
            Spread::of(times.collect())
        };
        let times = verdicts.iter().filter_map(|one| one.time());
        Self {
            row,
            kind: kind.to_owned(),
            injected: verdicts.len(),
            latched: count(|one| one.seen.detected.is_some()),
            missed: count(|one| matches!(one.outcome, Outcome::Missed | Outcome::Late)),
            false_trips: count(|one| one.outcome == Outcome::FalseTrip),
            breaches: verdicts.iter().map(|one| one.seen.breach_count).sum(),
            t_detect: cycles(|one| one.seen.detected),
            t_zero: cycles(Verdict::time),
            t_zero_ms: times.max().map(|time| rounded(time.as_secs_f64() * 1e3)),
            spread: verdicts.iter().filter_map(|one| one.seen.spread).max(),
            impulse_mnms: rounded(most(|one| match one.time() {
                Some(_) => 1e3 * one.seen.impulse,
                None => 0.0,
            })),
            peak_percent: rounded(most(|one| 100.0 * one.seen.peak)),
            grip_speed_m_per_s: rounded(most(|one| one.seen.speed)),
            grip_travel_mm: rounded(most(|one| 1e3 * one.seen.travel)),
            stale_frames: verdicts.iter().map(|one| one.seen.stale).sum(),
            unarmed_frames: verdicts.iter().map(|one| one.seen.unarmed).sum(),
        }
    }
}

/// Whole cycles: one that has begun counts.
fn in_cycles(time: Duration, period: Duration) -> u64 {
    let cycles = time.as_micros().div_ceil(period.as_micros().max(1));
    u64::try_from(cycles).unwrap_or(u64::MAX)
}

/// To three decimals.
fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

impl Spread {
    fn of(mut values: Vec<u64>) -> Option<Self> {
        values.sort_unstable();
        let at = |percent: usize| values.get((values.len() * percent).div_ceil(100).max(1) - 1);
        Some(Self { p50: *at(50)?, p99: *at(99)?, max: *values.last()? })
    }
}

/// As in `2/3/5`.
impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}/{}", self.p50, self.p99, self.max)
    }
}

/// With a heading, and all kinds together at the end.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:>3}  {:<34} {:>8} {:>8} {:>6} {:>5} {:>8}  {:>11} {:>11} {:>9} {:>6} {:>8} {:>6} {:>6} {:>6}",
            "row",
            "fault",
            "injected",
            "latched",
            "missed",
            "false",
            "breaches",
            "T_detect",
            "T_zero",
            "T_zero ms",
            "spread",
            "impulse",
            "peak %",
            "m/s",
            "mm"
        )?;
        self.kinds.iter().try_for_each(|line| writeln!(f, "{line}"))?;
        write!(f, "{}", self.total)
    }
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let or_dash = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
        let row = if self.row == 0 { String::new() } else { self.row.to_string() };
        write!(
            f,
            "{row:>3}  {:<34} {:>8} {:>8} {:>6} {:>5} {:>8}  {:>11} {:>11} {:>9} {:>6} {:>8.2} {:>6.1} {:>6.3} {:>6.2}",
            self.kind,
            self.injected,
            self.latched,
            self.missed,
            self.false_trips,
            self.breaches,
            or_dash(self.t_detect.map(|spread| spread.to_string())),
            or_dash(self.t_zero.map(|spread| spread.to_string())),
            or_dash(self.t_zero_ms.map(|millis| format!("{millis:.2}"))),
            or_dash(self.spread.map(|spread| spread.to_string())),
            self.impulse_mnms,
            self.peak_percent,
            self.grip_speed_m_per_s,
            self.grip_travel_mm
        )
    }
}
