//! Verdict on a case: its observation, compared with its criterion.

use std::time::Duration;

use derive_more::Display;

use crate::case::Case;
use crate::criterion::{Criterion, MayStop};
use crate::expectation::{self, EndState};
use crate::injection::Injection;
use crate::monitor::{Violation, stale};
use crate::timers;
use config::Config;
use node::cause::{Cause, CauseKind};

/// Observation of one case. Times start at its onset.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Observation {
    /// Time until the node was latched.
    pub detected: Option<Duration>,
    /// Set if the latched mode ends all torque (S2 or S3), not only reflection (S1).
    pub is_stopped: bool,
    /// Cause of the latched mode.
    pub cause: Option<Cause>,
    /// State of the drives after the node's first latched mode.
    pub end_state: Option<EndState>,
    /// Time from the stop until the last drive's power stage was off.
    pub off: Option<Duration>,
    /// Time until the node switched the drives off.
    pub drives_off: Option<Duration>,
    /// Set if a power stage was on for longer than 100 ms after zero torque, or after "drives off".
    pub is_left_on: bool,
    /// Time from which every target torque stayed zero.
    pub zero: Option<Duration>,
    /// Time from which no drive exerted torque.
    pub torque_free: Option<Duration>,
    /// Time from which reflection stayed off.
    pub reflection_off: Option<Duration>,
    /// Cycles between the first and the last joint whose torque was cut to zero.
    pub spread: Option<u64>,
    /// Impulse of all motors, in N·m·s (N·s).
    pub impulse: f64,
    /// Largest target torque as a share of its joint's capacity, 0 to 1.
    pub peak: f64,
    /// Highest speed of the grip, in m/s.
    pub speed: f64,
    /// Largest displacement of the grip, in m.
    pub travel: f64,
    /// Number of non-zero targets that were more than two periods old on the wire.
    pub stale: u64,
    /// Number of cycles in which a drive acted on a target more than two periods old.
    pub applied: u64,
    /// Maximum age of a target, since the node sent it, when a drive began to act on it.
    pub oldest: Duration,
    /// Number of non-zero targets without arming.
    pub unarmed: u64,
    /// Maximum error of a joint position in the first armed cycle, in rad or m.
    pub armed_error: Option<f64>,
    /// First violations of an invariant.
    pub violations: Vec<Violation>,
    /// Number of all violations.
    pub violation_count: u64,
}

/// Verdict on a case.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Number of the case.
    pub number: u32,
    /// Name of the kind of fault.
    pub kind: &'static str,
    /// Number of the hazard.
    pub hazard: u8,
    /// Hand controller, as an index into the campaign's list.
    pub config: usize,
    /// Cycle period.
    pub period: Duration,
    /// Maximum age of a torque that may act.
    pub max_age: Duration,
    /// Required reaction.
    pub criterion: Criterion,
    /// Observed reaction.
    pub observed: Observation,
    /// Comparison of both reactions.
    pub outcome: Outcome,
}

/// Comparison of the observed with the required reaction.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Outcome {
    /// Reaction as the criterion requires.
    #[display("as demanded")]
    Met,
    /// Fault that was not detected.
    #[display("missed")]
    Missed,
    /// Reaction after its time limit.
    #[display("late")]
    Late,
    /// Stop without a reason.
    #[display("false trip")]
    FalseTrip,
    /// Stop by a cause that is not one of the kind.
    #[display("wrong cause")]
    WrongCause,
    /// Stop in a milder state than its cause demands.
    #[display("wrong end state")]
    WrongState,
    /// Stop that left a drive's power stage on.
    #[display("a drive left on")]
    LeftOn,
}

impl Verdict {
    /// Compares the observation of a case with a criterion: its own, or a milder one if the fault had no effect.
    pub fn new(case: &Case, criterion: Criterion, config: &Config, observed: Observation) -> Self {
        Self {
            number: case.number,
            kind: case.kind.name,
            hazard: case.kind.hazard,
            config: case.config,
            period: config.period,
            max_age: max_age(config, &case.injection),
            criterion,
            outcome: outcome(criterion, case.kind.causes, &observed),
            observed,
        }
    }

    /// Returns whether the criterion is met and no invariant violated.
    pub fn is_good(&self) -> bool {
        let is_met = matches!(self.outcome, Outcome::Met);
        is_met && self.observed.violation_count == 0 && self.observed.oldest <= self.max_age
    }

    /// Returns the time that the criterion limits.
    pub const fn limited_time(&self) -> Option<Duration> {
        match self.criterion {
            Criterion::Stop(_) | Criterion::ZeroTorque(_) => self.observed.zero,
            Criterion::TorqueFree(_) | Criterion::BusAbandoned(..) => self.observed.torque_free,
            Criterion::ReflectionOff(_) | Criterion::Disengaged(..) => self.observed.reflection_off,
            Criterion::Armed(_) | Criterion::Unarmed | Criterion::GoesOn | Criterion::Either(_) => {
                None
            }
        }
    }
}

/// Returns the maximum age of a torque that may act. With RPDO timers it is two periods after a stop; other drives hold a
/// torque until the next SYNC, or until their other timer expires.
fn max_age(config: &Config, injection: &Injection) -> Duration {
    let is_brief = matches!(injection.criterion, Criterion::Either(_));
    match timers::rpdo(config) {
        Some(_) if !is_brief => stale(config.period),
        Some(_) | None => timers::oldest_torque(config),
    }
}

