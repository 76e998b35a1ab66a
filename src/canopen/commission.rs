//! Boots one node: takes the [steps](crate::canopen::plan::Step) of its plan, one SDO transfer at a time.
//!
//! Ends with a node that is configured, read back and pre-operational; starting it is the
//! [master](crate::canopen::master)'s. Every failure says which node, which object, what was expected
//! and what was found.

use std::time::Duration;

use canopen_rs::NmtCommand;
use canopen_rs::NodeId;
use thiserror::Error;

use crate::canopen::abort::AbortCode;
use crate::canopen::frame::Frame;
use crate::canopen::heartbeat::is_boot_up;
use crate::canopen::nmt::Order;
use crate::canopen::object::Object;
use crate::canopen::plan::Action;
use crate::canopen::plan::Check;
use crate::canopen::plan::Hex;
use crate::canopen::plan::NodePlan;
use crate::canopen::plan::Step;
use crate::canopen::plan::bytes;
use crate::canopen::sdo::Content;
use crate::canopen::sdo::Outcome;
use crate::canopen::sdo::SdoError;
use crate::canopen::sdo::Transfer;
use crate::time::Instant;

/// How long a node has for one SDO reply.
pub const REPLY: Duration = Duration::from_millis(500);
/// How often a node that is not ready yet is asked again.
pub const RETRY: Duration = Duration::from_millis(100);
/// How long a node may take to become ready: to power up, to boot, to change its mode.
pub const PATIENCE: Duration = Duration::from_secs(2);

/// Why a node could not be booted.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{name}, node {}: {problem}", node.raw())]
pub struct BootError {
    /// What people call it.
    pub name: String,
    /// Where it is.
    pub node: NodeId,
    /// What is wrong.
    pub problem: Problem,
}

/// What is wrong with a node that cannot be booted.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Problem {
    /// It never answered.
    #[error("does not answer")]
    Absent,
    /// It fell silent.
    #[error("{0}: no answer")]
    Silent(Object),
    /// An object is not what it should be: another device, or a write that was not taken.
    #[error("{object} is {found}, expected {expected}")]
    Differs {
        /// Which object.
        object: Object,
        /// What it should hold.
        expected: Hex,
        /// What it holds.
        found: Hex,
    },
    /// It aborted a transfer.
    #[error("{0} refused: {1}")]
    Refused(Object, AbortCode),
    /// A transfer went wrong and was aborted here.
    #[error("{0} broken off: {1}")]
    BrokenOff(Object, AbortCode),
    /// No boot-up message after a reset.
    #[error("did not boot up after reset communication")]
    NoBootUp,
    /// A boot-up message in between: its settings are gone.
    #[error("rebooted by itself")]
    Rebooted,
    /// Configured, but its heartbeat did not come.
    #[error("no heartbeat")]
    NoHeartbeat,
    /// Told to start, but it did not say it had.
    #[error("did not become operational")]
    NotStarted,
}

impl BootError {
    /// What is wrong with the node of `plan`.
    pub fn new(plan: &NodePlan, problem: Problem) -> Self {
        Self { name: plan.name.clone(), node: plan.node, problem }
    }
}

/// The boot of one node.
#[derive(Clone, Debug)]
pub struct Boot {
    name: String,
    node: NodeId,
    steps: Vec<Step>,
    /// The step in hand.
    at: usize,
    /// When patience with it ends.
    until: Instant,
    /// Whether it was reset and met again, so that a boot-up message is news.
    was_reset: bool,
    wait: Wait,
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
    /// The time to ask again.
    Retry(Instant),
    /// Nothing: configured, or failed.
    Over,
}

impl Boot {
    /// A boot that begins with the first call of [`on_time`](Self::on_time).
    pub fn new(plan: &NodePlan) -> Self {
        Self {
            name: plan.name.clone(),
            node: plan.node,
            steps: plan.steps(),
            at: 0,
            until: Instant::ZERO,
            was_reset: false,
            wait: Wait::Start,
        }
    }

    /// Takes one received frame; the outcome comes once.
    pub fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Result<(), BootError>> {
        if is_boot_up(frame, self.node) {
            return self.on_boot_up(now, out);
        }
        let (Wait::Read(transfer) | Wait::Write(transfer)) = &mut self.wait else { return None };
        let outcome = transfer.on_frame(now, frame, out)?;
        self.on_outcome(now, outcome, out)
    }

