//! End of an SDO transfer in a boot: next step, retry, alternative stage or failure.
//!
//! The answer is classified, [`decide`] holds the table of what follows, and the boot carries that out.

use canopen_rs::NmtCommand;

use crate::abort::AbortCode;
use crate::frame::Frame;
use crate::master::boot_error::Problem;
use crate::master::check::Check;
use crate::master::commission::fixed_mapping::is_clearing;
use crate::master::commission::{Boot, BootOutcome, RETRY_PERIOD, STANDSTILL_TIMEOUT, Wait};
use crate::master::disturbance::Disturbance;
use crate::master::steps::{Action, Stage, Step};
use crate::nameplate::StoredValue;
use crate::nameplate::units::is_outdated;
use crate::nmt::Order;
use crate::object::Object;
use crate::sdo::{Outcome, SdoError};
use crate::setting::{OFFSETS, may_be_written_twice};
use units::time::Instant;

/// Answer to a transfer.
#[derive(Clone, Copy)]
enum Answer {
    /// Write that the node confirms.
    Confirmed,
    /// Value as expected, or drive at standstill.
    Expected,
    /// Value that differs, or drive in motion.
    Differs,
    /// Abort by the node.
    Aborted(AbortCode),
    /// Abort by the master.
    AbortedLocally,
    /// No answer in time.
    Timeout,
}

/// Kind of an object, by the alternative that remains if the node refuses to have it written.
#[derive(Clone, Copy)]
enum Kind {
    /// COB-ID, its bit 30 as planned.
    CobId,
    /// Number of mapped objects, to be cleared.
    Mapping,
    /// Offset of a set-point.
    Offset,
    /// Mode of operation, before the start.
    Mode,
    /// Without an alternative.
    Other,
}

/// Consequence of an answer.
#[derive(Clone, Copy)]
enum Decision {
    /// Takes the next step.
    Proceed,
    /// Reads the object that was written.
    ReadBack,
    /// Reads again after [`RETRY_PERIOD`].
    ReadLater,
    /// Proceeds without the object, or without the value that the node refuses.
    Skip(Option<AbortCode>),
    /// Writes the COB-ID with bit 30 inverted. Some nodes accept no TPDO that may be requested by RTR.
    TurnBit30,
    /// Compares the mapping from here on.
    CompareMapping(AbortCode),
    /// Compares the offset. Some drives take it by PDO alone.
    CompareOffset,
    /// Leaves the mode for the time after the start. Some drives take it only when operational.
    PostponeMode,
    /// Commands pre-operational and reads again. A stopped node takes NMT commands only.
    Wake,
    /// Sends the request again, as another client has disturbed it.
    RepeatDisturbed,
    /// Sends the request a second time.
    RepeatOnce,
    /// Ends the boot.
    Fail,
    /// Enters the alternative of the stage, or ends the boot.
    LeaveStage,
}

