//! Verdict on a replay, with its exit code.

use serde::Serialize;

use ::replay::{End, Outcome, Session};
use run::exit::Kind;

/// Verdict on a replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Verdict {
    /// All frames equal the recorded ones, to the end of the recording, or of the requested part.
    Equal,
    /// As [`Equal`](Self::Equal); the recording ends inside of a call, as that of a killed node.
    Cut,
    /// As [`Equal`](Self::Equal), up to inputs that the recorder has lost.
    Gap,
    /// Inputs that are invalid, missing or cut before the end of the recording.
    Damaged,
    /// No frame could be compared.
    Nothing,
    /// Other frames than the recorded ones.
    Differs,
}

impl Verdict {
    /// Judges the result of a replay.
    pub(super) fn new(outcome: &Outcome, session: &Session) -> Self {
        Self::from_end(outcome, session.is_finished())
    }

    /// Judges a result. A recording that `is_finished` has the inputs of its run to the end.
    const fn from_end(outcome: &Outcome, is_finished: bool) -> Self {
        let has_compared = outcome.cycles > 0 || outcome.frames > 0;
        match outcome.end {
            Some(End::Differs(_)) => Self::Differs,
            None => Self::Equal,
            Some(_) if !has_compared => Self::Nothing,
            Some(End::Complete) => Self::Equal,
            Some(End::Cut(_)) if is_finished => Self::Damaged,
            Some(End::Cut(_)) => Self::Cut,
            Some(End::Lost(..)) => Self::Gap,
            Some(End::Unreadable(..)) => Self::Damaged,
        }
    }

    /// Returns the kind of failure; `None` for a success. `is_strict`: the recording must be complete.
    pub(super) const fn failure(self, is_strict: bool) -> Option<Kind> {
        match self {
            Self::Equal => None,
            Self::Cut | Self::Gap if !is_strict => None,
            Self::Differs | Self::Cut | Self::Gap => Some(Kind::Negative),
            Self::Damaged | Self::Nothing => Some(Kind::File),
        }
    }

    /// Returns the verdict on an end with this text, in words.
    pub(super) fn words(self, end: &str) -> String {
        match self {
            Self::Nothing => {
                let reason = end.strip_prefix("as recorded; ").unwrap_or(end);
                format!("nothing was replayed: {reason}")
            }
            Self::Damaged => format!("damaged before its end: {end}"),
            Self::Equal | Self::Cut | Self::Gap | Self::Differs => end.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::replay::Place;

    const PLACE: Place = Place { call: None, cycle: 7 };

    fn verdict(cycles: u64, end: End, is_finished: bool) -> Verdict {
        let outcome = Outcome { cycles, end: Some(end), ..Outcome::default() };
        Verdict::from_end(&outcome, is_finished)
    }

    #[test]
    fn recording_that_is_cut_is_damaged_if_its_run_has_ended() {
        assert_eq!(verdict(7, End::Cut(PLACE), false), Verdict::Cut);
        assert_eq!(verdict(7, End::Cut(PLACE), true), Verdict::Damaged);
        assert_eq!(verdict(7, End::Lost(PLACE, 3), true), Verdict::Gap);
        assert_eq!(verdict(7, End::Complete, true), Verdict::Equal);
        for end in [End::Complete, End::Cut(PLACE), End::Lost(PLACE, 3)] {
            assert_eq!(verdict(0, end, false), Verdict::Nothing);
        }
    }

    #[test]
    fn each_verdict_has_its_exit_code() {
        let kinds = |is_strict| {
            use Verdict::{Cut, Damaged, Differs, Equal, Gap, Nothing};
            [Equal, Cut, Gap, Damaged, Nothing, Differs].map(|one| one.failure(is_strict))
        };
        let (file, negative) = (Some(Kind::File), Some(Kind::Negative));
        assert_eq!(kinds(false), [None, None, None, file, file, negative]);
        assert_eq!(kinds(true), [None, negative, negative, file, file, negative]);
    }
}
