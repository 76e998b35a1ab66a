//! Ticks of axes: round values, and round times in s, min or h.

use std::ops::Range;

/// Steps of a time axis from 1 s on, in s.
const TIME_STEPS: [f64; 17] = [
    1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 900.0, 1_800.0, 3_600.0, 7_200.0,
    14_400.0, 28_800.0, 86_400.0,
];

/// Length from which a time axis is in minutes, in s.
const MINUTES: f64 = 120.0;

/// Length from which a time axis is in hours, in s.
const HOURS: f64 = 7_200.0;

/// Maximum number of decimal places: the margin has space for no more.
const MAX_DIGITS: usize = 3;

/// Relative difference of values below which it is a rounding error, and the curve a constant.
const NOISE: f64 = 1e-9;

/// Maximum number of ticks of any range.
const MAX_TICKS: usize = 50;

/// Returns a round step (1, 2 or 5 times a power of ten) for at most `parts` parts of a length.
fn step(length: f64, parts: f64) -> f64 {
    let least = length / parts;
    let power = 10_f64.powi(exponent(least));
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= least * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * power
}

/// Returns the exponent of a positive number's leading digit.
fn exponent(value: f64) -> i32 {
    format!("{value:e}").split_once('e').and_then(|(_, power)| power.parse().ok()).unwrap_or(0)
}

/// Returns round values within a range, with their texts.
pub(crate) fn ticks(range: &Range<f64>, parts: f64) -> Vec<(f64, String)> {
    let length = range.end - range.start;
    if !(length.is_finite() && length > 0.0) {
        return Vec::new();
    }
    // In a range around zero, a single tick at zero would show no scale.
    let more = [1.0, 1.6, 2.5].map(|factor| step(length, factor * parts));
    let is_axis = |step: &f64| multiples(range, *step).count() > 1;
    let step = more.into_iter().find(is_axis).unwrap_or_else(|| step(length, parts));
    let digits = usize::try_from(-exponent(step)).unwrap_or(0);
    let is_large = range.start.abs().max(range.end.abs()) >= 1e5;
    multiples(range, step)
        .map(|value| {
            let text = if is_large || digits > MAX_DIGITS {
                scientific(value)
            } else {
                format!("{value:.digits$}")
            };
            (value, text.replace('-', "\u{2212}"))
        })
        .collect()
}

/// Returns a number with two digits and an exponent: 1.5e-7, 2e6, 0.
fn scientific(value: f64) -> String {
    if value.abs() < f64::MIN_POSITIVE {
        return "0".to_owned();
    }
    format!("{value:.1e}").replace(".0e", "e")
}

/// Returns the multiples of a step within a range.
fn multiples(range: &Range<f64>, step: f64) -> impl Iterator<Item = f64> {
    let (first, end) = ((range.start / step - 1e-6).ceil(), range.end / step + 1e-6);
    let counts = std::iter::successors(Some(first), |count| Some(count + 1.0));
    // Zero has no sign.
    counts
        .take(MAX_TICKS)
        .take_while(move |count| *count <= end)
        .map(move |count| count * step + 0.0)
}

/// Returns round times within a range in s, with their texts, and the name of the axis.
pub(crate) fn times(range: &Range<f64>, parts: f64) -> (Vec<(f64, String)>, &'static str) {
    let length = range.end - range.start;
    let least = length / parts;
    if length < MINUTES && least <= 1.0 || !length.is_finite() || length <= 0.0 {
        return (ticks(range, parts), "time in s");
    }
    let longest = TIME_STEPS.iter().copied().last().unwrap_or(1.0);
    let step = TIME_STEPS
        .into_iter()
        .find(|step| *step >= least)
        .unwrap_or_else(|| longest * step(length / longest, parts).ceil());
    let (unit, name) = if range.end < MINUTES {
        (1.0, "time in s")
    } else if range.end < HOURS {
        (60.0, "time in min:s")
    } else {
        (3_600.0, "time in h:min")
    };
    let text = |time: f64| {
        if unit < 2.0 {
            return format!("{time:.0}");
        }
        let whole = (time / unit + 1e-9).floor();
        let rest = (time - whole * unit) / (unit / 60.0);
        format!("{whole:.0}:{rest:02.0}")
    };
    (multiples(range, step).map(|time| (time, text(time))).collect(), name)
}

/// Returns the range of values with a margin; with zero if `has_zero`.
pub(crate) fn range(values: impl Iterator<Item = f64>, has_zero: bool) -> Range<f64> {
    let finite = values.filter(|value| value.is_finite());
    let ends = finite.fold(None, |ends: Option<(f64, f64)>, one| {
        Some(ends.map_or((one, one), |(low, high)| (low.min(one), high.max(one))))
    });
    let (mut low, mut high) = ends.unwrap_or((0.0, 1.0));
    if has_zero {
        (low, high) = (low.min(0.0), high.max(0.0));
    }
    // A constant is drawn as a line in the middle.
    if high - low <= NOISE * low.abs().max(high.abs()).max(1.0) {
        let margin = if high.abs() > 1e-6 { 0.1 * high.abs() } else { 1.0 };
        return low - margin..high + margin;
    }
    let margin = 0.06 * (high - low);
    low - margin..high + margin
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(ticks: Vec<(f64, String)>) -> Vec<String> {
        ticks.into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_round_and_within_the_range() {
        assert_eq!(texts(ticks(&(-1.1..2.2), 4.0)), ["\u{2212}1", "0", "1", "2"]);
        assert_eq!(texts(ticks(&(0.0..0.012), 3.0)), ["0.000", "0.005", "0.010"]);
        assert_eq!(
            texts(ticks(&(-2e-4..0.0), 2.0)),
            ["\u{2212}2e\u{2212}4", "\u{2212}1e\u{2212}4", "0"]
        );
        assert_eq!(texts(ticks(&(0.0..3e6), 2.0)), ["0", "2e6"]);
        assert_eq!(texts(ticks(&(3.0..3.0), 3.0)), [""; 0]);
        assert_eq!(ticks(&(0.0..f64::INFINITY), 3.0), []);
    }

    #[test]
    fn long_times_are_minutes_and_longer_ones_hours() {
        let (short, name) = times(&(0.0..20.0), 5.0);
        assert_eq!(
            (texts(short), name),
            (
                vec!["0", "5", "10", "15", "20"].into_iter().map(str::to_owned).collect(),
                "time in s"
            )
        );
        let (hour, name) = times(&(0.0..3_600.0), 7.0);
        assert_eq!(name, "time in min:s");
        assert_eq!(texts(hour), ["0:00", "10:00", "20:00", "30:00", "40:00", "50:00", "60:00"]);
        let (day, name) = times(&(0.0..86_400.0), 7.0);
        assert_eq!(name, "time in h:min");
        assert_eq!(texts(day), ["0:00", "4:00", "8:00", "12:00", "16:00", "20:00", "24:00"]);
    }

    #[test]
    fn ranges_have_a_margin_and_never_no_height() {
        assert_eq!(range([1.0, f64::NAN, 2.0].into_iter(), false), 0.94..2.06);
        assert_eq!(range([5.0, 5.0].into_iter(), false), 4.5..5.5);
        assert_eq!(range([0.0].into_iter(), true), -1.0..1.0);
        assert_eq!(range([-1e-17, 1e-16].into_iter(), true), -1.0 - 1e-17..1.0 + 1e-16);
        let with_zero = range([1.0, 2.0].into_iter(), true);
        assert!(with_zero.contains(&0.0), "{with_zero:?}");
    }
}