/// Compares reaction, cause and end state.
fn outcome(criterion: Criterion, causes: &[CauseKind], observed: &Observation) -> Outcome {
    let is_wrong = |cause: &Cause| !causes.contains(&cause.kind());
    let outcome = timely(criterion, observed);
    if outcome != Outcome::Met {
        outcome
    } else if observed.cause.as_ref().is_some_and(is_wrong) {
        Outcome::WrongCause
    } else if is_too_mild(observed) {
        Outcome::WrongState
    } else if observed.is_left_on {
        Outcome::LeftOn
    } else {
        Outcome::Met
    }
}

/// Returns whether the node stopped in a milder state than its cause demands.
fn is_too_mild(observed: &Observation) -> bool {
    let demanded = observed.cause.and_then(|cause| expectation::end_state(cause.kind()));
    observed.end_state.zip(demanded).is_some_and(|(end, demanded)| end < demanded)
}

/// Compares the reaction and its time.
fn timely(criterion: Criterion, observed: &Observation) -> Outcome {
    let is_latched = observed.detected.is_some();
    let in_time = |time: Option<Duration>, within: Duration| match time {
        Some(time) if time <= within => Outcome::Met,
        Some(_) | None => Outcome::Late,
    };
    match criterion {
        Criterion::Stop(_) if !observed.is_stopped => Outcome::Missed,
        Criterion::TorqueFree(_) | Criterion::ReflectionOff(_) if !is_latched => Outcome::Missed,
        Criterion::BusAbandoned(_, abandoned)
            if observed.drives_off.is_none_or(|time| time > abandoned) =>
        {
            Outcome::Missed
        }
        Criterion::ZeroTorque(_) | Criterion::Disengaged(_, MayStop::No) | Criterion::GoesOn
            if is_latched =>
        {
            Outcome::FalseTrip
        }
        Criterion::ReflectionOff(within) if observed.detected.is_some_and(|time| time > within) => {
            Outcome::Late
        }
        Criterion::Stop(within) | Criterion::ZeroTorque(within) => in_time(observed.zero, within),
        Criterion::TorqueFree(within) | Criterion::BusAbandoned(within, _) => {
            in_time(observed.torque_free, within)
        }
        Criterion::ReflectionOff(within) | Criterion::Disengaged(within, _) => {
            in_time(observed.reflection_off, within)
        }
        Criterion::Armed(most) if observed.armed_error.is_some_and(|error| error <= most) => {
            Outcome::Met
        }
        Criterion::Armed(_) if observed.armed_error.is_none() => Outcome::FalseTrip,
        Criterion::Unarmed if observed.armed_error.is_some() => Outcome::Missed,
        Criterion::Armed(_) => Outcome::Missed,
        Criterion::Unarmed | Criterion::GoesOn | Criterion::Either(_) => Outcome::Met,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::numbering::{Joint, NodeIndex};

    const WITHIN: Duration = Duration::from_millis(5);
    const CAUSES: &[CauseKind] = &[CauseKind::SamplesMissing];

    /// Stop in time, by this cause.
    fn stopped_by(cause: Cause) -> Observation {
        let time = Some(Duration::from_millis(4));
        Observation {
            detected: time,
            is_stopped: true,
            cause: Some(cause),
            end_state: Some(EndState::ZeroTorque),
            off: time,
            zero: time,
            torque_free: time,
            reflection_off: time,
            ..Observation::default()
        }
    }

    const ELBOW: Joint = Joint::of::<3>();
    const MISSING: Cause = Cause::SamplesMissing { joint: ELBOW, cycles: 3 };

    #[test]
    fn stop_by_another_cause_is_a_wrong_cause() {
        for criterion in
            [Criterion::Stop(WITHIN), Criterion::TorqueFree(WITHIN), Criterion::Either("")]
        {
            let right = stopped_by(MISSING);
            assert_eq!(outcome(criterion, CAUSES, &right), Outcome::Met, "{criterion:?}");
            let wrong = stopped_by(Cause::Overspeed { joint: ELBOW });
            assert_eq!(outcome(criterion, CAUSES, &wrong), Outcome::WrongCause, "{criterion:?}");
        }
    }

    #[test]
    fn drive_left_on_after_a_stop_is_a_failure() {
        let left_on = Observation { is_left_on: true, ..stopped_by(MISSING) };
        for criterion in [Criterion::Stop(WITHIN), Criterion::Either("")] {
            assert_eq!(outcome(criterion, CAUSES, &left_on), Outcome::LeftOn, "{criterion:?}");
        }
    }

    #[test]
    fn bus_abandoned_too_late_is_missed() {
        let criterion = Criterion::BusAbandoned(WITHIN, WITHIN);
        let observed = stopped_by(MISSING);
        assert_eq!(outcome(criterion, CAUSES, &observed), Outcome::Missed);
        let abandoned = |millis| Some(Duration::from_millis(millis));
        let in_time = Observation { drives_off: abandoned(5), ..observed.clone() };
        assert_eq!(outcome(criterion, CAUSES, &in_time), Outcome::Met);
        let late = Observation { drives_off: abandoned(6), ..observed };
        assert_eq!(outcome(criterion, CAUSES, &late), Outcome::Missed);
    }

    #[test]
    fn stop_in_a_milder_state_than_demanded_is_a_failure() {
        let observed = stopped_by(Cause::HeartbeatLost { node: NodeIndex(2) });
        let causes = &[CauseKind::HeartbeatLost];
        let demand = Criterion::Stop(WITHIN);
        assert_eq!(outcome(demand, causes, &observed), Outcome::WrongState);
        let off = Observation { end_state: Some(EndState::DrivesOff), ..observed };
        assert_eq!(outcome(demand, causes, &off), Outcome::Met);
    }
}
