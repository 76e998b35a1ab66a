//! Times of the steps of all cycles, as histograms.

use hdrhistogram::Histogram as Counts;

use node::cycle_times::CycleTimes;
use picture::histogram::{Bar, Histogram};

/// Largest time that is counted as such, in µs; longer ones count as this.
const LARGEST: u64 = 1_000_000;

/// Number of bars of a picture.
const BARS: u64 = 70;

/// Names of the times, in the order of a cycle.
pub(crate) const NAMES: [(&str, &str); 4] = [
    ("Wake-up", "from SYNC due to the wake-up for it"),
    ("Samples", "from SYNC to the last joint's sample"),
    ("Step", "watches and controller"),
    ("Last target", "from SYNC to the last target accepted by its bus"),
];

/// Histograms of the times of all cycles.
#[derive(Clone, Debug)]
pub(crate) struct Timing {
    counts: [Counts<u32>; 4],
}

impl Timing {
    /// Creates empty histograms; `None` if their bounds were invalid.
    pub(crate) fn new() -> Option<Self> {
        let counts = || Counts::new_with_max(LARGEST, 2).ok();
        Some(Self { counts: [counts()?, counts()?, counts()?, counts()?] })
    }

    /// Counts wake-up, samples, step and targets of a cycle. Samples count only if all joints have one.
    pub(crate) fn add(&mut self, times: &CycleTimes) {
        let is_complete = times.samples.iter().all(Option::is_some);
        let samples = times.samples.iter().flatten().max().copied().filter(|_| is_complete);
        let values = [Some(times.wake_up), samples, Some(times.step), Some(times.targets)];
        for (counts, value) in self.counts.iter_mut().zip(values) {
            if let Some(value) = value {
                counts.saturating_record(u64::try_from(value.as_micros()).unwrap_or(LARGEST));
            }
        }
    }

    /// Returns the number of values, and percentiles 50, 99 and 99.9 and the greatest value, in µs, of each time.
    pub(crate) fn percentiles(&self) -> [(u64, [u64; 4]); 4] {
        self.counts.each_ref().map(|counts| {
            let at = |quantile| counts.value_at_quantile(quantile).min(LARGEST);
            (counts.len(), [at(0.5), at(0.99), at(0.999), counts.max().min(LARGEST)])
        })
    }

    /// Returns whether the time at a place is above zero in any cycle. In virtual time, computing takes no time.
    pub(crate) fn is_used(&self, place: usize) -> bool {
        self.counts.get(place).is_some_and(|counts| counts.max() > 0)
    }

    /// Returns the histogram of the time at a place.
    pub(crate) fn histogram(&self, place: usize) -> Option<Histogram> {
        let (counts, (name, _)) = (self.counts.get(place)?, NAMES.get(place)?);
        let (_, [p50, p99, p99_9, max]) = *self.percentiles().get(place)?;
        let width = (max / BARS + 1).max(1);
        let mut bars: Vec<Bar> = Vec::new();
        for value in counts.iter_recorded() {
            let from = value.value_iterated_to() / width * width;
            let count = u64::from(value.count_at_value());
            match bars.last_mut() {
                Some(bar) if bar.from.to_bits() == float(from).to_bits() => bar.count += count,
                _ => bars.push(Bar { from: float(from), to: float(from + width), count }),
            }
        }
        let marks = [("p50", p50), ("p99", p99), ("p99.9", p99_9), ("max", max)];
        let marks = marks.map(|(name, value)| (format!("{name} {value}"), float(value)));
        Some(Histogram {
            title: (*name).to_owned(),
            axis: "time in µs".to_owned(),
            bars,
            marks: marks.to_vec(),
        })
    }
}

fn float(value: u64) -> f64 {
    f64::from(u32::try_from(value).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn bars_have_every_value_once() {
        let mut timing = Timing::new().unwrap();
        for micros in 0..5_000 {
            let step = Duration::from_micros(micros);
            timing.add(&CycleTimes { step, ..CycleTimes::default() });
        }
        let histogram = timing.histogram(2).unwrap();
        assert_eq!(histogram.bars.iter().map(|bar| bar.count).sum::<u64>(), 5_000);
        assert!(histogram.bars.len() <= 71, "{}", histogram.bars.len());
        assert!(timing.is_used(2) && !timing.is_used(0) && !timing.is_used(1));
        assert_eq!(timing.percentiles()[1].0, 0);
    }
}
