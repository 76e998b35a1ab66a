//! Rate of the topics that are shown rather than computed with: `/tf`, status and torques. They are three fifths of a file that has every cycle.

use std::time::Duration;

use node::cause::Cause;
use node::record::Mode;
use units::time::Instant;

/// Interval of messages that are not of each cycle.
const INTERVAL: Duration = Duration::from_millis(10);

/// Rate of `/tf`, status and torques.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// First cycle of each 10 ms, and each change of mode or cause.
    Reduced,
    /// Every cycle.
    Full,
}

/// Selection of the cycles that have these messages.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decimation {
    pace: Pace,
    /// Interval, mode and cause of the last message.
    last: Option<(u128, State)>,
}

/// Mode of a cycle and its cause.
type State = (Mode, Option<Cause>);

impl Decimation {
    pub(crate) const fn new(pace: Pace) -> Self {
        Self { pace, last: None }
    }

    /// Returns whether the cycle at `at`, in this state, has messages.
    pub(crate) fn is_due(&mut self, at: Instant, state: State) -> bool {
        let interval = at.since(Instant::ZERO).as_nanos() / INTERVAL.as_nanos();
        let is_due = self.pace == Pace::Full || self.last != Some((interval, state));
        self.last = Some((interval, state));
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::numbering::Joint;

    const STOP: State = (Mode::ZeroTorque, Some(Cause::Overspeed { joint: Joint::of::<3>() }));

    /// Returns the cycles of a second at 1 kHz, with 40 µs of jitter, that are due; from cycle 777 on the node is stopped.
    fn due(pace: Pace) -> Vec<u64> {
        let mut decimation = Decimation::new(pace);
        let is_due = |cycle: &u64| {
            let jitter = if cycle.is_multiple_of(2) { 40 } else { 0 };
            let at = Instant::from_micros(1_000_020 + cycle * 1_000 - jitter);
            decimation.is_due(at, if *cycle < 777 { (Mode::Engaged, None) } else { STOP })
        };
        (0..1_000).filter(is_due).collect()
    }

    #[test]
    fn reduced_pace_is_100_hz_and_each_change_of_state() {
        let due = due(Pace::Reduced);
        assert!((101..=102).contains(&due.len()), "{due:?}");
        assert!(due.contains(&777), "{due:?}");
        let gaps: Vec<_> = due.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(gaps.iter().all(|gap| *gap <= 11), "{gaps:?}");
    }

    #[test]
    fn full_pace_is_every_cycle() {
        assert_eq!(due(Pace::Full).len(), 1_000);
    }
}
