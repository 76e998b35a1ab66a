//! End of an SDO transfer in a boot: next step, retry, alternative stage or failure.

use canopen_rs::NmtCommand;

use crate::abort::AbortCode;
use crate::frame::Frame;
use crate::master::boot_error::Problem;
use crate::master::commission::{
    Boot, BootOutcome, MAX_REPEATS, RETRY_PERIOD, STANDSTILL_TIMEOUT, Wait,
};
use crate::master::steps::{Action, Stage, Step};
use crate::nameplate::Held;
use crate::nameplate::units::is_outdated;
use crate::nmt::Order;
use crate::object::Object;
use crate::sdo::{Content, Outcome, SdoError};
use crate::setting::{OFFSETS, may_be_written_twice};
use units::time::Instant;

impl Boot {
    /// Handles the end of a transfer.
    pub(super) fn on_outcome(
        &mut self,
        now: Instant,
        outcome: Outcome,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        if let Some(Step::Read(object)) = self.steps.get(self.at) {
            return self.on_nameplate(now, *object, outcome, out);
        }
        let Some(Step::Object(action, check)) = self.steps.get(self.at) else { return None };
        let (action, object) = (*action, check.object);
        let has_written = matches!(self.wait, Wait::Write(_));
        let is_in_time = now < self.until;
        let is_broken = match &outcome {
            Ok(content) => !has_written && action.compares_once() && !check.accepts(content),
            Err(_) => true,
        };
        let is_disturbed = std::mem::take(&mut self.is_disturbed);
        if is_broken && is_disturbed && self.repeats < MAX_REPEATS {
            self.repeats += 1;
            return self.repeat(now, has_written, out);
        }
        self.repeats = 0;
        match outcome {
            Ok(_) if action == Action::Command => self.next_step(now, out),
            Ok(_) if has_written => {
                self.read(now, out);
                None
            }
            Ok(content) if action == Action::AwaitStandstill => {
                self.on_position(now, &content, out)
            }
            Ok(content) if check.accepts(&content) => {
                if action == Action::Probe && self.resets.count > 0 {
                    self.resets.answered_at = Some(now);
                }
                self.next_step(now, out)
            }
            Ok(_) if action == Action::Await && is_in_time => {
                self.wait = Wait::Retry(now + RETRY_PERIOD);
                None
            }
            Ok(content) => {
                let problem = Problem::differs(check, &content);
                self.on_mismatch(now, self.of_fixed_mapping(object, problem), out)
            }
            Err(SdoError::AbortedByServer(AbortCode::NO_OBJECT | AbortCode::NO_SUB_INDEX))
                if action.is_optional() =>
            {
                self.missing.push(object);
                self.next_step(now, out)
            }
            Err(SdoError::AbortedByServer(code))
                if has_written && code.refuses_value() && self.turns_bit_30() =>
            {
                self.take_step(now, out)
            }
            Err(SdoError::AbortedByServer(code)) if has_written && self.keeps_mapping(code) => {
                self.take_step(now, out)
            }
            Err(SdoError::AbortedByServer(AbortCode::READ_ONLY)) if self.compares_offset() => {
                self.take_step(now, out)
            }
            Err(SdoError::AbortedByServer(AbortCode::DEVICE_STATE))
                if has_written && self.postpones_mode(object) =>
            {
                self.go(now, self.stage.next(&self.plan), out)
            }
            Err(SdoError::AbortedByServer(code))
                if action == Action::WriteIfAccepted && code.refuses_value() =>
            {
                self.missing.push(object);
                self.refused.push((object, code));
                self.next_step(now, out)
            }
            Err(SdoError::Timeout) if action == Action::Probe && is_in_time => {
                // A stopped node takes NMT commands only.
                out.push(Order::to(self.plan.node, NmtCommand::EnterPreOperational).frame());
                self.read(now, out);
                None
            }
            Err(SdoError::Timeout) if self.stage == Stage::Probe => {
                self.fail(Problem::Absent { waited: self.probe_timeout })
            }
            // An upload changes nothing, so a lost answer is asked for again.
            Err(SdoError::Timeout) if !has_written && !self.retries.is_read_again => {
                self.retries.is_read_again = true;
                self.read(now, out);
                None
            }
            // A lost answer to a download is no reason to give up, where the same write has the same effect twice.
            Err(SdoError::Timeout)
                if has_written
                    && may_be_written_twice(object)
                    && !self.retries.is_written_again =>
            {
                self.retries.is_written_again = true;
                self.take_step(now, out)
            }
            Err(error @ SdoError::Timeout) => self.fail(Problem::of_transfer(object, error)),
            Err(error) => {
                let problem = Problem::of_transfer(object, error);
                self.on_mismatch(now, self.of_fixed_mapping(object, problem), out)
            }
        }
    }

