//! Numbers and times in words, as people read them in a report.

use telemetry::digits::significant;

/// Greatest number that is shown as zero.
const NOISE: f64 = 1e-9;

/// Returns a number with three significant digits.
pub(crate) fn number(value: f64) -> String {
    if !value.is_finite() {
        return "\u{2013}".to_owned();
    }
    // Below this, a wrench or an energy is noise of the arithmetic.
    let rounded = if value.abs() < NOISE { 0.0 } else { significant(value, 3) };
    let is_small = rounded.abs() < 1e-4 && rounded.abs() >= NOISE;
    let text = if is_small || rounded.abs() >= 1e7 {
        format!("{rounded:e}")
    } else {
        format!("{rounded}")
    };
    text.replace('-', "\u{2212}")
}

/// Returns a number with its unit.
pub(crate) fn with_unit(value: f64, unit: &str) -> String {
    format!("{} {unit}", number(value))
}

/// Returns a count with a thin space between thousands.
pub(crate) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// Returns a count with its noun: one cycle, two cycles.
pub(crate) fn counted(value: u64, noun: &str) -> String {
    let plural = if value == 1 { "" } else { "s" };
    format!("{} {noun}{plural}", count(value))
}

/// Returns a duration: "59.999 s", "12 min 3 s", "1 h 0 min 4 s".
pub(crate) fn duration(seconds: f64) -> String {
    if !(seconds.is_finite() && seconds >= 60.0) {
        return with_unit_of(seconds);
    }
    let whole = seconds.round();
    let (hours, rest) = ((whole / 3_600.0).floor(), whole % 3_600.0);
    let (minutes, rest) = ((rest / 60.0).floor(), rest % 60.0);
    if hours > 0.0 {
        format!("{hours:.0} h {minutes:.0} min {rest:.0} s")
    } else {
        format!("{minutes:.0} min {rest:.0} s")
    }
}

fn with_unit_of(seconds: f64) -> String {
    if seconds.is_finite() { format!("{} s", trimmed(seconds)) } else { "\u{2013}".to_owned() }
}

/// Returns a time in a session, to a millisecond: "1.720 s", "12:03.450 min".
pub(crate) fn moment(seconds: f64) -> String {
    if !seconds.is_finite() {
        return "\u{2013}".to_owned();
    }
    if seconds < 120.0 {
        return format!("{seconds:.3} s");
    }
    let minutes = (seconds / 60.0).floor();
    let rest = seconds - minutes * 60.0;
    format!("{seconds:.3} s ({minutes:.0}:{rest:06.3} min)")
}

fn trimmed(value: f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    text.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_a_real_minus() {
        assert_eq!(
            [2.6249, 0.0, -31.82, 1.23e-7].map(number),
            ["2.62", "0", "\u{2212}31.8", "1.23e\u{2212}7"]
        );
        assert_eq!(number(f64::NAN), "\u{2013}");
        assert_eq!(count(3_600_000), "3\u{202f}600\u{202f}000");
        assert_eq!([counted(1, "stop"), counted(2, "stop")], ["1 stop", "2 stops"]);
    }

    #[test]
    fn durations_and_moments_are_readable() {
        assert_eq!(
            [19.999, 723.4, 3_604.0].map(duration),
            ["19.999 s", "12 min 3 s", "1 h 0 min 4 s"]
        );
        assert_eq!([1.719_665, 723.4501].map(moment), ["1.720 s", "723.450 s (12:03.450 min)"]);
    }
}
