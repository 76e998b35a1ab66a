//! Part of a session: its first and last cycle, by number or by time.

use std::time::Duration;

use crate::span::Place;
use ::replay::FaultRecord;
use units::time::Instant;

/// Part of a session that is replayed, and whose frames are written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    first: Bound,
    last: Bound,
}

/// First or last cycle of a part.
#[derive(Clone, Copy, Debug)]
enum Bound {
    /// First or last cycle of the session.
    Session,
    /// Cycle with this number, as in `bus.log`. Frames between two cycles belong to the earlier one.
    Cycle(u64),
    /// First cycle whose SYNC was sent at this time or later.
    Time(Instant),
}

/// Number of a cycle, zero before the first, and time of its SYNC.
pub(super) type CycleMark = (u64, Option<Instant>);

impl Extent {
    /// Creates the part between two places. The defaults are the ends of the session, or of the fault record.
    pub(super) fn new(from: Option<Place>, to: Option<Place>, fault: Option<&FaultRecord>) -> Self {
        let of = |place: Option<Place>, time: Option<Instant>| match (place, time) {
            (Some(Place::Cycle(cycle)), _) => Bound::Cycle(cycle),
            (Some(Place::Seconds(seconds)), _) => Bound::Time(at(seconds)),
            (None, Some(time)) => Bound::Time(time),
            (None, None) => Bound::Session,
        };
        let first = of(from, fault.map(FaultRecord::begin));
        Self { first, last: of(to, fault.map(FaultRecord::end)) }
    }

    /// Returns whether a cycle is in the part or after it.
    pub(super) fn is_begun(&self, mark: CycleMark) -> bool {
        self.first.is_reached(mark).unwrap_or(true)
    }

    /// Returns whether a cycle is the last of the part, or after it.
    pub(super) fn is_over(&self, mark: CycleMark) -> bool {
        self.last.is_reached(mark).unwrap_or(false)
    }
}

impl Bound {
    /// Returns whether a cycle is at the bound or after it; `None` without a bound.
    fn is_reached(self, (cycle, at): CycleMark) -> Option<bool> {
        match self {
            Self::Session => None,
            Self::Cycle(bound) => Some(cycle >= bound),
            Self::Time(bound) => Some(at.unwrap_or(Instant::ZERO) >= bound),
        }
    }
}

/// Converts a time in s since time zero, saturating.
fn at(seconds: f64) -> Instant {
    let since = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
    Instant::ZERO + since
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extent_is_bounded_by_cycles_before_the_fault_record() {
        let at = |micros| Some(Instant::from_micros(micros));
        let fault = FaultRecord {
            session: "session".into(),
            cycle: 5_000,
            cause: "late".to_owned(),
            at: Instant::from_micros(5_000_000),
            seconds: 2.0,
            modes: ["engaged", "zero torque"].map(str::to_owned),
        };
        let whole = Extent::new(None, None, None);
        assert!(whole.is_begun((0, None)) && !whole.is_over((u64::MAX, at(u64::MAX))));
        let of_record = Extent::new(None, None, Some(&fault));
        assert!(!of_record.is_begun((0, None)) && !of_record.is_begun((2_999, at(2_999_999))));
        assert!(of_record.is_begun((3_000, at(3_000_000))));
        assert!(
            !of_record.is_over((5_999, at(5_999_999))) && of_record.is_over((6_000, at(6_000_000)))
        );
        let between = [10, 20].map(|cycle| Some(Place::Cycle(cycle)));
        let by_number = Extent::new(between[0], between[1], Some(&fault));
        assert!(!by_number.is_begun((9, at(0))) && by_number.is_begun((10, at(0))));
        assert!(!by_number.is_over((19, at(0))) && by_number.is_over((20, at(0))));
        let by_time = Extent::new(Some(Place::Seconds(0.5)), None, None);
        assert!(!by_time.is_begun((9, at(499_999))) && by_time.is_begun((9, at(500_000))));
    }
}
