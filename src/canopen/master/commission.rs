//! Boots one node: takes the [steps](crate::master::steps) of its plan, one SDO transfer at a time.
//!
//! Ends with a node that is configured, read back and pre-operational; starting it is the
//! [master](crate::master)'s. Every failure says which node, which object, what was expected
//! and what was found.

use std::time::Duration;

use canopen_rs::NmtCommand;
use canopen_rs::NmtState;
use canopen_rs::Value;
use canopen_rs::nmt::decode_heartbeat;
use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::sdo::response_cob_id;

use crate::abort::AbortCode;
use crate::drive::Controlword;
use crate::frame::Frame;
use crate::heartbeat::is_boot_up;
use crate::master::boot_error::BootError;
use crate::master::boot_error::Problem;
use crate::master::duplicate::Exchange;
use crate::master::duplicate::Reply;
use crate::master::duplicate::Sign;
use crate::master::rest::Rest;
use crate::master::steps::Action;
use crate::master::steps::Configuration;
use crate::master::steps::Next;
use crate::master::steps::Stage;
use crate::master::steps::Step;
use crate::nmt::Order;
use crate::object::Object;
use crate::plan::NodePlan;
use crate::sdo::Content;
use crate::sdo::Outcome;
use crate::sdo::SdoError;
use crate::sdo::Transfer;
use crate::sdo::bytes;
use units::time::Instant;

/// How long a node has for one SDO reply.
pub const REPLY: Duration = Duration::from_millis(500);
/// How long it has to store its parameters or to load its defaults.
pub const STORE: Duration = Duration::from_secs(5);
/// How often a node that is not ready yet is asked again.
pub const RETRY: Duration = Duration::from_millis(100);
/// How long a node may take to become ready: to power up, to boot, to change its mode.
pub const PATIENCE: Duration = Duration::from_secs(2);
/// How long a drive that was found with its power on may take to come to rest without it.
pub const REST: Duration = Duration::from_secs(5);

/// Times that a transfer which another client disturbed begins again.
const MAX_REPEATS: u32 = 3;

/// How a boot ends.
pub type BootOutcome = Result<Configuration, BootError>;

/// The boot of one node.
#[derive(Clone, Debug)]
pub struct Boot {
    plan: NodePlan,
    /// How long the node may take to give its first answer.
    patience: Duration,
    stage: Stage,
    /// Of the stage.
    steps: Vec<Step>,
    /// The step in hand.
    at: usize,
    /// When patience with it ends.
    until: Instant,
    resets: Resets,
    exchange: Exchange,
    /// When the first question was asked, and how long its answer took.
    asked_at: Option<Instant>,
    latency: Duration,
    /// Whether it was found with its power on.
    was_enabled: bool,
    rest: Rest,
    /// What it does not have, although it may.
    missing: Vec<Object>,
    /// The state it last told by a heartbeat.
    heard: Option<NmtState>,
    /// Another client has sent a request to the node since the transfer in hand began.
    is_disturbed: bool,
    /// Times that the transfer in hand has begun again for that.
    repeats: u32,
    wait: Wait,
}

/// How often a node was reset, and whether it was met since, so that a boot-up message is news. Before,
/// it may be an old one that had to wait for the bus.
#[derive(Clone, Copy, Debug, Default)]
struct Resets {
    count: u32,
    is_met: bool,
}

/// What is waited for.
#[derive(Clone, Debug)]
enum Wait {
    /// The first call of `on_time`.
    Start,
    /// A reply to a read, or to the read that follows a write.
    Read(Transfer),
    /// The confirmation of a write.
    Write(Transfer),
    /// The boot-up message.
    BootUp,
    /// A heartbeat.
    Heartbeat,
    /// The time to ask again.
    Retry(Instant),
    /// Nothing: configured, or failed.
    Over,
}

impl Boot {
    /// A boot that begins with the first call of [`on_time`](Self::on_time).
    pub fn new(plan: &NodePlan) -> Self {
        Self {
            plan: plan.clone(),
            patience: PATIENCE,
            stage: Stage::Finding,
            steps: Stage::Finding.steps(plan),
            at: 0,
            until: Instant::ZERO,
            resets: Resets::default(),
            exchange: Exchange::default(),
            asked_at: None,
            latency: Duration::ZERO,
            was_enabled: false,
            rest: Rest::within(plan.rest.unwrap_or(0)),
            missing: Vec::new(),
            heard: None,
            is_disturbed: false,
            repeats: 0,
            wait: Wait::Start,
        }
    }

    /// The same, asking once whether the node is there.
    pub fn looking(plan: &NodePlan) -> Self {
        Self { patience: RETRY, ..Self::new(plan) }
    }

