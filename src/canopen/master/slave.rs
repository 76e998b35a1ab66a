//! One node, as its master sees it: booting, watched, awaited or given up.
//!
//! It reports what it learns; what that means for all of them is the
//! [master](crate::master)'s.

use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::sdo::request_cob_id;
use canopen_rs::sdo::response_cob_id;

use crate::drive::Statusword;
use crate::frame::Channel;
use crate::frame::Frame;
use crate::guarding::Guard;
use crate::heartbeat::Consumer;
use crate::heartbeat::Health;
use crate::heartbeat::News;
use crate::master::boot_error::BootError;
use crate::master::boot_error::Problem;
use crate::master::commission::Boot;
use crate::master::commission::BootOutcome;
use crate::master::error_history::History;
use crate::master::inquiry::Answer;
use crate::master::inquiry::Inquiry;
use crate::master::read_back;
use crate::master::read_back::ReadBack;
use crate::master::read_back::Setting;
use crate::master::sdo_traffic::Foreign;
use crate::master::sdo_traffic::SdoTraffic;
use crate::master::steps::Configuration;
use crate::object::Object;
use crate::plan::ErrorControl;
use crate::plan::NodePlan;
use units::time::Instant;

/// How often a missing optional node is looked for, should its boot-up message not be heard.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// One node and what is known of it.
#[derive(Clone, Debug)]
pub(super) struct Slave {
    pub(super) channel: Channel,
    pub(super) plan: NodePlan,
    stage: Stage,
    /// Whether it was missing when the others started.
    pub(super) is_late: bool,
    /// Whether its last boot found it with its power on.
    pub(super) was_enabled: bool,
    /// What its last boot found that it does not have.
    pub(super) missing: Vec<Object>,
    traffic: SdoTraffic,
    /// Another client has read from it since its last boot.
    is_read_by_another: bool,
}

/// How far it is.
#[derive(Clone, Debug)]
enum Stage {
    Booting(Box<Boot>),
    Watched {
        watch: Watch,
        inquiry: Option<Box<Inquiry>>,
        /// A setting that is read again; given up for an inquiry.
        reading: Option<read_back::Reading>,
    },
    /// Missing and optional; looked for at this time, or when it is heard.
    Awaited(Instant),
    Failed,
}

/// How it is watched.
#[derive(Clone, Debug)]
enum Watch {
    Heartbeat(Consumer),
    Guarding(Guard),
}

/// What a node has come to.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Report {
    /// It is configured, and watched from now on.
    Configured(Configuration),
    /// It could not be booted.
    Failed(BootError),
    /// It is optional and missing; said once.
    Absent(Duration),
    /// It has said something new, or nothing for too long.
    News(News),
    /// What it remembers of its errors.
    History(History),
    /// What its power stage is in.
    Statusword(Statusword),
    /// What came of reading an object again.
    ReadBack(Object, ReadBack),
}

impl Slave {
    /// One that begins to boot with the first call of [`on_time`](Self::on_time).
    pub(super) fn new(channel: Channel, plan: NodePlan) -> Self {
        let stage = Stage::Booting(Box::new(Boot::new(&plan)));
        Self {
            channel,
            plan,
            stage,
            is_late: false,
            was_enabled: false,
            missing: Vec::new(),
            traffic: SdoTraffic::default(),
            is_read_by_another: false,
        }
    }

    /// Begins again, as after power-up.
    pub(super) fn restart(&mut self) {
        self.stage = Stage::Booting(Box::new(Boot::new(&self.plan)));
        self.is_late = false;
        self.is_read_by_another = false;
    }

    /// What is known of it.
    pub(super) const fn health(&self) -> Health {
        match &self.stage {
            Stage::Booting(_) | Stage::Awaited(_) => Health::NeverSeen,
            Stage::Watched { watch: Watch::Heartbeat(consumer), .. } => consumer.health(),
            Stage::Watched { watch: Watch::Guarding(guard), .. } => guard.health(),
            Stage::Failed => Health::Lost,
        }
    }

    /// Whether the others wait for its boot.
    pub(super) const fn is_pending(&self) -> bool {
        !self.is_late && matches!(self.stage, Stage::Booting(_))
    }

    /// Whether it is configured.
    pub(super) const fn is_watched(&self) -> bool {
        matches!(self.stage, Stage::Watched { .. })
    }

    /// Whether it is configured and in time, but not heard to be operational yet.
    pub(super) fn is_starting(&self) -> bool {
        let is_operational = self.health() == Health::Alive(NmtState::Operational);
        !self.is_late && self.is_watched() && !is_operational
    }