    /// Handles the end of reading an object of the nameplate. What the drive does not have passes.
    fn on_nameplate(
        &mut self,
        now: Instant,
        object: Object,
        outcome: Outcome,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        let is_disturbed = std::mem::take(&mut self.is_disturbed);
        match outcome {
            Err(_) if is_disturbed && self.repeats < MAX_REPEATS => {
                self.repeats += 1;
                self.read(now, out);
                None
            }
            Err(SdoError::Timeout) if !self.retries.is_read_again => {
                self.retries.is_read_again = true;
                self.read(now, out);
                None
            }
            Ok(content) => {
                self.repeats = 0;
                self.held.extend(Held::of(object, &content));
                self.next_step(now, out)
            }
            Err(SdoError::AbortedByServer(AbortCode::NO_OBJECT | AbortCode::NO_SUB_INDEX)) => {
                self.repeats = 0;
                self.next_step(now, out)
            }
            // No dictionary since CiA 402-2 has these: a vague abort means that the node has none either.
            Err(SdoError::AbortedByServer(AbortCode::GENERAL_ERROR)) if is_outdated(object) => {
                self.repeats = 0;
                self.next_step(now, out)
            }
            // Sign and scale are never assumed: an object that cannot be read is not taken for absent.
            Err(error) => self.fail(Problem::of_transfer(object, error)),
        }
    }

    /// Turns bit 30 of a COB-ID that the node has refused over, once; returns whether it did. Some accept no TPDO that may
    /// be requested by RTR.
    fn turns_bit_30(&mut self) -> bool {
        let has_turned = std::mem::replace(&mut self.retries.has_other_bit_30, true);
        let Some(Step::Object(_, check)) = self.steps.get_mut(self.at) else { return false };
        match check.with_other_bit_30() {
            Some(turned) if !has_turned => {
                *check = turned;
                true
            }
            Some(_) | None => false,
        }
    }

    /// Compares an offset that the node does not let be written by SDO, as some take it by PDO alone; returns whether the
    /// current step has written one.
    fn compares_offset(&mut self) -> bool {
        let Some(Step::Object(action, check)) = self.steps.get_mut(self.at) else { return false };
        let is_offset = action.writes() && OFFSETS.contains(&check.object);
        if is_offset {
            *action = Action::CompareIfPresent;
        }
        is_offset
    }

    /// Leaves the mode (6060h) for the time after the start; returns whether it does. Some drives take a mode only
    /// when operational.
    fn postpones_mode(&mut self, object: Object) -> bool {
        let is_before_start = self.resets.count > 0;
        let is_postponed = object == Object::MODE_OF_OPERATION && is_before_start;
        self.awaits_mode |= is_postponed;
        is_postponed
    }

    /// Repeats the current transfer.
    fn repeat(
        &mut self,
        now: Instant,
        has_written: bool,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        if has_written {
            return self.take_step(now, out);
        }
        self.read(now, out);
        None
    }

    /// Handles a position of a drive that was switched off: the boot continues once the drive stands still.
    fn on_position(
        &mut self,
        now: Instant,
        content: &Content,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        if self.standstill.on_position(content) {
            self.next_step(now, out)
        } else if now < self.until {
            self.wait = Wait::Retry(now + RETRY_PERIOD);
            None
        } else {
            self.fail(Problem::Moving { waited: STANDSTILL_TIMEOUT })
        }
    }
}
