//! Boot of one node: runs the [steps](crate::master::steps) of its plan, one SDO transfer at a time.
//!
//! Ends with a node that is configured, read back and pre-operational; the [master](crate::master) starts
//! it. Every failure names the node, the object, the expected and the found value.

mod error_control;
mod fixed_mapping;
#[cfg(test)]
mod tests;
mod transfer_end;

use std::time::Duration;

use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::sdo::response_cob_id;
use canopen_rs::{NmtState, Value};

use crate::abort::AbortCode;
use crate::drive::Controlword;
use crate::frame::Frame;
use crate::master::boot_error::{BootError, Problem};
use crate::master::disturbance::Disturbance;
use crate::master::duplicate::{Reply, ReplyCounter, Sign};
use crate::master::standstill::Standstill;
use crate::master::steps::{Action, Configuration, Next, Stage, Step};
use crate::nameplate::StoredValue;
use crate::nmt::Order;
use crate::object::Object;
use crate::plan::NodePlan;
use crate::sdo::{Transfer, bytes};
use units::time::Instant;

/// Time allowed to store parameters (1010h) or to restore defaults (1011h).
pub const STORE_TIMEOUT: Duration = Duration::from_secs(5);
/// Period at which a node that is not ready yet is polled.
pub const RETRY_PERIOD: Duration = Duration::from_millis(100);
/// Time allowed until a drive is at standstill after its power was switched off.
pub const STANDSTILL_TIMEOUT: Duration = Duration::from_secs(5);

/// Origin of the node's configuration, or the reason why it has none.
pub type BootOutcome = Result<Configuration, BootError>;

/// Boot of one node.
#[derive(Clone, Debug)]
pub struct Boot {
    plan: NodePlan,
    /// Time allowed for the first reply.
    probe_timeout: Duration,
    /// Time before which the node is not reset.
    reset_from: Instant,
    stage: Stage,
    /// Steps of the stage.
    steps: Vec<Step>,
    /// Index of the current step.
    at: usize,
    /// Deadline of the current step.
    until: Instant,
    resets: Resets,
    replies: ReplyCounter,
    /// Time of the first request, and the latency of its reply.
    first_request: Option<Instant>,
    latency: Duration,
    /// Set if the drive was found with its power on.
    was_enabled: bool,
    standstill: Standstill,
    /// Optional objects that the node lacks, or whose value it refuses.
    missing: Vec<Object>,
    /// Optional objects whose value the node refuses, with the abort code.
    refused: Vec<(Object, AbortCode)>,
    /// Mapping parameters that the node does not let be written, by their sub-index 0.
    fixed_mappings: Vec<(Object, AbortCode)>,
    /// Nameplate as read in the last stage that reads one.
    held: Vec<StoredValue>,
    /// Set if the node has not accepted the mode, because it is not operational yet.
    awaits_mode: bool,
    /// NMT state in the last heartbeat.
    reported_state: Option<NmtState>,
    /// Disturbance of the current transfer.
    disturbance: Disturbance,
    /// Second attempts of the current step.
    retries: Retries,
    wait: Wait,
}

/// Second attempts of one step, one of each kind.
#[derive(Clone, Copy, Debug, Default)]
struct Retries {
    /// Set if an upload without an answer was requested again.
    is_read_again: bool,
    /// Set if a download without an answer was sent again.
    is_written_again: bool,
    /// Set if a refused COB-ID was written with bit 30 inverted.
    has_other_bit_30: bool,
}

/// Resets of the node. A boot-up message before the first reply may have waited for the bus and may be
/// older than the reset.
#[derive(Clone, Copy, Debug, Default)]
struct Resets {
    count: u32,
    /// Time of the first answer after the last reset.
    answered_at: Option<Instant>,
}

/// Awaited event.
#[derive(Clone, Debug)]
enum Wait {
    /// First call of `on_time`.
    Start,
    /// Reply to a read, or to the read-back of a write.
    Read(Transfer),
    /// Confirmation of a write.
    Write(Transfer),
    /// Boot-up message.
    BootUp,
    /// Heartbeat that reports operational.
    Heartbeat,
    /// Time of the next attempt.
    Retry(Instant),
    /// End of the time in which another master may be detected.
    Listen,
    /// No event: the node is configured, or the boot has failed.
    Over,
}

impl Boot {
    /// Returns a boot that starts with the first call of [`on_time`](Self::on_time).
    pub fn new(plan: &NodePlan) -> Self {
        Self {
            plan: plan.clone(),
            probe_timeout: plan.timeouts.boot,
            reset_from: Instant::ZERO,
            stage: Stage::Probe,
            steps: Stage::Probe.steps(plan),
            at: 0,
            until: Instant::ZERO,
            resets: Resets::default(),
            replies: ReplyCounter::default(),
            first_request: None,
            latency: Duration::ZERO,
            was_enabled: false,
            standstill: Standstill::within(plan.standstill_counts.unwrap_or(0)),
            missing: Vec::new(),
            refused: Vec::new(),
            fixed_mappings: Vec::new(),
            held: Vec::new(),
            awaits_mode: false,
            reported_state: None,
            disturbance: Disturbance::default(),
            retries: Retries::default(),
            wait: Wait::Start,
        }
    }