    /// Whether it was given up.
    pub(super) const fn has_failed(&self) -> bool {
        matches!(self.stage, Stage::Failed)
    }

    /// Takes one frame that bears its node-id; frames to send are appended to `out`.
    pub(super) fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Report> {
        match &mut self.stage {
            Stage::Booting(boot) => {
                let outcome = boot.on_frame(now, frame, out)?;
                self.after_boot(now, outcome)
            }
            Stage::Watched { watch, inquiry, reading } => {
                if let Some(answer) =
                    inquiry.as_mut().and_then(|inquiry| inquiry.on_frame(now, frame, out))
                {
                    *inquiry = None;
                    return Report::of(answer);
                }
                let read = reading.as_mut().and_then(|reading| reading.on_frame(now, frame, out));
                if let Some(report) = finish(reading, read) {
                    return Some(report);
                }
                watch.on_frame(now, frame).map(Report::News)
            }
            Stage::Awaited(_) => {
                if frame.cob_id == heartbeat_cob_id(self.plan.node) {
                    self.stage = Stage::Booting(Box::new(Boot::new(&self.plan)));
                }
                None
            }
            Stage::Failed => None,
        }
    }

    /// Takes a frame that this master sends to it.
    pub(super) fn on_sent(&mut self, frame: &Frame) {
        if frame.cob_id == request_cob_id(self.plan.node) {
            self.traffic.on_sent(frame);
        }
    }

    /// Takes a request that another client has sent to its SDO server.
    pub(super) fn on_foreign_request(&mut self, now: Instant, frame: &Frame) -> Option<Foreign> {
        let foreign = self.traffic.on_request(now, frame)?;
        match &mut self.stage {
            Stage::Booting(boot) => boot.on_foreign_request(frame),
            Stage::Watched { inquiry, reading, .. } => {
                inquiry.iter_mut().for_each(|inquiry| inquiry.disturb());
                reading.iter_mut().for_each(read_back::Reading::disturb);
            }
            Stage::Awaited(_) | Stage::Failed => {}
        }
        Some(foreign)
    }

    /// Returns whether a reply of its SDO server confirms a download that this master did not request.
    /// While it boots, a second node of its node-id is the likelier reason.
    pub(super) fn is_foreign_reply(&mut self, now: Instant, frame: &Frame) -> bool {
        frame.cob_id == response_cob_id(self.plan.node)
            && self.traffic.is_foreign_reply(now, frame)
            && self.is_watched()
    }

    /// Notes that another client reads from it; returns whether that is new.
    pub(super) const fn is_newly_read(&mut self) -> bool {
        !std::mem::replace(&mut self.is_read_by_another, true)
    }