/// Returns what follows an answer: the first row that fits. A step is in time before its deadline; another client has
/// disturbed a transfer if it sent a request to the node meanwhile.
#[rustfmt::skip]
const fn decide(
    (answer, action, kind): (Answer, Action, Kind), is_in_time: bool, is_disturbed: bool, may_repeat: bool,
) -> Decision {
    use Action::{Await, AwaitStandstill, Command, Probe, WriteIfAccepted};
    use Answer::{Aborted, AbortedLocally, Confirmed, Differs, Expected, Timeout};
    use Decision::{CompareMapping, CompareOffset, Fail, LeaveStage, PostponeMode, Proceed, ReadBack};
    use Decision::{ReadLater, RepeatDisturbed, RepeatOnce, Skip, TurnBit30, Wake};
    use Kind::{CobId, Mapping, Mode, Offset};
    match (answer, action, kind) {
        (Confirmed,                             Command,                 _)                               => Proceed,
        (Confirmed,                             _,                       _)                               => ReadBack,
        (Expected,                              _,                       _)                               => Proceed,
        (Differs,                               Await | AwaitStandstill, _)       if is_in_time           => ReadLater,
        (Differs,                               Await | AwaitStandstill, _)                               => LeaveStage,
        (_,                                     _,                       _)       if is_disturbed         => RepeatDisturbed,
        (Aborted(AbortCode::NO_OBJECT),         _,                       _)       if action.is_optional() => Skip(None),
        (Aborted(AbortCode::NO_SUB_INDEX),      _,                       _)       if action.is_optional() => Skip(None),
        (Aborted(code),                         _,                       CobId)   if code.refuses_value() => TurnBit30,
        (Aborted(code),                         _,                       Mapping)                         => CompareMapping(code),
        (Aborted(AbortCode::READ_ONLY),         _,                       Offset)                          => CompareOffset,
        (Aborted(AbortCode::DEVICE_STATE),      _,                       Mode)                            => PostponeMode,
        (Aborted(code),                         WriteIfAccepted,         _)       if code.refuses_value() => Skip(Some(code)),
        (Timeout,                               Probe,                   _)       if is_in_time           => Wake,
        (Timeout,                               _,                       _)       if may_repeat           => RepeatOnce,
        (Timeout,                               _,                       _)                               => Fail,
        (Differs | Aborted(_) | AbortedLocally, _,                       _)                               => LeaveStage,
    }
}

impl Boot {
    /// Handles the end of a transfer.
    pub(super) fn on_outcome(
        &mut self,
        now: Instant,
        outcome: Outcome,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        let (action, check) = match self.steps.get(self.at)? {
            Step::Object(action, check) => (*action, check.clone()),
            Step::Read(object) => return self.on_nameplate(now, *object, outcome, out),
            Step::AwaitHeartbeat | Step::Reset(_) | Step::CompareNameplate => return None,
        };
        let case = (self.answer(action, &check, &outcome), action, self.kind(action, &check));
        let (is_in_time, may_repeat) = (now < self.until, self.may_repeat(check.object));
        let decision = decide(case, is_in_time, self.disturbance.take(), may_repeat);
        if !matches!(decision, Decision::RepeatDisturbed) {
            self.disturbance = Disturbance::default();
        }
        self.carry_out(now, decision, (action, check), outcome, out)
    }

    /// Classifies the outcome of a transfer.
    fn answer(&mut self, action: Action, check: &Check, outcome: &Outcome) -> Answer {
        let is_expected = match outcome {
            Ok(_) if self.is_writing() => return Answer::Confirmed,
            Ok(content) if action == Action::AwaitStandstill => {
                self.standstill.on_position(content)
            }
            Ok(content) => check.accepts(content),
            Err(SdoError::AbortedByServer(code)) => return Answer::Aborted(*code),
            Err(SdoError::AbortedLocally(_)) => return Answer::AbortedLocally,
            Err(SdoError::Timeout) => return Answer::Timeout,
        };
        if is_expected { Answer::Expected } else { Answer::Differs }
    }

    /// Classifies the object of the current step.
    fn kind(&self, action: Action, check: &Check) -> Kind {
        let may_turn = !self.retries.has_other_bit_30 && check.with_other_bit_30().is_some();
        match check.object {
            object if action.writes() && OFFSETS.contains(&object) => Kind::Offset,
            _ if !self.is_writing() => Kind::Other,
            _ if may_turn => Kind::CobId,
            _ if action == Action::Write && is_clearing(check) => Kind::Mapping,
            Object::MODE_OF_OPERATION if self.resets.count > 0 => Kind::Mode,
            _ => Kind::Other,
        }
    }

    /// Returns whether the request may be sent a second time. An upload changes nothing, so any may; a download may
    /// where the same write has the same effect twice.
    fn may_repeat(&self, object: Object) -> bool {
        if self.is_writing() {
            may_be_written_twice(object) && !self.retries.is_written_again
        } else {
            self.stage != Stage::Probe && !self.retries.is_read_again
        }
    }

    const fn is_writing(&self) -> bool {
        matches!(self.wait, Wait::Write(_))
    }