    /// Takes one received frame; the outcome comes once.
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
        let reply = self.exchange.take(frame);
        if self.is_under_way() && reply == Reply::OneTooMany {
            return self.give_up_two(now, out);
        }
        let (Wait::Read(transfer) | Wait::Write(transfer)) = &mut self.wait else { return None };
        if reply == Reply::Late {
            // The server has worked on what it was asked before: the wait for this reply begins now.
            transfer.extend(now);
            return None;
        }
        let sent = out.len();
        let outcome = transfer.on_frame(now, frame, out);
        let outcome = outcome.and_then(|outcome| self.on_outcome(now, outcome, out));
        self.exchange.asked(self.plan.node, out.get(sent..).unwrap_or_default());
        outcome
    }

    /// Another client has sent this request to the node: its replies are not this boot's, and one that
    /// breaks the transfer in hand makes it begin again.
    pub fn on_foreign_request(&mut self, frame: &Frame) {
        self.exchange.asked(self.plan.node, std::slice::from_ref(frame));
        self.is_disturbed = true;
    }

    /// Does what is due; the outcome comes once.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        let sent = out.len();
        let outcome = self.take_time(now, out);
        self.exchange.asked(self.plan.node, out.get(sent..).unwrap_or_default());
        outcome
    }

    /// When [`on_time`](Self::on_time) must next be called; `None` once it is over.
    pub const fn deadline(&self) -> Option<Instant> {
        match &self.wait {
            Wait::Start => Some(Instant::ZERO),
            Wait::Read(transfer) | Wait::Write(transfer) => transfer.deadline(),
            Wait::Retry(at) => Some(*at),
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
            Wait::BootUp if now >= self.until => self.fail(Problem::NoBootUp),
            Wait::Heartbeat if now >= self.until => self.turn_aside(now, Problem::NoHeartbeat, out),
            Wait::Retry(_) | Wait::BootUp | Wait::Heartbeat | Wait::Over => None,
        }
    }

    fn on_heartbeat(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        let sent = out.len();
        let outcome = if is_boot_up(frame, self.plan.node) {
            self.on_boot_up(now, out)
        } else {
            self.heard = frame.data().try_into().ok().and_then(|data| decode_heartbeat(data).ok());
            match (&self.wait, self.heard) {
                (Wait::Heartbeat, Some(NmtState::Operational)) => self.next_step(now, out),
                (Wait::Heartbeat, Some(_)) => self.turn_aside(now, Problem::NotStarted, out),
                _ => None,
            }
        };
        self.exchange.asked(self.plan.node, out.get(sent..).unwrap_or_default());
        outcome
    }

    /// A node that is booted waits to be told what to do; one that starts by itself is held back.
    fn on_boot_up(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        self.heard = Some(NmtState::PreOperational);
        match self.wait {
            Wait::BootUp => {
                out.push(Order::to(self.plan.node, NmtCommand::EnterPreOperational).frame());
                self.next_step(now, out)
            }
            Wait::Read(_) | Wait::Heartbeat if self.stage == Stage::Keeping => {
                self.turn_aside(now, Problem::Rebooted, out)
            }
            Wait::Read(_) | Wait::Write(_) | Wait::Retry(_) if self.resets.is_met => {
                self.fail(Problem::Rebooted)
            }
            // Two for one reset: the first may be of the power-up. Then it does not happen again.
            Wait::Read(_) if self.resets.count == 1 => {
                self.at = self.at.saturating_sub(1);
                self.take_step(now, out)
            }
            Wait::Read(_) if self.resets.count > 1 => {
                self.fail(Problem::Duplicate(Sign::BootsTwice))
            }
            Wait::Start
            | Wait::Read(_)
            | Wait::Write(_)
            | Wait::Retry(_)
            | Wait::Heartbeat
            | Wait::Over => None,
        }
    }

    fn next_step(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        self.at += 1;
        self.take_step(now, out)
    }

    /// Begins the step in hand, or goes where the stage leads if there is none.
    fn take_step(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        let asked_at = *self.asked_at.get_or_insert(now);
        if self.stage == Stage::Finding {
            self.latency = now.since(asked_at);
        }
        let step = self.steps.get(self.at);
        self.until = now
            + match step {
                _ if self.stage == Stage::Finding => self.patience,
                Some(Step::Object(Action::Settle, _)) => REST,
                Some(Step::Object(..) | Step::Reset(_) | Step::Listen) | None => PATIENCE,
            };
        match step {
            None => return self.go(now, self.stage.next(&self.plan), out),
            Some(Step::Listen) => {
                self.until = now + self.plan.error_control.lost_after();
                self.wait = Wait::Heartbeat;
            }
            Some(Step::Reset(command)) => {
                out.push(Order::to(self.plan.node, *command).frame());
                self.resets = Resets { count: self.resets.count + 1, is_met: false };
                self.wait = Wait::BootUp;
            }
            Some(Step::Object(action, _)) if !action.writes() => self.read(now, out),
            Some(Step::Object(action, check)) => {
                let (object, value) = (check.object, bytes(&check.expected));
                let reply = if *action == Action::Command { STORE } else { REPLY };
                match Transfer::write(self.plan.node, object, value, reply, now, out) {
                    Ok(transfer) => self.wait = Wait::Write(transfer),
                    Err(error) => return self.fail(Problem::of_transfer(object, error)),
                }
            }
        }
        None
    }

    /// Goes to another stage, or ends with a configured node.
    fn go(&mut self, now: Instant, next: Next, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        match next {
            Next::Done(configuration) => {
                self.wait = Wait::Over;
                Some(Ok(configuration))
            }
            Next::Stage(stage) => {
                self.was_enabled |= stage == Stage::Disabling;
                self.stage = stage;
                self.steps = stage.steps(&self.plan);
                self.at = 0;
                self.take_step(now, out)
            }
        }
    }

    /// Goes where the stage leads otherwise; where it leads nowhere, `problem` ends the boot.
    fn turn_aside(
        &mut self,
        now: Instant,
        problem: Problem,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        match self.stage.otherwise() {
            Some(next) => self.go(now, next, out),
            None => self.fail(problem),
        }
    }

    /// Asks for the object of the step in hand. A node that is behind with its answers to the first
    /// question, which was asked again and again, has as much more time as its first answer took.
    fn read(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Some(Step::Object(action, check)) = self.steps.get(self.at) {
            let timeout = if *action == Action::Meet {
                RETRY
            } else if self.exchange.is_behind() {
                REPLY + self.latency
            } else {
                REPLY
            };
            let node = self.plan.node;
            self.wait = Wait::Read(Transfer::read(node, check.object, timeout, now, out));
        }
    }

    /// A transfer of the step in hand has ended.
    fn on_outcome(
        &mut self,
        now: Instant,
        outcome: Outcome,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        let Some(Step::Object(action, check)) = self.steps.get(self.at) else { return None };
        let (action, object) = (*action, check.object);
        let has_written = matches!(self.wait, Wait::Write(_));
        let is_patient = now < self.until;
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
            Ok(content) if action == Action::Settle => self.on_position(now, &content, out),
            Ok(content) if check.accepts(&content) => {
                self.resets.is_met |= action == Action::Meet && self.resets.count > 0;
                self.next_step(now, out)
            }
            Ok(_) if action == Action::Await && is_patient => {
                self.wait = Wait::Retry(now + RETRY);
                None
            }
            Ok(content) => {
                let problem = Problem::differs(check, &content);
                self.turn_aside(now, problem, out)
            }
            Err(SdoError::Refused(AbortCode::NO_OBJECT | AbortCode::NO_SUB_INDEX))
                if action.may_be_missing() =>
            {
                self.missing.push(object);
                self.next_step(now, out)
            }
            Err(SdoError::Silent) if action == Action::Meet && is_patient => {
                // A stopped node hears NMT commands only.
                out.push(Order::to(self.plan.node, NmtCommand::EnterPreOperational).frame());
                self.read(now, out);
                None
            }
            Err(SdoError::Silent) if self.stage == Stage::Finding => {
                self.fail(Problem::Absent { waited: self.patience })
            }
            Err(error @ SdoError::Silent) => self.fail(Problem::of_transfer(object, error)),
            Err(error) => self.turn_aside(now, Problem::of_transfer(object, error), out),
        }
    }

    /// Begins the transfer in hand again.
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

    /// Where a drive is whose power was taken off: once it has stood still for a while, it is safe.
    fn on_position(
        &mut self,
        now: Instant,
        content: &Content,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        if self.rest.is_reached(content) {
            self.next_step(now, out)
        } else if now < self.until {
            self.wait = Wait::Retry(now + RETRY);
            None
        } else {
            self.fail(Problem::Moving { waited: REST })
        }
    }

    fn fail(&mut self, problem: Problem) -> Option<BootOutcome> {
        self.wait = Wait::Over;
        Some(Err(BootError::new(&self.plan, problem)))
    }

    /// Two may be there, and one of them may push: whoever takes it is told to take its power off, and no
    /// answer is waited for.
    fn give_up_two(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        if self.plan.is_drive() {
            let off = bytes(&Value::Unsigned16(Controlword::DISABLE_VOLTAGE.0));
            // Two bytes always fit.
            Transfer::write(self.plan.node, Object::CONTROLWORD, off, REPLY, now, out).ok();
        }
        self.fail(Problem::Duplicate(Sign::AnswersTwice))
    }

    /// What it was to be told and does not have, so that it is not set.
    pub fn missing(&self) -> &[Object] {
        &self.missing
    }

    /// Whether it was found with its power on.
    pub const fn was_enabled(&self) -> bool {
        self.was_enabled
    }

    const fn is_under_way(&self) -> bool {
        !matches!(self.wait, Wait::Start | Wait::Over)
    }
}

