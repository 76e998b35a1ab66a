//! Histograms of the cycles' timing, and the step that made a cycle late.
//!
//! Values are in µs, with two significant digits, up to a second. A histogram has a fixed size and never allocates.

use std::fmt;
use std::time::Duration;

use derive_more::Display;
use hdrhistogram::Histogram;
use serde::Serialize;

use node::cycle_times::CycleTimes;
use node::record::Record;

/// Maximum value of a histogram, in µs. Longer times count as this.
const MAX_US: u64 = 1_000_000;

/// Histograms of the times of all cycles so far.
#[derive(Clone, Debug)]
pub struct Timing {
    wake_up: Histogram<u32>,
    last_sample: Histogram<u32>,
    step: Histogram<u32>,
    last_target: Histogram<u32>,
    confirmed: Histogram<u32>,
    joints: [Histogram<u32>; 6],
    /// Number of late cycles until the previous cycle, and its times.
    before: Option<(u64, CycleTimes)>,
}

/// Percentiles of one time, in µs, each the upper end of its class: up to 1 % too large.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Percentiles {
    /// Number of values.
    pub count: u64,
    pub p50: u64,
    pub p99: u64,
    #[serde(rename = "p99.9")]
    pub p99_9: u64,
    pub max: u64,
}

/// Percentiles of one time of each joint, base first, in µs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PerJoint {
    pub p50: [u64; 6],
    pub p99: [u64; 6],
    #[serde(rename = "p99.9")]
    pub p99_9: [u64; 6],
    pub max: [u64; 6],
}

/// Timing of a run, in µs.
#[derive(Clone, Debug, Serialize)]
pub struct TimingReport {
    /// Delay from the due time of SYNC to the wake-up for it.
    pub wake_up_late_us: Percentiles,
    /// From SYNC to the last sample of the joints, in cycles with all of them.
    pub sync_to_last_sample_us: Percentiles,
    /// From the end of the SYNC window to the first target: watches and controller.
    pub step_us: Percentiles,
    /// From SYNC to the last target accepted by its bus.
    pub sync_to_last_target_us: Percentiles,
    /// From SYNC to its transmit confirmation; no values if the bus does not confirm.
    pub sync_to_confirmation_us: Percentiles,
    /// From SYNC to the sample of each joint, in cycles that have it.
    pub sync_to_sample_us: PerJoint,
}

/// One class of a histogram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Class {
    /// Smallest time in the class, in µs.
    pub from: u64,
    /// Largest time in the class, in µs.
    pub to: u64,
    /// Number of values.
    pub count: u64,
}

/// Histograms of a run: all classes with values, in µs, smallest first. The names are those of [`TimingReport`].
#[derive(Clone, Debug, Serialize)]
pub struct HistogramReport {
    /// Maximum value of a histogram, in µs. Longer times count as this.
    pub largest_us: u64,
    pub wake_up_late_us: Vec<Class>,
    pub sync_to_last_sample_us: Vec<Class>,
    pub step_us: Vec<Class>,
    pub sync_to_last_target_us: Vec<Class>,
    pub sync_to_confirmation_us: Vec<Class>,
    /// One histogram for each joint, base first.
    pub sync_to_sample_us: [Vec<Class>; 6],
}

/// Longest step of a late cycle.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum LateStep {
    /// Wake-up of the cycle's thread by the kernel.
    #[display("wake-up")]
    WakeUp,
    /// SYNC window, in which samples are awaited.
    #[display("wait for samples")]
    Window,
    /// Watches and controller.
    #[display("controller")]
    Step,
    /// Sending of the targets.
    #[display("sending of targets")]
    Targets,
    /// Work after the targets: services, record, requests.
    #[display("services and record after the targets")]
    Rest,
}

/// A late cycle, as `overruns` counts them, with its longest step.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
#[display("overrun in cycle {cycle}: {step} took {} µs", took.as_micros())]
pub struct LateCycle {
    /// Number of the cycle.
    pub cycle: u64,
    /// Longest step.
    pub step: LateStep,
    /// Duration of that step.
    pub took: Duration,
}

impl Default for Timing {
    fn default() -> Self {
        Self {
            wake_up: histogram(),
            last_sample: histogram(),
            step: histogram(),
            last_target: histogram(),
            confirmed: histogram(),
            joints: std::array::from_fn(|_| histogram()),
            before: None,
        }
    }
}

