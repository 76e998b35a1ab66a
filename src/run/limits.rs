//! Limits of a recording: size and time of a part, and total size.

use std::time::Duration;

use clap::Args;

/// Minimum limit of a part, in MB and in minutes.
const MIN_PART: f64 = 0.01;

/// Minimum limit of all parts, in GB.
const MIN_TOTAL: f64 = 0.001;

/// Maximum limit, in its unit.
const MAX_LIMIT: f64 = 1e6;

/// Limits of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Size of `bus.log` at which a part ends, in bytes.
    pub part_bytes: u64,
    /// Time after which a part ends.
    pub part_time: Duration,
    /// Size of all parts at which the recording ends, in bytes.
    pub total_bytes: u64,
}

impl Limits {
    /// No limits, so that the recording has one part.
    pub const NONE: Self =
        Self { part_bytes: u64::MAX, part_time: Duration::MAX, total_bytes: u64::MAX };

    /// Returns the reason of an end at the limit, in words.
    pub(super) fn reason(&self) -> String {
        let gigabytes = Duration::from_nanos(self.total_bytes).as_secs_f64();
        format!("its limit of {gigabytes} GB is reached (--record-limit)")
    }
}

/// Options of the limits.
#[derive(Clone, Copy, Debug, Args)]
pub struct LimitArgs {
    /// Size of bus.log at which the next part of the session begins, in MB.
    #[arg(long, value_name = "MB", requires = "record", default_value = "256", value_parser = megabytes, allow_negative_numbers = true)]
    pub part_size: u64,
    /// Time after which the next part begins, in minutes.
    #[arg(long, value_name = "MIN", requires = "record", default_value = "10", value_parser = minutes, allow_negative_numbers = true)]
    pub part_minutes: Duration,
    /// Size of the whole session at which the recording ends, in GB. The run goes on.
    #[arg(long, value_name = "GB", requires = "record", default_value = "100", value_parser = gigabytes, allow_negative_numbers = true)]
    pub record_limit: u64,
}

impl LimitArgs {
    /// Converts the options to bytes and time.
    pub const fn limits(&self) -> Limits {
        Limits {
            part_bytes: self.part_size,
            part_time: self.part_minutes,
            total_bytes: self.record_limit,
        }
    }
}

/// Parses a size in MB.
///
/// # Errors
/// Returns an error for other text, or a size out of range.
pub fn megabytes(text: &str) -> Result<u64, String> {
    // A byte is to a megabyte as a microsecond to a second.
    number(text, MIN_PART, 1.0).map(|size| u64::try_from(size.as_micros()).unwrap_or(u64::MAX))
}

/// Parses a time in minutes.
///
/// # Errors
/// Returns an error for other text, or a time out of range.
pub fn minutes(text: &str) -> Result<Duration, String> {
    number(text, MIN_PART, 60.0)
}

/// Parses a size in GB.
fn gigabytes(text: &str) -> Result<u64, String> {
    number(text, MIN_TOTAL, 1.0).map(|size| u64::try_from(size.as_nanos()).unwrap_or(u64::MAX))
}

/// Parses a number of units, as seconds.
fn number(text: &str, smallest: f64, unit: f64) -> Result<Duration, String> {
    let wrong = || format!("must be {smallest} to {MAX_LIMIT}, got {text}");
    let number = text.parse::<f64>().map_err(|_| wrong())?;
    match (smallest..=MAX_LIMIT).contains(&number) {
        true => Duration::try_from_secs_f64(number * unit).map_err(|_| wrong()),
        false => Err(wrong()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_in_their_units() {
        assert_eq!(megabytes("256"), Ok(256_000_000));
        assert_eq!(megabytes("0.05"), Ok(50_000));
        assert_eq!(gigabytes("0.5"), Ok(500_000_000));
        assert_eq!(gigabytes("0.001"), Ok(1_000_000));
        assert_eq!(minutes("2.5"), Ok(Duration::from_secs(150)));
        for wrong in ["", "0", "-1", "0.001", "1e9", "NaN", "inf", "ten"] {
            assert!(megabytes(wrong).unwrap_err().contains("must be 0.01 to 1000000"), "{wrong}");
        }
        let limits = Limits { total_bytes: 500_000_000, ..Limits::NONE };
        assert!(limits.reason().contains("limit of 0.5 GB"), "{}", limits.reason());
    }
}