#[cfg(test)]
mod tests {
    use canopen_rs::ByteString;
    use proptest::prelude::*;

    use super::*;
    use crate::plan::Revisions;
    use crate::testing::plans::elbow;
    use crate::testing::plans::guarded_elbow;
    use crate::testing::plans::switch_box;
    use crate::testing::scripted::Scripted;
    use crate::testing::scripted::first_boot;
    use crate::testing::scripted::stamp;

    /// Boots `device` by `plan`: the outcome, how long it took, and everything the master said.
    fn boot(plan: &NodePlan, device: &mut Scripted) -> (BootOutcome, Duration, Vec<Frame>) {
        let mut boot = Boot::new(plan);
        let (mut said, mut queue) = (Vec::new(), Vec::new());
        loop {
            let now = boot.deadline().expect("a boot without an outcome has a deadline");
            let mut outcome = boot.on_time(now, &mut queue);
            while !queue.is_empty() {
                let frame = queue.remove(0);
                said.push(frame);
                if let Some(answer) = device.answer(&frame) {
                    outcome = outcome.or(boot.on_frame(now, &answer, &mut queue));
                }
                let beat = device.heartbeat(device.state);
                outcome = outcome.or(boot.on_frame(now, &beat, &mut queue));
            }
            if let Some(outcome) = outcome {
                assert_eq!(boot.deadline(), None);
                return (outcome, now.since(Instant::ZERO), said);
            }
        }
    }

