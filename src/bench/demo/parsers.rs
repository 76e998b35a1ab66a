//! Parsers of times and speeds on the command line.

/// Parses a duration in s, above 0 and at most a day.
///
/// # Errors
/// Returns what it must be.
pub fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| *seconds > 0.0 && *seconds <= 86_400.0);
    seconds.ok_or_else(|| "must be a number above 0 and at most 86400".to_owned())
}

/// Parses a multiple of real time, 0.01 to 100.
pub(crate) fn speed(text: &str) -> Result<f64, String> {
    let speed = text.parse::<f64>().ok().filter(|speed| (0.01..=100.0).contains(speed));
    speed.ok_or_else(|| "must be a number from 0.01 to 100".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_are_above_zero_and_at_most_a_day() {
        assert_eq!([seconds("0.5"), seconds("86400")], [Ok(0.5), Ok(86_400.0)]);
        for text in ["-1", "0", "-0.0", "nan", "inf", "-inf", "1e300", "86400.1", "", "x"] {
            assert!(seconds(text).is_err(), "{text}");
        }
    }
}
