//! Causes that are still active: those raised within the last 20 ms.

use std::time::Duration;

use crate::cause::{Cause, CauseKind};
use units::time::Instant;

/// Time for which a cause stays active after it was last raised. The node raises it in every cycle in which its watch
/// returns it.
const HOLD_TIME: Duration = Duration::from_millis(20);

/// Newest cause of each kind, with the time it was last raised.
#[derive(Clone, Debug)]
pub(super) struct ActiveCauses {
    last: Vec<(Cause, Instant)>,
}

impl ActiveCauses {
    /// No active cause. Reserves space for all kinds, so that the cycle does not allocate.
    pub(super) fn new() -> Self {
        Self { last: Vec::with_capacity(CauseKind::ALL.len()) }
    }

    /// Marks a cause as active from `now` on.
    pub(super) fn raise(&mut self, now: Instant, cause: Cause) {
        match self.last.iter_mut().find(|(known, _)| known.kind() == cause.kind()) {
            Some(known) => *known = (cause, now),
            None => self.last.push((cause, now)),
        }
    }

    /// Returns the first active cause whose kind `matters`.
    pub(super) fn first(&self, now: Instant, matters: impl Fn(CauseKind) -> bool) -> Option<Cause> {
        let is_active =
            |(cause, at): &&(Cause, Instant)| now.since(*at) <= HOLD_TIME && matters(cause.kind());
        self.last.iter().find(is_active).map(|(cause, _)| *cause)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::numbering::Joint;

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    #[test]
    fn cause_stays_active_for_20_ms_after_it_was_last_raised() {
        let mut active = ActiveCauses::new();
        let [first, second] =
            [Joint::of::<1>(), Joint::of::<2>()].map(|joint| Cause::Overspeed { joint });
        active.raise(at(0), first);
        active.raise(at(10), second);
        assert_eq!(active.first(at(30), |_| true), Some(second));
        assert_eq!(active.first(at(30), |kind| kind == CauseKind::LinkLost), None);
        assert_eq!(active.first(at(31), |_| true), None);
    }
}