    fn failure(plan: &NodePlan, device: &mut Scripted) -> String {
        boot(plan, device).0.expect_err("a failure").to_string()
    }

    #[test]
    fn a_suitable_node_ends_up_exactly_as_planned() {
        for plan in [elbow(), switch_box()] {
            let mut device = Scripted::suiting(&plan);
            let (outcome, ..) = boot(&plan, &mut device);
            assert_eq!(outcome, Ok(Configuration::Downloaded));
            for (object, value) in plan.pdos.iter().flat_map(|pdo| pdo.writes().pop()) {
                assert_eq!(device.objects[&object], bytes(&value), "{object}");
            }
            for (object, value) in &plan.safety {
                assert_eq!(device.objects[object], bytes(value), "{object}");
            }
            assert_eq!(device.objects[&Object::PRODUCER_HEARTBEAT], [25, 0]);
        }
    }

    #[test]
    fn a_moved_emergency_is_written_off_and_on() {
        let plan = NodePlan { emcy_cob_id: 0x683, ..elbow() };
        let mut device = Scripted::suiting(&plan);
        assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
        assert_eq!(device.objects[&Object::EMCY_COB_ID], [0x83, 0x06, 0, 0]);
        let writes = device.written.iter().filter(|object| **object == Object::EMCY_COB_ID);
        assert_eq!(writes.count(), 2);
    }

