//! Figures of a campaign in progress: verdicts are counted, and not kept, so that its memory does not grow with its length.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::catalogue;
use crate::criterion::Criterion;
use crate::kind::KILLED;
use crate::table::{Line, Spread, Table, TorqueFreeTimes};
use crate::verdict::{Outcome, Verdict};

/// Figures in progress.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    kinds: BTreeMap<&'static str, KindTally>,
    total: KindTally,
    /// Times of killed nodes, in µs, by their limit.
    killed: BTreeMap<Duration, Counts>,
}

/// Figures of one kind in progress. Those of `line` are not rounded.
#[derive(Clone, Debug, Default)]
struct KindTally {
    line: Line,
    /// Times until the node latched, in cycles.
    detect: Counts,
    /// Times that the criterion limits, in cycles.
    limited: Counts,
}

/// Numbers of equal values: few values are different, as times are counted in cycles or µs.
#[derive(Clone, Debug, Default)]
struct Counts {
    counts: BTreeMap<u64, usize>,
    total: usize,
}

impl Tally {
    /// Adds a verdict.
    pub fn add(&mut self, verdict: &Verdict) {
        self.kinds.entry(verdict.kind).or_default().add(verdict);
        self.total.add(verdict);
        let Criterion::TorqueFree(within) = verdict.criterion else { return };
        let quiet = verdict.observed.torque_free.filter(|_| verdict.kind == KILLED);
        if let Some(quiet) = quiet {
            let micros = u64::try_from(quiet.as_micros()).unwrap_or(u64::MAX);
            self.killed.entry(within).or_default().add(micros);
        }
    }

    /// Returns the figures so far.
    pub fn table(&self) -> Table {
        let kinds = catalogue::kinds()
            .filter_map(|kind| Some(self.kinds.get(kind.name)?.line(kind.hazard, kind.name)));
        let mut kinds: Vec<Line> = kinds.collect();
        kinds.sort_by_key(|line| line.row);
        let killed = self.killed.iter().filter_map(|(within, times)| torque_free(*within, times));
        Table { kinds, total: self.total.line(0, "all"), killed: killed.collect() }
    }
}

impl Table {
    /// Computes the figures of these verdicts.
    pub fn from_verdicts(verdicts: &[Verdict]) -> Self {
        let mut tally = Tally::default();
        verdicts.iter().for_each(|verdict| tally.add(verdict));
        tally.table()
    }
}

fn torque_free(within: Duration, times: &Counts) -> Option<TorqueFreeTimes> {
    let millis = |micros: u64| rounded(Duration::from_micros(micros).as_secs_f64() * 1e3);
    let Spread { p50, p99, max } = times.spread()?;
    let [p50_ms, p99_ms, max_ms] = [p50, p99, max].map(millis);
    let within_ms = within.as_secs_f64() * 1e3;
    Some(TorqueFreeTimes { within_ms, count: times.total, p50_ms, p99_ms, max_ms })
}

impl KindTally {
    fn add(&mut self, verdict: &Verdict) {
        let (line, observed) = (&mut self.line, &verdict.observed);
        line.injected += 1;
        line.latched += usize::from(observed.detected.is_some());
        match verdict.outcome {
            Outcome::Met => {}
            Outcome::Missed | Outcome::Late => line.missed += 1,
            Outcome::FalseTrip => line.false_trips += 1,
            Outcome::WrongCause => line.wrong_causes += 1,
            Outcome::WrongState => line.wrong_states += 1,
            Outcome::LeftOn => line.left_on += 1,
        }
        if let Some(cause) = observed.cause {
            *line.causes.entry(format!("{:?}", cause.kind())).or_default() += 1;
        }
        let limited = verdict.limited_time();
        line.off_ms = longest(line.off_ms, observed.off);
        line.t_zero_ms = longest(line.t_zero_ms, limited);
        line.spread = line.spread.max(observed.spread);
        if limited.is_some() {
            line.impulse_mnms = line.impulse_mnms.max(1e3 * observed.impulse);
        }
        line.peak_percent = line.peak_percent.max(100.0 * observed.peak);
        line.grip_speed_m_per_s = line.grip_speed_m_per_s.max(observed.speed);
        line.grip_travel_mm = line.grip_travel_mm.max(1e3 * observed.travel);
        line.oldest_applied_ms = line.oldest_applied_ms.max(millis(observed.oldest));
        line.breaches += observed.violation_count;
        line.stale_targets += observed.stale;
        line.stale_applied += observed.applied;
        line.unarmed_targets += observed.unarmed;
        let cycles = |time: Duration| in_cycles(time, verdict.period);
        observed.detected.into_iter().for_each(|time| self.detect.add(cycles(time)));
        limited.into_iter().for_each(|time| self.limited.add(cycles(time)));
    }

    /// Returns the line of a table.
    fn line(&self, row: u8, kind: &str) -> Line {
        let line = self.line.clone();
        Line {
            row,
            kind: kind.to_owned(),
            off_ms: line.off_ms.map(rounded),
            t_detect: self.detect.spread(),
            t_zero: self.limited.spread(),
            t_zero_ms: line.t_zero_ms.map(rounded),
            impulse_mnms: rounded(line.impulse_mnms),
            peak_percent: rounded(line.peak_percent),
            grip_speed_m_per_s: rounded(line.grip_speed_m_per_s),
            grip_travel_mm: rounded(line.grip_travel_mm),
            oldest_applied_ms: rounded(line.oldest_applied_ms),
            ..line
        }
    }
}

impl Counts {
    fn add(&mut self, value: u64) {
        *self.counts.entry(value).or_default() += 1;
        self.total += 1;
    }

    /// Returns median, 99th percentile and maximum; `None` without values.
    fn spread(&self) -> Option<Spread> {
        let at = |percent: usize| {
            let (mut seen, rank) = (0, (self.total * percent).div_ceil(100));
            let reaches = |(_, count): &(&u64, &usize)| {
                seen += **count;
                seen >= rank
            };
            self.counts.iter().find(reaches).map(|(value, _)| *value)
        };
        Some(Spread { p50: at(50)?, p99: at(99)?, max: at(100)? })
    }
}

/// Returns the longer of two times in ms.
fn longest(before: Option<f64>, time: Option<Duration>) -> Option<f64> {
    before.into_iter().chain(time.map(millis)).reduce(f64::max)
}

fn millis(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The ranks of sorted values.
        #[test]
        fn counted_spread_is_that_of_the_sorted_values(values in prop::collection::vec(0_u64..40, 1..300)) {
            let mut counts = Counts::default();
            values.iter().for_each(|value| counts.add(*value));
            let mut sorted = values;
            sorted.sort_unstable();
            let at = |percent: usize| sorted[(sorted.len() * percent).div_ceil(100).max(1) - 1];
            let expected = Spread { p50: at(50), p99: at(99), max: at(100) };
            prop_assert_eq!(counts.spread(), Some(expected));
        }
    }

    #[test]
    fn counts_of_many_values_keep_the_different_ones_only() {
        let mut counts = Counts::default();
        (0..100_000).for_each(|value| counts.add(value % 30));
        assert_eq!((counts.counts.len(), counts.total), (30, 100_000));
        assert_eq!(Counts::default().spread(), None);
    }
}