    /// Does what is due; the outcome comes once.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Result<(), BootError>> {
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
            Wait::Retry(_) | Wait::BootUp | Wait::Over => None,
        }
    }

    /// When [`on_time`](Self::on_time) must next be called; `None` once it is over.
    pub const fn deadline(&self) -> Option<Instant> {
        match &self.wait {
            Wait::Start => Some(Instant::ZERO),
            Wait::Read(transfer) | Wait::Write(transfer) => transfer.deadline(),
            Wait::Retry(at) => Some(*at),
            Wait::BootUp => Some(self.until),
            Wait::Over => None,
        }
    }

    /// A node that is booted waits to be told what to do; one that starts by itself is held back.
    fn on_boot_up(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Result<(), BootError>> {
        match self.wait {
            Wait::BootUp => {
                out.push(Order::to(self.node, NmtCommand::EnterPreOperational).frame());
                self.next_step(now, out)
            }
            Wait::Read(_) | Wait::Write(_) | Wait::Retry(_) if self.was_reset => {
                self.fail(Problem::Rebooted)
            }
            Wait::Start | Wait::Read(_) | Wait::Write(_) | Wait::Retry(_) | Wait::Over => None,
        }
    }

    fn next_step(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Result<(), BootError>> {
        self.at += 1;
        self.take_step(now, out)
    }

    /// Begins the step in hand, or ends with a configured node if there is none.
    fn take_step(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Result<(), BootError>> {
        self.until = now + PATIENCE;
        match self.steps.get(self.at) {
            None => {
                self.wait = Wait::Over;
                return Some(Ok(()));
            }
            Some(Step::ResetCommunication) => {
                out.push(Order::to(self.node, NmtCommand::ResetCommunication).frame());
                self.wait = Wait::BootUp;
            }
            Some(Step::Object(Action::Meet | Action::Compare | Action::Await, _)) => {
                self.read(now, out);
            }
            Some(Step::Object(Action::Write | Action::SwitchOff, check)) => {
                let value = bytes(&check.expected);
                match Transfer::write(self.node, check.object, value, REPLY, now, out) {
                    Ok(transfer) => self.wait = Wait::Write(transfer),
                    Err(error) => return self.fail(problem(check.object, error)),
                }
            }
        }
        None
    }

    /// Asks for the object of the step in hand.
    fn read(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Some(Step::Object(action, check)) = self.steps.get(self.at) {
            let timeout = if *action == Action::Meet { RETRY } else { REPLY };
            self.wait = Wait::Read(Transfer::read(self.node, check.object, timeout, now, out));
        }
    }

    /// A transfer of the step in hand has ended.
    fn on_outcome(
        &mut self,
        now: Instant,
        outcome: Outcome,
        out: &mut Vec<Frame>,
    ) -> Option<Result<(), BootError>> {
        let Some(Step::Object(action, check)) = self.steps.get(self.at) else { return None };
        let has_written = matches!(self.wait, Wait::Write(_));
        let is_patient = now < self.until;
        match outcome {
            Ok(_) if has_written => self.read(now, out),
            Ok(content) if check.accepts(&content) => {
                // Met again after its reset: from here on a boot-up is news. Before, it may be an old
                // one that had to wait for the bus.
                self.was_reset |= self.at > 0 && *action == Action::Meet;
                return self.next_step(now, out);
            }
            Ok(_) if *action == Action::Await && is_patient => self.wait = Wait::Retry(now + RETRY),
            Ok(content) => {
                let problem = differs(check, &content);
                return self.fail(problem);
            }
            Err(SdoError::Refused(AbortCode::NO_OBJECT)) if *action == Action::SwitchOff => {
                return self.next_step(now, out);
            }
            Err(SdoError::Silent) if *action == Action::Meet && is_patient => {
                // A stopped node hears NMT commands only.
                out.push(Order::to(self.node, NmtCommand::EnterPreOperational).frame());
                self.read(now, out);
            }
            Err(SdoError::Silent) if *action == Action::Meet && self.at == 0 => {
                return self.fail(Problem::Absent);
            }
            Err(error) => {
                let problem = problem(check.object, error);
                return self.fail(problem);
            }
        }
        None
    }

    fn fail(&mut self, problem: Problem) -> Option<Result<(), BootError>> {
        self.wait = Wait::Over;
        Some(Err(BootError { name: std::mem::take(&mut self.name), node: self.node, problem }))
    }
}

/// What a failed transfer says about its object.
const fn problem(object: Object, error: SdoError) -> Problem {
    match error {
        SdoError::Refused(code) => Problem::Refused(object, code),
        SdoError::BrokenOff(code) => Problem::BrokenOff(object, code),
        SdoError::Silent => Problem::Silent(object),
    }
}

fn differs(check: &Check, content: &Content) -> Problem {
    let (expected, found) = (check.wanted(), check.found(content));
    Problem::Differs { object: check.object, expected, found }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::plan::tests::elbow;
    use crate::canopen::plan::tests::switch_box;
    use crate::canopen::scripted::Scripted;
    use canopen_rs::Value;
    use proptest::prelude::*;

    /// Boots `device` by `plan`: the outcome, how long it took, and everything the master said.
    fn boot(
        plan: &NodePlan,
        device: &mut Scripted,
    ) -> (Result<(), BootError>, Duration, Vec<Frame>) {
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
            assert_eq!(outcome, Ok(()));
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
        assert_eq!(boot(&plan, &mut device).0, Ok(()));
        assert_eq!(device.objects[&Object::EMCY_COB_ID], [0x83, 0x06, 0, 0]);
        let writes = device.written.iter().filter(|object| **object == Object::EMCY_COB_ID);
        assert_eq!(writes.count(), 2);
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
        let writes: Vec<Object> = plan
            .steps()
            .into_iter()
            .filter_map(|step| match step {
                Step::Object(Action::Write | Action::SwitchOff, check) => Some(check.object),
                Step::Object(..) | Step::ResetCommunication => None,
            })
            .collect();
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
        assert_eq!(boot(&elbow(), &mut device).0, Ok(()));
        device.objects.remove(&Object::rpdo_communication(1, 1));
        let message = "joint 3 (elbow), node 3: 1400h:1 refused: 06020000h object does not exist";
        assert_eq!(failure(&elbow(), &mut device), message);
    }

    #[test]
    fn a_cob_id_may_come_back_with_the_bit_that_forbids_remote_frames() {
        let plan = elbow();
        let mut check = None;
        for step in plan.steps() {
            if let Step::Object(Action::Write, found) = step
                && found.object == Object::tpdo_communication(1, 1)
            {
                check = Some(found);
            }
        }
        let (check, mut out) = (check.unwrap(), Vec::new());
        for (byte, accepted) in [(0x40, true), (0x00, true), (0x80, false), (0x20, false)] {
            let mut read = Transfer::read(plan.node, check.object, REPLY, Instant::ZERO, &mut out);
            let reply = Frame::new(0x583, [0x43, 0x00, 0x18, 1, 0x83, 0x01, 0, byte]);
            let content = read.on_frame(Instant::ZERO, &reply, &mut out).unwrap().unwrap();
            assert_eq!(check.accepts(&content), accepted, "{byte:02X}");
        }
    }

    #[test]
    fn a_node_that_powers_up_slowly_is_waited_for() {
        let mut device = Scripted { deaf_for: 12, ..Scripted::suiting(&elbow()) };
        let (outcome, took, _) = boot(&elbow(), &mut device);
        assert_eq!((outcome, took), (Ok(()), 12 * RETRY));
    }

    #[test]
    fn a_node_that_is_not_there_is_given_up_at_the_deadline() {
        let mut device = Scripted { deaf_for: u32::MAX, ..Scripted::suiting(&elbow()) };
        let (outcome, took, said) = boot(&elbow(), &mut device);
        assert_eq!(outcome.unwrap_err().to_string(), "joint 3 (elbow), node 3: does not answer");
        assert_eq!(took, PATIENCE);
        let asked = said.iter().filter(|frame| frame.data().first() == Some(&0x40)).count();
        assert_eq!(asked, 20);
    }

    #[test]
    fn a_node_that_a_former_master_stopped_is_woken() {
        let mut device = Scripted { state: 0x04, ..Scripted::suiting(&elbow()) };
        assert_eq!(boot(&elbow(), &mut device).0, Ok(()));
    }

    #[test]
    fn an_enabled_drive_is_reset_before_anything_is_written_and_switched_off_first() {
        let mut device = Scripted { state: 0x05, ..Scripted::suiting(&elbow()) };
        device.objects.insert(Object::STATUSWORD, vec![0x37, 0x16]);
        let (outcome, took, said) = boot(&elbow(), &mut device);
        let message = "joint 3 (elbow), node 3: 6041h is 1637h, expected xxx0h in the bits 0004h";
        assert_eq!(outcome.unwrap_err().to_string(), message, "it never leaves operation enabled");
        assert!(took >= PATIENCE);
        let writes = |frame: &&Frame| frame.cob_id == 0x603 && frame.data()[0] >> 5 == 1;
        let (reset, first) =
            (Frame::new(0, [0x82, 3]), said.iter().position(|f| writes(&f)).unwrap());
        assert!(said[..first].contains(&reset));
        assert_eq!(device.written, [Object::CONTROLWORD]);
        assert_eq!(device.state, 0x7F);
    }

    #[test]
    fn a_node_that_starts_itself_is_held_back() {
        let mut device = Scripted { starts_itself: true, ..Scripted::suiting(&elbow()) };
        assert_eq!(boot(&elbow(), &mut device).0, Ok(()));
        assert_eq!(device.state, 0x7F);
    }

    #[test]
    fn a_node_that_does_not_come_back_from_its_reset_is_named() {
        let mut device = Scripted { boots: false, ..Scripted::suiting(&elbow()) };
        let message = "joint 3 (elbow), node 3: did not boot up after reset communication";
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
            for _ in 0..plan.steps().len() * 30 {
                let Some(due) = boot.deadline() else { break };
                now = now.max(due);
                outcomes += u32::from(boot.on_time(now, &mut out).is_some());
            }
            prop_assert_eq!(outcomes, 1);
            prop_assert_eq!(boot.deadline(), None);
        }
    }

    #[test]
    fn a_number_of_another_size_is_not_taken_for_the_value() {
        let mut device = Scripted::suiting(&elbow());
        device.objects.insert(Object::VENDOR_ID, vec![0x8C, 0x0F]);
        let message = "joint 3 (elbow), node 3: 1018h:1 is 0F8Ch, expected 00000F8Ch";
        assert_eq!(failure(&elbow(), &mut device), message);
        let check = Check::exactly(Object::MODE_DISPLAY, Value::Integer8(10));
        assert!(!check.accepts(&Content::default()));
    }
}