    #[test]
    fn a_node_that_has_stored_its_configuration_is_read_and_not_written() {
        for plan in [elbow(), switch_box(), guarded_elbow()] {
            let mut device = Scripted::holding(&plan);
            assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Skipped), "{}", plan.name);
            let commands = [Object::CONTROLWORD, Object::MODE_OF_OPERATION];
            let commands = if plan.is_drive() { &commands[..] } else { &[] };
            assert_eq!(device.written, commands);
        }
    }

    #[test]
    fn another_stamp_or_none_is_downloaded() {
        let plan = elbow();
        for object in [Object::CONFIGURATION_DATE, Object::CONFIGURATION_TIME] {
            let mut device = Scripted::holding(&plan);
            device.objects.get_mut(&object).unwrap()[1] ^= 1;
            assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
            let mut device = Scripted::holding(&plan);
            device.objects.remove(&object);
            assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
        }
    }

    #[test]
    fn a_stamp_that_lies_about_a_single_value_is_found_out() {
        let plan = elbow();
        for (object, _) in plan.writes() {
            let mut device = Scripted::holding(&plan);
            device.objects.get_mut(&object).unwrap()[0] ^= 0x11;
            let is_off =
                plan.pdos.iter().any(|p| p.service.is_none() && p.communication(1) == object);
            let expected = if is_off { Configuration::Skipped } else { Configuration::Downloaded };
            assert_eq!(boot(&plan, &mut device).0, Ok(expected), "{object}");
        }
    }

    #[test]
    fn a_configuration_is_stored_where_that_is_asked_for_and_possible() {
        let plan = NodePlan { stores_configuration: true, ..elbow() };
        let mut device = Scripted::suiting(&plan);
        assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded), "it has no 1020h");
        device.objects.extend(stamp(&plan).map(|(object, _)| (object, vec![0; 4])));
        device.objects.insert(Object::STORE_PARAMETERS, vec![1, 0, 0, 0]);
        assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Stored));
        assert_eq!(device.objects[&Object::STORE_PARAMETERS], b"save");
        assert_eq!(device.written.last(), Some(&Object::STORE_PARAMETERS));
        assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Skipped));
    }

    #[test]
    fn defaults_are_loaded_and_the_whole_node_is_reset_where_that_is_asked_for() {
        let plan = NodePlan { restores_defaults: true, ..elbow() };
        let mut device = Scripted::suiting(&plan);
        device.objects.insert(Object::RESTORE_DEFAULTS, vec![1, 0, 0, 0]);
        let (outcome, _, said) = boot(&plan, &mut device);
        assert_eq!(outcome, Ok(Configuration::Downloaded));
        assert_eq!(device.written.first(), Some(&Object::RESTORE_DEFAULTS));
        assert!(said.contains(&Frame::new(0, [0x81, 3])));
    }

    #[test]
    fn a_node_that_is_kept_alive_is_not_reset_if_it_runs_as_planned() {
        let plan = NodePlan { keep_alive: true, ..switch_box() };
        let is_reset = |said: &[Frame]| said.iter().any(|f| f.cob_id == 0 && f.data()[0] == 0x82);
        let mut device = Scripted { state: 0x05, ..Scripted::holding(&plan) };
        let (outcome, _, said) = boot(&plan, &mut device);
        assert_eq!((outcome, is_reset(&said)), (Ok(Configuration::Kept), false));
        assert_eq!((device.state, device.written.len()), (0x05, 0));

        let mut device = Scripted { state: 0x7F, ..Scripted::holding(&plan) };
        let (outcome, _, said) = boot(&plan, &mut device);
        assert_eq!((outcome, is_reset(&said)), (Ok(Configuration::Skipped), true));

        let mut device = Scripted { state: 0x05, ..Scripted::suiting(&plan) };
        let (outcome, _, said) = boot(&plan, &mut device);
        assert_eq!((outcome, is_reset(&said)), (Ok(Configuration::Downloaded), true));
    }

    #[test]
    fn a_device_without_a_choice_of_error_behaviour_is_as_good() {
        let mut device = Scripted::suiting(&elbow());
        device.objects.remove(&Object::ERROR_BEHAVIOUR);
        assert_eq!(boot(&elbow(), &mut device).0, Ok(Configuration::Downloaded));
    }

    #[test]
    fn another_software_or_device_than_admitted_is_named() {
        let mut plan = elbow();
        plan.admission.software = ByteString::from_bytes(b"0.2").ok();
        let mut device = Scripted::suiting(&plan);
        device.objects.insert(Object::SOFTWARE_VERSION, b"0.1".to_vec());
        let message = "joint 3 (elbow), node 3: 100Ah is \"0.1\", expected \"0.2\"";
        assert_eq!(failure(&plan, &mut device), message);

        let mut plan = elbow();
        plan.admission.serial = Some(7);
        let mut device = Scripted::suiting(&plan);
        device.objects.insert(Object::SERIAL, vec![8, 0, 0, 0]);
        let message = "joint 3 (elbow), node 3: 1018h:4 is 00000008h, expected 00000007h";
        assert_eq!(failure(&plan, &mut device), message);

        let mut plan = elbow();
        plan.admission.revisions = Revisions::Compatible;
        let mut device = Scripted::suiting(&plan);
        device.objects.insert(Object::REVISION, vec![9, 0, 1, 0]);
        assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
        device.objects.insert(Object::REVISION, vec![0, 0, 2, 0]);
        let message = "joint 3 (elbow), node 3: 1018h:3 is 00020000h, \
                       expected 00010000h or a later minor revision";
        assert_eq!(failure(&plan, &mut device), message);
    }

    /// Lets a boot and its device talk until `is_it`, of what the master says.
    fn talk_until(
        boot: &mut Boot,
        device: &mut Scripted,
        is_it: impl Fn(&Frame) -> bool,
    ) -> Vec<Frame> {
        let mut queue = Vec::new();
        boot.on_time(Instant::ZERO, &mut queue);
        while let Some(said) = queue.pop() {
            if is_it(&said) {
                break;
            }
            if let Some(answer) = device.answer(&said) {
                assert_eq!(boot.on_frame(Instant::ZERO, &answer, &mut queue), None);
            }
        }
        queue
    }

    #[test]
    fn two_boot_ups_for_one_reset_are_two_nodes_if_it_happens_again() {
        let plan = elbow();
        let (mut boot, mut device) = (Boot::new(&plan), Scripted::suiting(&plan));
        let reset = Frame::new(0, [0x82, 3]);
        let mut out = talk_until(&mut boot, &mut device, |said| *said == reset);
        let boot_up = device.heartbeat(0);
        let mut outcomes: Vec<_> =
            (0..3).map(|_| boot.on_frame(Instant::ZERO, &boot_up, &mut out)).collect();
        assert_eq!(outcomes, [None, None, None], "one of them may be of the power-up");
        assert_eq!(out.iter().filter(|said| **said == reset).count(), 1, "so it is reset again");
        outcomes = vec![boot.on_frame(Instant::ZERO, &boot_up, &mut out)];
        let problem = Problem::Duplicate(Sign::BootsTwice);
        assert_eq!(outcomes, [Some(Err(BootError::new(&plan, problem)))]);
    }

    #[test]
    fn a_reply_that_comes_twice_is_of_two_nodes() {
        let plan = elbow();
        let (mut boot, mut device) = (Boot::new(&plan), Scripted::suiting(&plan));
        let mut out = Vec::new();
        boot.on_time(Instant::ZERO, &mut out);
        let reply = device.answer(&out[0]).unwrap();
        assert_eq!(boot.on_frame(Instant::ZERO, &reply, &mut out), None);
        let outcome = boot.on_frame(Instant::ZERO, &reply, &mut out);
        let problem = Problem::Duplicate(Sign::AnswersTwice);
        assert_eq!(outcome, Some(Err(BootError::new(&plan, problem))));
        let message = "answers one SDO request twice: are there two nodes with this node-id?";
        assert!(outcome.unwrap().unwrap_err().to_string().ends_with(message));
    }

    #[test]
    fn replies_to_requests_that_were_given_up_are_no_sign_of_two_nodes() {
        let plan = elbow();
        let (mut boot, mut device) = (Boot::new(&plan), Scripted::suiting(&plan));
        let mut out = Vec::new();
        boot.on_time(Instant::ZERO, &mut out);
        let reply = device.answer(&out[0]).unwrap();
        for turn in 1..5 {
            boot.on_time(Instant::ZERO + RETRY * turn, &mut out);
        }
        for _ in 0..5 {
            assert_eq!(boot.on_frame(Instant::ZERO + RETRY * 4, &reply, &mut out), None);
        }
    }

    #[test]
    fn another_product_is_named_and_neither_reset_nor_written() {
        let mut device = Scripted::suiting(&elbow());
        device.objects.insert(Object::PRODUCT_CODE, vec![1, 0, 0, 0]);
        let (outcome, _, said) = boot(&elbow(), &mut device);
        let message = "joint 3 (elbow), node 3: 1018h:2 is 00000001h, expected 04020010h";
        assert_eq!(outcome.unwrap_err().to_string(), message);
        assert!(said.iter().all(|frame| frame.cob_id == 0x603));
        assert!(device.written.is_empty());
    }

    #[test]
    fn another_kind_of_device_is_named() {
        let mut device = Scripted::suiting(&elbow());
        device.objects.insert(Object::DEVICE_TYPE, vec![0x91, 0x01, 0x02, 0]);
        let message = "joint 3 (elbow), node 3: 1000h is 00020191h, expected xxxx0192h";
        assert_eq!(failure(&elbow(), &mut device), message);
    }

    #[test]
    fn a_refused_mapping_is_named_with_its_entry() {
        let mut device = Scripted::suiting(&elbow());
        device.refuses.insert(Object::tpdo_mapping(1, 2), AbortCode::NOT_MAPPABLE);
        let message = "joint 3 (elbow), node 3: 1A00h:2 refused: 06040041h object cannot be mapped";
        assert_eq!(failure(&elbow(), &mut device), message);
    }

    #[test]
    fn a_write_that_is_confirmed_but_not_taken_is_found_out() {
        let plan = elbow();
        let written = |step| match step {
            Step::Object(action, check) if action.writes() => Some(check.object),
            Step::Object(..) | Step::Reset(_) | Step::Listen => None,
        };
        let writes: Vec<_> = first_boot(&plan).into_iter().filter_map(written).collect();
        for object in writes {
            let mut device = Scripted::suiting(&plan);
            device.forgets.push(object);
            // Bit 31 of a COB-ID set already: what is off stays off, and only on is a change.
            let message = failure_or_none(&plan, &mut device);
            let is_off =
                plan.pdos.iter().any(|p| p.service.is_none() && p.communication(1) == object);
            assert_eq!(message.is_none(), is_off, "{object}: {message:?}");
            assert!(message.is_none_or(|message| message.contains(&format!("{object} is "))));
        }
    }

    fn failure_or_none(plan: &NodePlan, device: &mut Scripted) -> Option<String> {
        boot(plan, device).0.err().map(|error| error.to_string())
    }

    #[test]
    fn an_unused_pdo_that_does_not_exist_is_off() {
        let mut device = Scripted::suiting(&elbow());
        device.objects.remove(&Object::rpdo_communication(4, 1));
        assert_eq!(boot(&elbow(), &mut device).0, Ok(Configuration::Downloaded));
        device.objects.remove(&Object::rpdo_communication(1, 1));
        let message = "joint 3 (elbow), node 3: 1400h:1 refused: 06020000h object does not exist";
        assert_eq!(failure(&elbow(), &mut device), message);
    }

    #[test]
    fn a_node_that_powers_up_slowly_is_waited_for() {
        let mut device = Scripted { deaf_for: 12, ..Scripted::suiting(&elbow()) };
        let (outcome, took, _) = boot(&elbow(), &mut device);
        assert_eq!((outcome, took), (Ok(Configuration::Downloaded), 12 * RETRY));
    }

    #[test]
    fn a_node_that_is_not_there_is_given_up_at_the_deadline() {
        let mut device = Scripted { deaf_for: u32::MAX, ..Scripted::suiting(&elbow()) };
        let (outcome, took, said) = boot(&elbow(), &mut device);
        assert_eq!(
            outcome.unwrap_err().to_string(),
            "joint 3 (elbow), node 3: does not answer, waited 2.0 s"
        );
        assert_eq!(took, PATIENCE);
        let asked = said.iter().filter(|frame| frame.data().first() == Some(&0x40)).count();
        assert_eq!(asked, 20);
    }

    #[test]
    fn a_node_that_a_former_master_stopped_is_woken() {
        let mut device = Scripted { state: 0x04, ..Scripted::suiting(&elbow()) };
        assert_eq!(boot(&elbow(), &mut device).0, Ok(Configuration::Downloaded));
    }

    #[test]
    fn an_enabled_drive_is_switched_off_before_it_is_asked_who_it_is() {
        let mut device = Scripted { state: 0x05, ..Scripted::suiting(&elbow()) };
        device.objects.insert(Object::STATUSWORD, vec![0x37, 0x16]);
        let (outcome, took, said) = boot(&elbow(), &mut device);
        let message = "joint 3 (elbow), node 3: 6041h is 1637h, expected xxx0h in the bits 0004h";
        assert_eq!(outcome.unwrap_err().to_string(), message, "it never leaves operation enabled");
        assert!(took >= PATIENCE);
        let asked_who = |frame: &Frame| frame.data().get(1..3) == Some(&[0x18, 0x10]);
        assert!(!said.iter().any(asked_who));
        assert!(!said.contains(&Frame::new(0, [0x82, 3])), "nor reset");
        assert_eq!(device.written, [Object::CONTROLWORD]);
    }

    /// Boots a drive that obeys, is found enabled, and then turns by so many counts every 100 ms.
    fn boot_moving(counts: i32, for_samples: i32) -> (BootOutcome, Duration) {
        let plan = NodePlan { rest: Some(50), ..elbow() };
        let mut device = Scripted::suiting(&plan);
        device.objects.insert(Object::STATUSWORD, vec![0x37, 0x16]);
        device.objects.insert(Object::POSITION_ACTUAL, vec![0; 4]);
        let (mut boot, mut queue, mut samples) = (Boot::new(&plan), Vec::new(), 0);
        loop {
            let now = boot.deadline().unwrap();
            let mut outcome = boot.on_time(now, &mut queue);
            while !queue.is_empty() {
                let frame = queue.remove(0);
                let is_position = frame.data().get(..3) == Some(&[0x40, 0x64, 0x60]);
                samples += i32::from(is_position);
                let at = counts * samples.min(for_samples);
                device.objects.insert(Object::POSITION_ACTUAL, at.to_le_bytes().into());
                let answer = device.answer(&frame);
                if device.written.contains(&Object::CONTROLWORD) {
                    device.objects.insert(Object::STATUSWORD, vec![0x40, 0x16]);
                }
                if let Some(answer) = answer {
                    outcome = outcome.or(boot.on_frame(now, &answer, &mut queue));
                }
            }
            if let Some(outcome) = outcome {
                assert!(boot.was_enabled());
                return (outcome, now.since(Instant::ZERO));
            }
        }
    }

    #[test]
    fn what_was_found_enabled_is_booted_once_it_stands_still() {
        let (outcome, took) = boot_moving(51, 20);
        assert_eq!((outcome, took), (Ok(Configuration::Downloaded), 24 * RETRY));
        let (outcome, took) = boot_moving(50, i32::MAX);
        assert_eq!((outcome, took), (Ok(Configuration::Downloaded), 5 * RETRY));
    }

    #[test]
    fn what_moves_on_without_its_power_is_refused() {
        let (outcome, took) = boot_moving(51, i32::MAX);
        let message = "joint 3 (elbow), node 3: still moves, 5.0 s after its power was taken off";
        assert_eq!((outcome.unwrap_err().to_string().as_str(), took), (message, REST));
    }

    #[test]
    fn a_node_that_starts_itself_is_held_back() {
        let mut device = Scripted { starts_itself: true, ..Scripted::suiting(&elbow()) };
        assert_eq!(boot(&elbow(), &mut device).0, Ok(Configuration::Downloaded));
        assert_eq!(device.state, 0x7F);
    }

    #[test]
    fn a_node_that_does_not_come_back_from_its_reset_is_named() {
        let mut device = Scripted { boots: false, ..Scripted::suiting(&elbow()) };
        let message = "joint 3 (elbow), node 3: did not boot up after its reset";
        assert_eq!(failure(&elbow(), &mut device), message);
    }

    #[test]
    fn a_mode_that_is_not_shown_is_no_mode() {
        let mut device = Scripted::suiting(&elbow());
        device.objects.insert(Object::MODE_DISPLAY, vec![0]);
        assert_eq!(
            failure(&elbow(), &mut device),
            "joint 3 (elbow), node 3: 6061h is 00h, expected 0Ah"
        );
    }

    #[test]
    fn a_node_that_reboots_in_between_has_lost_its_settings() {
        let plan = elbow();
        let mut device = Scripted::suiting(&plan);
        let (mut boot, mut queue) = (Boot::new(&plan), Vec::new());
        boot.on_time(Instant::ZERO, &mut queue);
        while device.written.len() < 5 {
            let answer = queue.pop().and_then(|frame| device.answer(&frame));
            if let Some(answer) = answer {
                assert_eq!(boot.on_frame(Instant::ZERO, &answer, &mut queue), None);
            }
        }
        let outcome = boot.on_frame(Instant::ZERO, &device.heartbeat(0), &mut queue);
        assert_eq!(outcome, Some(Err(BootError::new(&plan, Problem::Rebooted))));
        assert_eq!(boot.deadline(), None);
    }

    proptest! {
        #[test]
        fn any_frames_at_any_time_neither_panic_nor_keep_a_boot_from_its_end(
            steps in proptest::collection::vec(
                (0_u64..300_000, prop::sample::select(vec![0x583_u16, 0x703, 0x000, 0x584]), proptest::collection::vec(any::<u8>(), 0..9)),
                0..60,
            ),
            answers in proptest::collection::vec(any::<bool>(), 0..200),
        ) {
            let plan = elbow();
            let mut device = Scripted::suiting(&plan);
            let (mut boot, mut out, mut now) = (Boot::new(&plan), Vec::new(), Instant::ZERO);
            let (mut outcomes, mut answers) = (0, answers.into_iter());
            for (step, cob_id, data) in steps {
                now = now + Duration::from_micros(step);
                let noise = Frame::from_slice(cob_id, &data).unwrap();
                outcomes += u32::from(boot.on_time(now, &mut out).is_some());
                outcomes += u32::from(boot.on_frame(now, &noise, &mut out).is_some());
                while let Some(request) = out.pop() {
                    let answer = device.answer(&request).filter(|_| answers.next().unwrap_or(true));
                    if let Some(answer) = answer {
                        outcomes += u32::from(boot.on_frame(now, &answer, &mut out).is_some());
                    }
                }
            }
            for _ in 0..first_boot(&plan).len() * 60 {
                let Some(due) = boot.deadline() else { break };
                now = now.max(due);
                outcomes += u32::from(boot.on_time(now, &mut out).is_some());
            }
            prop_assert_eq!(outcomes, 1);
            prop_assert_eq!(boot.deadline(), None);
        }
    }

    #[test]
    fn a_transfer_that_another_client_breaks_begins_again() {
        let request = Frame::new(0x603, [0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
        let abort = Frame::new(0x583, [0x80, 0x00, 0x10, 0, 0, 0, 4, 5]);
        for disturbances in [0, 1, MAX_REPEATS] {
            let (mut boot, mut out) = (Boot::new(&elbow()), Vec::new());
            boot.on_time(Instant::ZERO, &mut out);
            for _ in 0..disturbances {
                boot.on_foreign_request(&request);
                assert_eq!(boot.on_frame(Instant::ZERO, &abort, &mut out), None);
            }
            assert_eq!(out.len(), 1 + usize::try_from(disturbances).unwrap());
            assert!(out.iter().all(|frame| *frame == request));
            let last = boot.on_frame(Instant::ZERO, &abort, &mut out);
            assert!(last.is_some(), "undisturbed, it counts");
        }
    }

    /// How a boot's first questions end at a server that takes `think` for each answer about 1000h, one
    /// after the other: the object asked for after that and when it was answered, in ms.
    fn slow_to_meet(think: u64) -> Option<u64> {
        let (mut boot, mut out) = (Boot::new(&elbow()), Vec::new());
        let (mut queue, mut busy_until) = (std::collections::VecDeque::new(), 0);
        for ms in 0..20_000_u64 {
            let now = Instant::from_micros(ms * 1_000);
            while boot.deadline().is_some_and(|due| due <= now) {
                assert_eq!(boot.on_time(now, &mut out), None, "{ms} ms");
            }
            let requests = out.drain(..).filter(|it| it.cob_id == 0x603 && it.data()[0] == 0x40);
            queue.extend(requests);
            let Some(request) = queue.front().copied() else { continue };
            if busy_until == 0 {
                busy_until = if request.data()[1..3] == [0x00, 0x10] { ms + think } else { ms };
            }
            if ms < busy_until {
                continue;
            }
            (busy_until, _) = (0, queue.pop_front());
            if request.data()[1..3] != [0x00, 0x10] {
                return Some(ms);
            }
            let answer = Frame::new(0x583, [0x43, 0x00, 0x10, 0, 0x92, 1, 2, 0]);
            assert_eq!(boot.on_frame(now, &answer, &mut out), None, "{ms} ms");
        }
        None
    }

    #[test]
    fn late_answers_do_not_use_up_the_time_of_the_next_question() {
        // By its first answer a server that takes 0.9 s has ten questions, each of which takes as long.
        for think in [1, 300, 900] {
            assert!(slow_to_meet(think).is_some(), "{think} ms");
        }
    }

    #[test]
    fn replies_to_another_client_are_no_sign_of_two_nodes() {
        let request = Frame::new(0x603, [0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
        let other = Frame::new(0x583, [0x43, 0x00, 0x10, 0, 0x92, 1, 2, 0]);
        let (mut boot, mut out) = (Boot::new(&elbow()), Vec::new());
        boot.on_time(Instant::ZERO, &mut out);
        boot.on_foreign_request(&request);
        for _ in 0..2 {
            assert_eq!(boot.on_frame(Instant::ZERO, &other, &mut out), None);
        }
    }
}