impl Timing {
    /// Adds the next cycle; returns it if it was late.
    pub fn add(&mut self, record: &Record) -> Option<LateCycle> {
        self.add_times(&record.times);
        let (overruns, before) = self.before.replace((record.overruns, record.times))?;
        let is_over = record.overruns > overruns;
        is_over.then(|| LateCycle::from_times(record.cycle, &record.times, &before))
    }

    fn add_times(&mut self, times: &CycleTimes) {
        let is_complete = times.samples.iter().all(Option::is_some);
        let last_sample = times.samples.iter().flatten().max().filter(|_| is_complete);
        add(&mut self.wake_up, Some(times.wake_up));
        add(&mut self.last_sample, last_sample.copied());
        add(&mut self.step, Some(times.step));
        add(&mut self.last_target, Some(times.targets));
        add(&mut self.confirmed, times.confirmed);
        for (histogram, sample) in self.joints.iter_mut().zip(times.samples) {
            add(histogram, sample);
        }
    }

    /// Returns the percentiles of each time, over all cycles so far.
    pub fn report(&self) -> TimingReport {
        TimingReport {
            wake_up_late_us: Percentiles::new(&self.wake_up),
            sync_to_last_sample_us: Percentiles::new(&self.last_sample),
            step_us: Percentiles::new(&self.step),
            sync_to_last_target_us: Percentiles::new(&self.last_target),
            sync_to_confirmation_us: Percentiles::new(&self.confirmed),
            sync_to_sample_us: PerJoint::new(self.joints.each_ref().map(Percentiles::new)),
        }
    }

    /// Returns all classes with values, for a file.
    pub fn histograms(&self) -> HistogramReport {
        HistogramReport {
            largest_us: MAX_US,
            wake_up_late_us: classes(&self.wake_up),
            sync_to_last_sample_us: classes(&self.last_sample),
            step_us: classes(&self.step),
            sync_to_last_target_us: classes(&self.last_target),
            sync_to_confirmation_us: classes(&self.confirmed),
            sync_to_sample_us: self.joints.each_ref().map(classes),
        }
    }
}

impl LateCycle {
    /// Finds the longest step between the SYNC of the previous cycle and the last target of this one.
    fn from_times(cycle: u64, times: &CycleTimes, before: &CycleTimes) -> Self {
        let of_cycle = |times: &CycleTimes| {
            let sending = times.targets.saturating_sub(times.window + times.step);
            [
                (LateStep::Window, times.window),
                (LateStep::Step, times.step),
                (LateStep::Targets, sending),
            ]
        };
        let between = [(LateStep::Rest, times.rest), (LateStep::WakeUp, times.wake_up)];
        let steps = of_cycle(before).into_iter().chain(between).chain(of_cycle(times));
        let longest = steps.max_by_key(|(_, took)| *took);
        let (step, took) = longest.unwrap_or((LateStep::WakeUp, times.wake_up));
        Self { cycle, step, took }
    }
}

impl Percentiles {
    fn new(histogram: &Histogram<u32>) -> Self {
        let at = |quantile| histogram.value_at_quantile(quantile).min(MAX_US);
        let (count, max) = (histogram.len(), at(1.0));
        Self { count, p50: at(0.5), p99: at(0.99), p99_9: at(0.999), max }
    }
}

impl PerJoint {
    fn new(joints: [Percentiles; 6]) -> Self {
        Self {
            p50: joints.map(|of| of.p50),
            p99: joints.map(|of| of.p99),
            p99_9: joints.map(|of| of.p99_9),
            max: joints.map(|of| of.max),
        }
    }
}

impl fmt::Display for Percentiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { count, p50, p99, p99_9, max } = self;
        if *count == 0 {
            return f.write_str("no values");
        }
        write!(f, "{p50} µs, p99 {p99} µs, p99.9 {p99_9} µs, at most {max} µs")
    }
}

