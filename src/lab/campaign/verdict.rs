//! What one case came to, and whether that is what is demanded.

use std::fmt;
use std::time::Duration;

use crate::campaign::case::Case;
use crate::campaign::injection::Expectation;
use crate::campaign::injection::MayStop;
use crate::campaign::monitor::Breach;
use node::cause::Cause;
use node::cause::Kind as CauseKind;

/// What was seen of one case. Times are since its onset.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// Until the node was latched, if it was.
    pub detected: Option<Duration>,
    /// Whether torque is off by its latch, not reflection alone.
    pub is_stopped: bool,
    /// Why it was latched.
    pub cause: Option<Cause>,
    /// From the stop until the last drive's power stage was off, if it was.
    pub off: Option<Duration>,
    /// Until the node switched the drives off, if it did.
    pub given_up: Option<Duration>,
    /// A drive's power stage was on for longer than 100 ms after zero torque, or after "drives off".
    pub is_left_on: bool,
    /// Until every drive was told zero, if it was for good.
    pub zero: Option<Duration>,
    /// Until no drive asked its motor for torque, if that lasted.
    pub quiet: Option<Duration>,
    /// Until nothing but the arm's weight was felt, if that lasted.
    pub felt: Option<Duration>,
    /// Cycles between the first and the last joint that was torn from a torque to none.
    pub spread: Option<u64>,
    /// All that the motors pushed, in N·m·s (N·s).
    pub impulse: f64,
    /// The largest share of its capacity that a joint was told, 0 to 1.
    pub peak: f64,
    /// The grip's highest speed, in m/s.
    pub speed: f64,
    /// How far the grip came from where it was, in m.
    pub travel: f64,
    /// Targets that were not zero, and more than two periods old on the wire.
    pub stale: u64,
    /// Cycles in which a drive acted on such a target.
    pub applied: u64,
    /// The oldest target that a drive acted on: from when the node gave it away until it began to act.
    pub oldest: Duration,
    /// Targets that were not zero although nothing was armed.
    pub unarmed: u64,
    /// The first few breaches of a law.
    pub breaches: Vec<Breach>,
    /// All of them.
    pub breach_count: u64,
}

/// What is to be said of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The case's number.
    pub number: u32,
    /// What kind of fault it was.
    pub kind: &'static str,
    /// The hazard it stands for.
    pub row: u8,
    /// The hand controller: a place in the campaign's list.
    pub config: usize,
    /// Its cycle.
    pub period: Duration,
    /// What was expected.
    pub expectation: Expectation,
    /// What was seen.
    pub seen: Seen,
    /// Whether that is what was demanded.
    pub outcome: Outcome,
}

/// Whether it went as demanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Yes.
    Met,
    /// It was not seen at all.
    Missed,
    /// It was seen, and not answered in time.
    Late,
    /// It stopped without need.
    FalseTrip,
    /// It stopped, and not because of what was wrong.
    WrongCause,
    /// It stopped, and a drive's power stage stayed on.
    LeftOn,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Met => "as demanded",
            Self::Missed => "missed",
            Self::Late => "late",
            Self::FalseTrip => "false trip",
            Self::WrongCause => "wrong cause",
            Self::LeftOn => "a drive left on",
        })
    }
}

impl Verdict {
    /// Judges what was seen of a case.
    pub fn of(case: &Case, period: Duration, seen: Seen) -> Self {
        Self {
            number: case.number,
            kind: case.kind.name,
            row: case.kind.row,
            config: case.config,
            period,
            expectation: case.injection.expectation,
            outcome: outcome(case.injection.expectation, case.kind.causes, &seen),
            seen,
        }
    }

    /// Whether nothing is wrong with it: neither its outcome nor any law.
    pub const fn is_good(&self) -> bool {
        let is_met = matches!(self.outcome, Outcome::Met);
        let may_act = matches!(self.expectation, Expectation::Either(_));
        is_met && self.seen.breach_count == 0 && (may_act || self.seen.applied == 0)
    }

    /// The time that was demanded of: until zero, silence or letting go.
    pub const fn time(&self) -> Option<Duration> {
        match self.expectation {
            Expectation::Stop(_) | Expectation::Zero(_) => self.seen.zero,
            Expectation::Release(_) | Expectation::Mute(..) => self.seen.quiet,
            Expectation::LetGo(_) | Expectation::Disengage(..) => self.seen.felt,
            Expectation::GoOn | Expectation::Either(_) => None,
        }
    }
}

/// Compares what was seen with a expectation, and the cause of a stop with those that may be.
fn outcome(expectation: Expectation, causes: &[CauseKind], seen: &Seen) -> Outcome {
    let is_wrong = |cause: &Cause| !causes.contains(&cause.kind());
    let outcome = timely(expectation, seen);
    if outcome != Outcome::Met {
        outcome
    } else if seen.cause.as_ref().is_some_and(is_wrong) {
        Outcome::WrongCause
    // Where either may be, strangers may command the drives as well.
    } else if seen.is_left_on && !matches!(expectation, Expectation::Either(_)) {
        Outcome::LeftOn
    } else {
        Outcome::Met
    }
}

