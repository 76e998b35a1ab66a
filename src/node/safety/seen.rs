//! Which causes are still there: those that a watch has told of a moment ago.

use std::time::Duration;

use crate::cause::Cause;
use crate::cause::Kind;
use units::time::Instant;

/// A watch tells of what it sees in every cycle; what none has told of for so long is gone.
const GONE_AFTER: Duration = Duration::from_millis(20);

/// When a cause of each kind was last told of.
#[derive(Clone, Debug)]
pub(super) struct Seen {
    last: Vec<(Cause, Instant)>,
}

impl Seen {
    /// Nothing yet.
    pub(super) fn nothing() -> Self {
        Self { last: Vec::with_capacity(Kind::ALL.len()) }
    }

    /// A cause is there now.
    pub(super) fn note(&mut self, now: Instant, cause: Cause) {
        match self.last.iter_mut().find(|(known, _)| known.kind() == cause.kind()) {
            Some(known) => *known = (cause, now),
            None => self.last.push((cause, now)),
        }
    }

    /// The first that is still there, of the kinds that `matters`.
    pub(super) fn present(&self, now: Instant, matters: impl Fn(Kind) -> bool) -> Option<Cause> {
        let is_there =
            |(cause, at): &&(Cause, Instant)| now.since(*at) <= GONE_AFTER && matters(cause.kind());
        self.last.iter().find(is_there).map(|(cause, _)| *cause)
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
    fn a_cause_is_there_while_it_is_told_of_and_a_moment_longer() {
        let mut seen = Seen::nothing();
        let [first, second] =
            [Joint::of::<1>(), Joint::of::<2>()].map(|joint| Cause::Overspeed { joint });
        seen.note(at(0), first);
        seen.note(at(10), second);
        assert_eq!(seen.present(at(30), |_| true), Some(second));
        assert_eq!(seen.present(at(30), |kind| kind == Kind::LinkLost), None);
        assert_eq!(seen.present(at(31), |_| true), None);
    }
}