impl TimingReport {
    /// Returns each time with its name for people, without those of single joints.
    pub fn rows(&self) -> [(&'static str, Percentiles); 5] {
        [
            ("wake-up late", self.wake_up_late_us),
            ("SYNC to samples", self.sync_to_last_sample_us),
            ("controller step", self.step_us),
            ("SYNC to targets", self.sync_to_last_target_us),
            ("SYNC confirmed", self.sync_to_confirmation_us),
        ]
    }
}

/// Returns an empty histogram.
#[expect(clippy::expect_used, reason = "the bounds are constants, and every test here makes one")]
fn histogram() -> Histogram<u32> {
    Histogram::new_with_max(MAX_US, 2).expect("valid bounds")
}

/// Returns the classes that have values.
fn classes(histogram: &Histogram<u32>) -> Vec<Class> {
    let class = |value: u64, count: u32| {
        let from = histogram.lowest_equivalent(value);
        Class { from, to: histogram.highest_equivalent(value).min(MAX_US), count: count.into() }
    };
    let recorded = histogram.iter_recorded();
    recorded.map(|it| class(it.value_iterated_to(), it.count_at_value())).collect()
}

fn add(histogram: &mut Histogram<u32>, time: Option<Duration>) {
    if let Some(time) = time {
        histogram.saturating_record(u64::try_from(time.as_micros()).unwrap_or(MAX_US));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn micros(micros: u64) -> Duration {
        Duration::from_micros(micros)
    }

    /// Times of a cycle in time: its last target is sent 480 µs after SYNC.
    const USUAL: CycleTimes = CycleTimes {
        rest: Duration::from_micros(40),
        wake_up: Duration::from_micros(3),
        samples: [Some(Duration::from_micros(310)); 6],
        window: Duration::from_micros(320),
        step: Duration::from_micros(60),
        targets: Duration::from_micros(480),
        confirmed: Some(Duration::from_micros(50)),
    };

    #[test]
    fn longest_step_names_an_overrun() {
        let usual = USUAL;
        for (before, now, step, took) in [
            (usual, CycleTimes { wake_up: micros(2_900), ..usual }, LateStep::WakeUp, 2_900),
            (usual, CycleTimes { rest: micros(1_700), ..usual }, LateStep::Rest, 1_700),
            (
                CycleTimes { window: micros(990), targets: micros(1_200), ..usual },
                usual,
                LateStep::Window,
                990,
            ),
            (
                usual,
                CycleTimes { step: micros(1_300), targets: micros(1_700), ..usual },
                LateStep::Step,
                1_300,
            ),
            (usual, CycleTimes { targets: micros(1_600), ..usual }, LateStep::Targets, 1_220),
        ] {
            let overrun = LateCycle::from_times(9, &now, &before);
            assert_eq!((overrun.step, overrun.took), (step, micros(took)), "{overrun}");
        }
    }

    #[test]
    fn percentiles_have_two_digits_and_the_largest_value() {
        let mut timing = Timing::default();
        (1..=999)
            .for_each(|value| timing.add_times(&CycleTimes { wake_up: micros(value), ..USUAL }));
        timing.add_times(&CycleTimes {
            wake_up: Duration::from_secs(5),
            samples: [None; 6],
            ..USUAL
        });
        let TimingReport { wake_up_late_us: late, sync_to_last_sample_us: samples, .. } =
            timing.report();
        assert_eq!((late.count, late.max), (1_000, 1_000_000), "a longer time counts as a second");
        assert!((495..=505).contains(&late.p50) && (985..=1_000).contains(&late.p99), "{late:?}");
        assert_eq!(samples.count, 999, "the window without samples has no last one");
    }

    #[test]
    fn histograms_have_every_value_in_a_class() {
        let mut timing = Timing::default();
        for value in [3, 3, 3, 250, 251, 7_000_000] {
            timing.add_times(&CycleTimes { wake_up: micros(value), ..USUAL });
        }
        let report = timing.histograms();
        let class = |from, to, count| Class { from, to, count };
        // Two significant digits: classes of one up to 255 µs.
        let expected = [class(3, 3, 3), class(250, 250, 1), class(251, 251, 1)];
        let (last, classes) = report.wake_up_late_us.split_last().unwrap();
        assert_eq!(classes, expected);
        assert!(last.from <= MAX_US && last.to == MAX_US && last.count == 1, "{last:?}");
        let of_samples = report.sync_to_sample_us.each_ref().map(|of| of.iter().map(|it| it.count));
        assert_eq!(of_samples.map(Iterator::sum::<u64>), [6; 6]);
    }

    #[test]
    fn time_that_never_was_has_no_values() {
        let mut timing = Timing::default();
        timing.add_times(&CycleTimes { confirmed: None, ..USUAL });
        let rows = timing.report().rows();
        assert_eq!(rows[4].1.to_string(), "no values");
        assert!(rows[1].1.to_string().starts_with("311 µs, p99 311 µs"), "{}", rows[1].1);
    }
}
