//! Amounts of work, and times, in words.

use std::time::Duration;

/// Unit of an amount of work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Things of this name, in the plural.
    Count(&'static str),
    /// Bytes, shown in MB.
    Bytes,
}

impl From<&'static str> for Unit {
    fn from(name: &'static str) -> Self {
        Self::Count(name)
    }
}

impl Unit {
    /// Returns `12/200 faults`, or `1.5/3.0 MB`, with `between` in the place of `/`.
    pub(super) fn amount(self, done: u64, total: Option<u64>, between: &str) -> String {
        let number = |amount: u64| match self {
            Self::Count(_) => amount.to_string(),
            Self::Bytes => format!("{}.{}", amount / 1_000_000, amount / 100_000 % 10),
        };
        let total = total.map_or_else(String::new, |total| format!("{between}{}", number(total)));
        let name = match self {
            Self::Count(name) => name,
            Self::Bytes => "MB",
        };
        format!("{}{total} {name}", number(done))
    }
}

/// Returns a time in words, rounded down: `12 s`, `2 min 05 s`, `1 h 02 min`.
pub(super) fn words(time: Duration) -> String {
    let seconds = time.as_secs();
    match (seconds / 3_600, seconds / 60 % 60, seconds % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds:02} s"),
        (hours, minutes, _) => format!("{hours} h {minutes:02} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_have_their_unit_and_bytes_are_mb() {
        assert_eq!(Unit::from("faults").amount(12, Some(200), "/"), "12/200 faults");
        assert_eq!(Unit::from("cycles").amount(12, None, "/"), "12 cycles");
        assert_eq!(Unit::Bytes.amount(1_550_000, Some(3_000_000), " of "), "1.5 of 3.0 MB");
    }

    #[test]
    fn times_have_two_units_at_most() {
        let said = [0, 59, 60, 125, 3_600, 90_061].map(|s| words(Duration::from_secs(s)));
        assert_eq!(said, ["0 s", "59 s", "1 min 00 s", "2 min 05 s", "1 h 00 min", "25 h 01 min"]);
    }
}