/// Compares only what happened, and when.
fn timely(expectation: Expectation, seen: &Seen) -> Outcome {
    let is_latched = seen.detected.is_some();
    let in_time = |time: Option<Duration>, within: Duration| match time {
        Some(time) if time <= within => Outcome::Met,
        Some(_) | None => Outcome::Late,
    };
    match expectation {
        Expectation::Stop(_) if !seen.is_stopped => Outcome::Missed,
        Expectation::Release(_) | Expectation::LetGo(_) if !is_latched => Outcome::Missed,
        Expectation::Mute(_, given_up) if seen.given_up.is_none_or(|time| time > given_up) => {
            Outcome::Missed
        }
        Expectation::Zero(_) | Expectation::Disengage(_, MayStop::No) | Expectation::GoOn
            if is_latched =>
        {
            Outcome::FalseTrip
        }
        Expectation::LetGo(within) if seen.detected.is_some_and(|time| time > within) => {
            Outcome::Late
        }
        Expectation::Stop(within) | Expectation::Zero(within) => in_time(seen.zero, within),
        Expectation::Release(within) | Expectation::Mute(within, _) => in_time(seen.quiet, within),
        Expectation::LetGo(within) | Expectation::Disengage(within, _) => {
            in_time(seen.felt, within)
        }
        Expectation::GoOn | Expectation::Either(_) => Outcome::Met,
    }
}

/// As in `within 5 ms`.
impl fmt::Display for Expectation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let millis = |time: &Duration| time.as_secs_f64() * 1e3;
        match self {
            Self::Stop(within) => write!(f, "all zero and latched within {:.1} ms", millis(within)),
            Self::Zero(within) => write!(f, "all zero within {:.1} ms", millis(within)),
            Self::Release(within) => {
                write!(f, "drives torque-free within {:.1} ms", millis(within))
            }
            Self::Mute(within, given_up) => write!(
                f,
                "drives torque-free within {:.1} ms, bus given up within {:.1} ms",
                millis(within),
                millis(given_up)
            ),
            Self::LetGo(within) => write!(f, "reflection off within {:.1} ms", millis(within)),
            Self::Disengage(within, _) => write!(f, "nothing felt after {:.1} ms", millis(within)),
            Self::GoOn => f.write_str("goes on"),
            Self::Either(why) => write!(f, "either way: {why}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::numbering::Joint;

    const WITHIN: Duration = Duration::from_millis(5);
    const CAUSES: &[CauseKind] = &[CauseKind::SamplesMissing];

    /// A stop in time, by this cause.
    fn stopped_by(cause: Cause) -> Seen {
        let time = Some(Duration::from_millis(4));
        Seen {
            detected: time,
            is_stopped: true,
            cause: Some(cause),
            off: time,
            given_up: None,
            is_left_on: false,
            zero: time,
            quiet: time,
            felt: time,
            spread: None,
            impulse: 0.0,
            peak: 0.0,
            speed: 0.0,
            travel: 0.0,
            stale: 0,
            oldest: Duration::ZERO,
            applied: 0,
            unarmed: 0,
            breaches: Vec::new(),
            breach_count: 0,
        }
    }

    const ELBOW: Joint = Joint::of::<3>();
    const MISSING: Cause = Cause::SamplesMissing { joint: ELBOW, cycles: 3 };

    #[test]
    fn stop_by_another_cause_is_a_wrong_cause() {
        for expectation in
            [Expectation::Stop(WITHIN), Expectation::Release(WITHIN), Expectation::Either("")]
        {
            let right = stopped_by(MISSING);
            assert_eq!(outcome(expectation, CAUSES, &right), Outcome::Met, "{expectation:?}");
            let wrong = stopped_by(Cause::Overspeed { joint: ELBOW });
            assert_eq!(
                outcome(expectation, CAUSES, &wrong),
                Outcome::WrongCause,
                "{expectation:?}"
            );
        }
    }

    #[test]
    fn drive_left_on_after_a_stop_is_a_failure() {
        let left_on = Seen { is_left_on: true, ..stopped_by(MISSING) };
        assert_eq!(outcome(Expectation::Stop(WITHIN), CAUSES, &left_on), Outcome::LeftOn);
    }

    #[test]
    fn bus_not_given_up_in_time_is_missed() {
        let expectation = Expectation::Mute(WITHIN, WITHIN);
        let seen = stopped_by(MISSING);
        assert_eq!(outcome(expectation, CAUSES, &seen), Outcome::Missed);
        let given_up = |millis| Some(Duration::from_millis(millis));
        let in_time = Seen { given_up: given_up(5), ..seen.clone() };
        assert_eq!(outcome(expectation, CAUSES, &in_time), Outcome::Met);
        let late = Seen { given_up: given_up(6), ..seen };
        assert_eq!(outcome(expectation, CAUSES, &late), Outcome::Missed);
    }
}