    /// Does what is due.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Report> {
        match &mut self.stage {
            Stage::Booting(boot) => {
                let outcome = boot.on_time(now, out)?;
                self.after_boot(now, outcome)
            }
            Stage::Watched { watch, inquiry, reading } => {
                if let Some(answer) = inquiry.as_mut().and_then(|asked| asked.on_time(now, out)) {
                    *inquiry = None;
                    return Report::of(answer);
                }
                let read = reading.as_mut().and_then(|reading| reading.on_time(now, out));
                if let Some(report) = finish(reading, read) {
                    return Some(report);
                }
                watch.on_time(now, out).map(Report::News)
            }
            Stage::Awaited(look) if now >= *look => {
                self.stage = Stage::Booting(Box::new(Boot::looking(&self.plan)));
                None
            }
            Stage::Awaited(_) | Stage::Failed => None,
        }
    }

    /// When [`on_time`](Self::on_time) must next be called.
    pub(super) fn deadline(&self) -> Option<Instant> {
        match &self.stage {
            Stage::Booting(boot) => boot.deadline(),
            Stage::Watched { watch, inquiry, reading } => {
                let inquiry = inquiry.as_ref().and_then(|inquiry| inquiry.deadline());
                let reading = reading.as_ref().map(read_back::Reading::deadline);
                watch.deadline().into_iter().chain(inquiry).chain(reading).min()
            }
            Stage::Awaited(look) => Some(*look),
            Stage::Failed => None,
        }
    }

    /// Begins to read what it remembers of its errors, if it can be asked and is not being asked.
    pub(super) fn read_history(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Stage::Watched { inquiry: inquiry @ None, reading, .. } = &mut self.stage {
            *reading = None;
            *inquiry = Some(Box::new(Inquiry::history(self.plan.node, now, out)));
        }
    }

    /// Begins to read what its power stage is in, if it can be asked and is not being asked.
    pub(super) fn read_statusword(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Stage::Watched { inquiry: inquiry @ None, reading, .. } = &mut self.stage {
            *reading = None;
            *inquiry = Some(Box::new(Inquiry::statusword(self.plan.node, now, out)));
        }
    }

    /// Begins to read an object again, if it can be asked and is not being asked; returns whether it does.
    pub(super) fn read_back(
        &mut self,
        now: Instant,
        setting: Setting,
        out: &mut Vec<Frame>,
    ) -> bool {
        let Stage::Watched { inquiry: None, reading: reading @ None, .. } = &mut self.stage else {
            return false;
        };
        *reading = Some(read_back::Reading::begin(self.plan.node, setting, now, out));
        true
    }

    /// Tells it to take its power off. What it is being asked is given up for that.
    pub(super) fn power_off(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Stage::Watched { inquiry, reading, .. } = &mut self.stage {
            *reading = None;
            *inquiry = Inquiry::power_off(self.plan.node, now, out).map(Box::new);
        }
    }

    /// It was late and has gone again: it is looked for at once, and nothing is said.
    pub(super) fn look_again(&mut self, now: Instant) {
        self.stage = Stage::Awaited(now);
    }

    /// Gives it up.
    pub(super) fn fail(&mut self, problem: Problem) -> BootError {
        self.stage = Stage::Failed;
        BootError::new(&self.plan, problem)
    }

    /// Goes on to the watch; a missing optional node is awaited, with one report of it.
    fn after_boot(&mut self, now: Instant, outcome: BootOutcome) -> Option<Report> {
        if let Stage::Booting(boot) = &self.stage {
            self.was_enabled = boot.was_enabled();
            self.missing = boot.missing().to_vec();
        }
        match outcome {
            Ok(configuration) => {
                let watch = Watch::new(&self.plan, now);
                self.stage = Stage::Watched { watch, inquiry: None, reading: None };
                Some(Report::Configured(configuration))
            }
            Err(BootError { problem: Problem::Absent { waited }, .. }) if self.plan.is_optional => {
                self.stage = Stage::Awaited(now + LOOK_EVERY);
                let was_known = std::mem::replace(&mut self.is_late, true);
                (!was_known).then_some(Report::Absent(waited))
            }
            Err(error) if self.is_late && error.problem.is_passing() => {
                self.stage = Stage::Awaited(now + LOOK_EVERY);
                None
            }
            Err(error) => {
                self.stage = Stage::Failed;
                Some(Report::Failed(error))
            }
        }
    }
}

/// The report of a reading that has ended, which it takes away.
fn finish(reading: &mut Option<read_back::Reading>, read: Option<ReadBack>) -> Option<Report> {
    let (object, read) = (reading.as_ref()?.object(), read?);
    *reading = None;
    Some(Report::ReadBack(object, read))
}

impl Report {
    /// What an answer comes to, if it is to be told.
    const fn of(answer: Answer) -> Option<Self> {
        match answer {
            Answer::History(history) => Some(Self::History(history)),
            Answer::Statusword(statusword) => Some(Self::Statusword(statusword)),
            Answer::Nothing => None,
        }
    }
}

impl Watch {
    fn new(plan: &NodePlan, now: Instant) -> Self {
        match plan.error_control {
            ErrorControl::Heartbeat { period_ms, lost_after } => {
                let period = Duration::from_millis(u64::from(period_ms));
                let watch = Consumer::new(plan.node, lost_after, now + lost_after);
                Self::Heartbeat(watch.every(period))
            }
            ErrorControl::Guarding(guarding) => {
                Self::Guarding(Guard::new(plan.node, guarding, now))
            }
        }
    }

    fn on_frame(&mut self, now: Instant, frame: &Frame) -> Option<News> {
        match self {
            Self::Heartbeat(consumer) => consumer.on_frame(now, frame),
            Self::Guarding(guard) => guard.on_frame(now, frame),
        }
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<News> {
        match self {
            Self::Heartbeat(consumer) => consumer.on_time(now),
            Self::Guarding(guard) => guard.on_time(now, out),
        }
    }

    fn deadline(&self) -> Option<Instant> {
        match self {
            Self::Heartbeat(consumer) => consumer.deadline(),
            Self::Guarding(guard) => guard.deadline(),
        }
    }
}