    /// Leaves the node as it runs until then, apart from the power of a drive.
    #[must_use]
    pub fn resetting_from(self, reset_from: Instant) -> Self {
        Self { reset_from, ..self }
    }

    /// Returns the boot of a running node that has a single stage left.
    pub fn of_stage(plan: &NodePlan, stage: Stage) -> Self {
        Self { stage, steps: stage.steps(plan), ..Self::new(plan) }
    }

    /// Returns the stage that runs, or ran last.
    pub(super) const fn stage(&self) -> Stage {
        self.stage
    }

    /// Returns a boot that gives up after one unanswered request.
    pub fn probe(plan: &NodePlan) -> Self {
        Self { probe_timeout: RETRY_PERIOD, ..Self::new(plan) }
    }

    /// Takes one received frame. Returns the outcome once.
    pub fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        if frame.cob_id == heartbeat_cob_id(self.plan.node) {
            return self.on_heartbeat(now, frame, out);
        }
        if frame.cob_id != response_cob_id(self.plan.node) {
            return None;
        }
        let reply = self.replies.on_reply(frame);
        if self.is_under_way() && reply == Reply::OneTooMany {
            return self.fail_duplicate(now, out);
        }
        let (Wait::Read(transfer) | Wait::Write(transfer)) = &mut self.wait else { return None };
        if reply == Reply::Late {
            // A server answers in order, so the time for this reply starts now.
            transfer.extend(now);
            return None;
        }
        let sent = out.len();
        let outcome = transfer.on_frame(now, frame, out);
        let outcome = outcome.and_then(|outcome| self.on_outcome(now, outcome, out));
        self.replies.on_requests(self.plan.node, out.get(sent..).unwrap_or_default());
        outcome
    }

    /// Takes a request that another client has sent to the node. Its replies do not count here; a transfer
    /// that fails because of it is repeated.
    pub fn on_foreign_request(&mut self, frame: &Frame) {
        self.replies.on_requests(self.plan.node, std::slice::from_ref(frame));
        self.disturbance.note();
    }

    /// Handles expired timers. Returns the outcome once.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        let sent = out.len();
        let outcome = self.take_time(now, out);
        self.replies.on_requests(self.plan.node, out.get(sent..).unwrap_or_default());
        outcome
    }

    /// Time of the next call of [`on_time`](Self::on_time); `None` after the outcome.
    pub const fn deadline(&self) -> Option<Instant> {
        match &self.wait {
            Wait::Start => Some(Instant::ZERO),
            Wait::Read(transfer) | Wait::Write(transfer) => transfer.deadline(),
            Wait::Retry(at) => Some(*at),
            Wait::Listen => Some(self.reset_from),
            Wait::BootUp | Wait::Heartbeat => Some(self.until),
            Wait::Over => None,
        }
    }

    fn take_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        match &mut self.wait {
            Wait::Start => self.take_step(now, out),
            Wait::Read(transfer) | Wait::Write(transfer) => {
                let outcome = transfer.on_time(now, out)?;
                self.on_outcome(now, outcome, out)
            }
            Wait::Retry(at) if now >= *at => {
                self.read(now, out);
                None
            }
            Wait::Listen if now >= self.reset_from => self.take_step(now, out),
            Wait::BootUp if now >= self.until => self.fail(Problem::NoBootUp),
            Wait::Heartbeat if now >= self.until => {
                self.on_mismatch(now, Problem::NoHeartbeat, out)
            }
            Wait::Retry(_) | Wait::Listen | Wait::BootUp | Wait::Heartbeat | Wait::Over => None,
        }
    }

    fn next_step(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        self.at += 1;
        self.retries = Retries::default();
        self.take_step(now, out)
    }

    /// Starts the current step, or leaves the stage after its last one.
    fn take_step(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        if self.stage == Stage::Reset && self.at == 0 && now < self.reset_from {
            self.wait = Wait::Listen;
            return None;
        }
        let first_request = *self.first_request.get_or_insert(now);
        if self.stage == Stage::Probe {
            self.latency = now.since(first_request);
        }
        let step = self.steps.get(self.at);
        self.until = now
            + match step {
                _ if self.stage == Stage::Probe => self.probe_timeout,
                Some(Step::Object(Action::AwaitStandstill, _)) => STANDSTILL_TIMEOUT,
                Some(_) | None => self.plan.timeouts.boot,
            };
        match step {
            None => return self.go(now, self.stage.next(&self.plan), out),
            Some(Step::AwaitHeartbeat) => {
                self.until = now + self.plan.error_control.lost_after();
                self.wait = Wait::Heartbeat;
            }
            Some(Step::Reset(command)) => {
                out.push(Order::to(self.plan.node, *command).frame());
                self.resets = Resets { count: self.resets.count + 1, answered_at: None };
                self.wait = Wait::BootUp;
            }
            Some(Step::CompareNameplate) => {
                let nameplate = self.plan.nameplate.as_ref();
                let judged = nameplate.map_or(Ok(()), |nameplate| nameplate.judge(&self.held));
                return match judged {
                    Ok(()) => self.next_step(now, out),
                    Err(misfit) => self.on_mismatch(now, misfit.into(), out),
                };
            }
            Some(Step::Read(_)) => self.read(now, out),
            Some(Step::Object(action, _)) if !action.writes() => self.read(now, out),
            Some(Step::Object(action, check)) => {
                let (object, value) = (check.object, bytes(&check.expected));
                let reply = self.plan.timeouts.reply;
                let reply = if *action == Action::Command { STORE_TIMEOUT } else { reply };
                match Transfer::write(self.plan.node, object, value, reply, now, out) {
                    Ok(transfer) => self.wait = Wait::Write(transfer),
                    Err(error) => return self.fail(Problem::of_transfer(object, error)),
                }
            }
        }
        None
    }

    /// Enters a stage, or ends with a configured node.
    fn go(&mut self, now: Instant, next: Next, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        match next {
            Next::Done(configuration) => {
                self.wait = Wait::Over;
                Some(Ok(configuration))
            }
            Next::Stage(stage) => {
                self.was_enabled |= stage == Stage::SwitchOff;
                self.stage = stage;
                self.steps = stage.steps(&self.plan);
                self.at = 0;
                self.retries = Retries::default();
                if matches!(stage, Stage::Verify | Stage::Download) {
                    self.held.clear();
                }
                self.take_step(now, out)
            }
        }
    }

    /// Leaves a stage after a mismatch. `problem` ends the boot where the stage has no alternative.
    fn on_mismatch(
        &mut self,
        now: Instant,
        problem: Problem,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        match self.stage.on_mismatch() {
            Some(next) => self.go(now, next, out),
            None => self.fail(problem),
        }
    }

    /// Reads the object of the current step. A node that still answers repeated first requests gets the
    /// latency of its first reply on top.
    fn read(&mut self, now: Instant, out: &mut Vec<Frame>) {
        let (object, is_probe) = match self.steps.get(self.at) {
            Some(Step::Object(action, check)) => (check.object, *action == Action::Probe),
            Some(Step::Read(object)) => (*object, false),
            Some(Step::AwaitHeartbeat | Step::Reset(_) | Step::CompareNameplate) | None => return,
        };
        let timeout = if is_probe {
            RETRY_PERIOD
        } else if self.replies.is_behind() {
            self.plan.timeouts.reply + self.latency
        } else {
            self.plan.timeouts.reply
        };
        self.wait = Wait::Read(Transfer::read(self.plan.node, object, timeout, now, out));
    }

    fn fail(&mut self, problem: Problem) -> Option<BootOutcome> {
        self.wait = Wait::Over;
        Some(Err(BootError::new(&self.plan, problem)))
    }

    /// Fails because two nodes share the node-id. First sends both "disable voltage", because one may be an enabled drive,
    /// without waiting for a reply.
    fn fail_duplicate(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        if self.plan.is_drive() {
            let off = bytes(&Value::Unsigned16(Controlword::DISABLE_VOLTAGE.0));
            // Cannot fail: two bytes fit an expedited download.
            let reply = self.plan.timeouts.reply;
            Transfer::write(self.plan.node, Object::CONTROLWORD, off, reply, now, out).ok();
        }
        self.fail(Problem::Duplicate(Sign::ExtraReply))
    }

    /// Optional objects that the node lacks, or whose value it refuses.
    pub fn missing(&self) -> &[Object] {
        &self.missing
    }

    /// Optional objects whose value the node refuses, with the abort code.
    pub fn refused(&self) -> &[(Object, AbortCode)] {
        &self.refused
    }

    /// Nameplate as read.
    pub fn held(&self) -> &[StoredValue] {
        &self.held
    }

    /// Returns whether the mode is still to be commanded, once the node is operational.
    pub const fn awaits_mode(&self) -> bool {
        self.awaits_mode
    }

    /// Returns whether the drive was found with its power on.
    pub const fn was_enabled(&self) -> bool {
        self.was_enabled
    }

    const fn is_under_way(&self) -> bool {
        !matches!(self.wait, Wait::Start | Wait::Over)
    }
}
