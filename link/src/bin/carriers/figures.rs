//! Record of one end, and its quantiles. All times are in µs.

use crate::Outcome;

/// Record of one end.
#[derive(Clone, Debug, Default)]
pub(crate) struct Record {
    /// Send times; the first is of message 1.
    pub(crate) sent: Vec<u64>,
    /// Messages received: send time, and age at reception.
    pub(crate) received: Vec<(u64, u64)>,
    /// Messages received: time, and time since the message was sent that they echo.
    pub(crate) round_trips: Vec<(u64, u64)>,
    /// Cycles: time, and age by echo of the newest sample.
    pub(crate) cycles: Vec<(u64, u64)>,
    /// Time from which the far side holds without a fresh command.
    pub(crate) held_at: Option<u64>,
    /// Maximum time in which zenoh accepted a message.
    pub(crate) longest_put: u64,
    /// Times at which the subscriber was declared again.
    pub(crate) declared_again: Vec<u64>,
}

/// Figures of one direction.
#[derive(Clone, Debug, Default)]
pub(crate) struct Direction {
    /// Messages sent by this end.
    pub(crate) sent: u64,
    /// Ages at reception of the messages that this end received.
    pub(crate) ages: Vec<u64>,
    /// Maximum time in which zenoh accepted a message.
    pub(crate) longest_put: u64,
    /// Number of times that the subscriber was declared again.
    pub(crate) declared_again: u32,
    /// Set if the far side held without a fresh command.
    pub(crate) is_held: bool,
}

impl Direction {
    /// Computes the figures of messages sent in `from..to`.
    pub(crate) fn from_record(record: &Record, (from, to): (u64, u64)) -> Outcome<Self> {
        let sent = record.sent.iter().filter(|at| (from..to).contains(*at)).count();
        let is_held = record.held_at.is_some_and(|at| (from..to).contains(&at));
        let declared_again = record.declared_again.iter().filter(|at| **at < to).count();
        let declared_again = u32::try_from(declared_again)?;
        let longest_put = record.longest_put;
        let ages = within(&record.received, from, to);
        Ok(Self { sent: u64::try_from(sent)?, ages, longest_put, declared_again, is_held })
    }

    /// Formats the figures as one line, for the other process.
    pub(crate) fn line(&self) -> String {
        let Self { sent, longest_put, declared_again, is_held, ages } = self;
        let first = format!("{sent} {longest_put} {declared_again} {}", u8::from(*is_held));
        let ages = ages.iter().map(u64::to_string);
        std::iter::once(first).chain(ages).collect::<Vec<_>>().join(" ")
    }

    /// Parses such a line.
    pub(crate) fn from_line(line: &str) -> Outcome<Self> {
        let numbers: Result<Vec<u64>, _> = line.split_whitespace().map(str::parse).collect();
        let numbers = numbers.map_err(|error| format!("far side: {error}: {line}"))?;
        let [sent, longest_put, declared_again, is_held, ages @ ..] = numbers.as_slice() else {
            return Err("the far side sent no figures".into());
        };
        Ok(Self {
            sent: *sent,
            longest_put: *longest_put,
            declared_again: u32::try_from(*declared_again)?,
            is_held: *is_held != 0,
            ages: ages.to_vec(),
        })
    }
}

/// Second numbers of the pairs whose first is in `from..to`.
pub(crate) fn within(pairs: &[(u64, u64)], from: u64, to: u64) -> Vec<u64> {
    pairs.iter().filter(|(at, _)| (from..to).contains(at)).map(|(_, value)| *value).collect()
}

/// Cell of a row: `p50 / p99 / max` in ms.
pub(crate) fn quantiles(mut values: Vec<u64>) -> String {
    values.sort_unstable();
    let at = |percent: usize| {
        let place = (values.len() * percent).div_ceil(100).saturating_sub(1);
        values.get(place).map_or_else(|| "–".to_owned(), |value| millis(*value))
    };
    format!("{} / {} / {}", at(50), at(99), at(100))
}

/// Time in ms, with one decimal place.
pub(crate) fn millis(micros: u64) -> String {
    let tenths = (micros + 50) / 100;
    format!("{}.{}", tenths / 10, tenths % 10)
}

/// Share in per cent, with one decimal place.
pub(crate) fn share(part: u64, whole: u64) -> String {
    let tenths = (part * 1_000 + whole / 2).checked_div(whole).unwrap_or_default();
    format!("{}.{}", tenths / 10, tenths % 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_a_hundred_values_are_its_places() {
        assert_eq!(quantiles((1..=100).map(|ms| ms * 1_000).collect()), "50.0 / 99.0 / 100.0");
        assert_eq!(quantiles(Vec::new()), "– / – / –");
    }

    #[test]
    fn figures_survive_the_way_to_the_other_process() {
        let record = Record {
            sent: vec![5, 10, 20],
            received: vec![(9, 1), (10, 2), (19, 3)],
            held_at: Some(12),
            declared_again: vec![1, 25],
            ..Record::default()
        };
        let direction = Direction::from_record(&record, (10, 20)).unwrap_or_default();
        assert_eq!((direction.sent, direction.ages.as_slice()), (1, [2, 3].as_slice()));
        assert!(direction.is_held && direction.declared_again == 1);
        let read = Direction::from_line(&direction.line()).unwrap_or_default();
        assert_eq!(read.line(), direction.line());
    }

    #[test]
    fn shares_and_times_are_rounded() {
        assert_eq!((share(2, 3), share(0, 0)), ("66.7".to_owned(), "0.0".to_owned()));
        assert_eq!(millis(1_950), "2.0");
    }
}