    fn carry_out(
        &mut self,
        now: Instant,
        decision: Decision,
        (action, check): (Action, Check),
        outcome: Outcome,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        let object = check.object;
        match decision {
            Decision::Proceed => {
                if action == Action::Probe && self.resets.count > 0 {
                    self.resets.answered_at = Some(now);
                }
                return self.next_step(now, out);
            }
            Decision::ReadBack => self.read(now, out),
            Decision::ReadLater => self.wait = Wait::Retry(now + RETRY_PERIOD),
            Decision::Skip(refused) => {
                self.missing.push(object);
                self.refused.extend(refused.map(|code| (object, code)));
                return self.next_step(now, out);
            }
            Decision::TurnBit30 => {
                self.retries.has_other_bit_30 = true;
                let turned = check.with_other_bit_30().unwrap_or(check);
                return self.retake(now, Step::Object(action, turned), out);
            }
            Decision::CompareMapping(code) => {
                self.compare_mapping(object, code);
                return self.take_step(now, out);
            }
            Decision::CompareOffset => {
                return self.retake(now, Step::Object(Action::CompareIfPresent, check), out);
            }
            Decision::PostponeMode => {
                self.awaits_mode = true;
                return self.go(now, self.stage.next(&self.plan), out);
            }
            Decision::Wake => {
                out.push(Order::to(self.plan.node, NmtCommand::EnterPreOperational).frame());
                self.read(now, out);
            }
            Decision::RepeatDisturbed => return self.repeat(now, out),
            Decision::RepeatOnce => return self.repeat_once(now, out),
            Decision::Fail => return self.fail(self.problem(action, &check, outcome)),
            Decision::LeaveStage => {
                let problem = self.problem(action, &check, outcome);
                return self.on_mismatch(now, self.of_fixed_mapping(object, problem), out);
            }
        }
        None
    }

    /// Returns the problem that ends the boot, or its stage.
    fn problem(&self, action: Action, check: &Check, outcome: Outcome) -> Problem {
        match outcome {
            Ok(_) if action == Action::AwaitStandstill => {
                Problem::Moving { waited: STANDSTILL_TIMEOUT }
            }
            Ok(content) => Problem::differs(check, &content),
            Err(SdoError::Timeout) if self.stage == Stage::Probe => {
                Problem::Absent { waited: self.probe_timeout }
            }
            Err(error) => Problem::of_transfer(check.object, error),
        }
    }

    /// Repeats the current step in an alternative form.
    fn retake(&mut self, now: Instant, step: Step, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        if let Some(current) = self.steps.get_mut(self.at) {
            *current = step;
        }
        self.take_step(now, out)
    }

    /// Handles the end of an upload for the nameplate. An absent object passes.
    fn on_nameplate(
        &mut self,
        now: Instant,
        object: Object,
        outcome: Outcome,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        let is_disturbed = self.disturbance.take();
        match outcome {
            Err(_) if is_disturbed => return self.repeat(now, out),
            Err(SdoError::Timeout) if !self.retries.is_read_again => {
                return self.repeat_once(now, out);
            }
            Ok(content) => self.held.extend(StoredValue::from_content(object, &content)),
            Err(SdoError::AbortedByServer(AbortCode::NO_OBJECT | AbortCode::NO_SUB_INDEX)) => {}
            // No dictionary since CiA 402-2 has these: a vague abort means that the node has none either.
            Err(SdoError::AbortedByServer(AbortCode::GENERAL_ERROR)) if is_outdated(object) => {}
            // Sign and scale are never assumed: an object that cannot be read is not taken for absent.
            Err(error) => return self.fail(Problem::of_transfer(object, error)),
        }
        self.disturbance = Disturbance::default();
        self.next_step(now, out)
    }

    /// Sends the request a second time.
    fn repeat_once(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        if self.is_writing() {
            self.retries.is_written_again = true;
        } else {
            self.retries.is_read_again = true;
        }
        self.repeat(now, out)
    }

    /// Sends the request of the current transfer again.
    fn repeat(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        if self.is_writing() {
            return self.take_step(now, out);
        }
        self.read(now, out);
        None
    }
}
