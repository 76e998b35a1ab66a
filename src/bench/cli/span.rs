//! Options for a part of a session, from one cycle or time to another.

use std::str::FromStr;

use clap::Args;

use signals::Cycle;

/// Options of a command that uses a part of a session.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(super) struct Span {
    /// First cycle, by its number in `bus.log`, or the time since time zero in s, as `2.5s`.
    #[arg(long, value_name = "PLACE")]
    from: Option<Place>,
    /// Last cycle, or the time of the last.
    #[arg(long, value_name = "PLACE")]
    to: Option<Place>,
}

/// Number of a cycle, or time in s since time zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    Cycle(u64),
    Seconds(f64),
}

impl FromStr for Place {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        let wrong = || format!("must be a cycle, as 5000, or a time, as 2.5s; got {word}");
        match word.strip_suffix('s') {
            Some(seconds) => {
                let seconds: f64 = seconds.parse().map_err(|_| wrong())?;
                let is_one = seconds.is_finite() && seconds >= 0.0;
                is_one.then_some(Self::Seconds(seconds)).ok_or_else(wrong)
            }
            None => word.parse().map(Self::Cycle).map_err(|_| wrong()),
        }
    }
}

impl Span {
    /// Returns whether a cycle is before the part.
    pub(super) fn is_before(&self, cycle: &Cycle<'_>) -> bool {
        match self.from {
            None => false,
            Some(Place::Cycle(first)) => cycle.number < first,
            Some(Place::Seconds(first)) => seconds(cycle) < first,
        }
    }

    /// Returns whether a cycle is after the part.
    pub(super) fn is_behind(&self, cycle: &Cycle<'_>) -> bool {
        match self.to {
            None => false,
            Some(Place::Cycle(last)) => cycle.number > last,
            Some(Place::Seconds(last)) => seconds(cycle) > last,
        }
    }
}

/// Returns the time of a cycle since time zero, in s.
pub(super) fn seconds(cycle: &Cycle<'_>) -> f64 {
    cycle.at.since(units::time::Instant::ZERO).as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn place_is_a_cycle_or_a_time() {
        assert_eq!("5000".parse(), Ok(Place::Cycle(5_000)));
        assert_eq!("2.5s".parse(), Ok(Place::Seconds(2.5)));
        for word in ["", "s", "-1s", "infs", "nans", "2.5", "5 s", "-1"] {
            let error = word.parse::<Place>().unwrap_err();
            assert!(error.contains("must be a cycle") && error.ends_with(word), "{error}");
        }
    }
}
