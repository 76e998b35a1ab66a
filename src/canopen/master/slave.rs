//! One node as its master sees it: booting, monitored, awaited or failed.
//!
//! Reports changes to the [master](crate::master), which decides the consequence for the network.

use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::sdo::{request_cob_id, response_cob_id};

use crate::abort::AbortCode;
use crate::drive::Statusword;
use crate::frame::{Channel, Frame};
use crate::heartbeat::{Health, HeartbeatEvent};
use crate::master::boot_error::{BootError, Problem};
use crate::master::commission::{Boot, BootOutcome};
use crate::master::error_history::History;
use crate::master::inquiry::{Answer, Inquiry};
use crate::master::monitoring_off::Ended;
use crate::master::read_back::{self, ReadBack, Setting};
use crate::master::sdo_traffic::{Foreign, SdoTraffic};
use crate::master::steps::Configuration;
use crate::master::watch::Watch;
use crate::nameplate::Held;
use crate::object::Object;
use crate::plan::NodePlan;
use units::time::Instant;

/// Period at which an absent optional node is polled, in case its boot-up message was lost.
const POLL_PERIOD: Duration = Duration::from_secs(1);

/// One node and its state.
#[derive(Clone, Debug)]
pub(super) struct Slave {
    pub(super) channel: Channel,
    pub(super) plan: NodePlan,
    stage: Stage,
    /// Set if it was absent when the other nodes started.
    pub(super) is_late: bool,
    /// Set if its last boot found its power on.
    pub(super) was_enabled: bool,
    /// Optional objects that its last boot found absent, or whose value was refused.
    pub(super) missing: Vec<Object>,
    /// Those of which the value was refused, until they are reported.
    pub(super) refused: Vec<(Object, AbortCode)>,
    /// Nameplate that its last boot read.
    pub(super) held: Vec<Held>,
    traffic: SdoTraffic,
    /// Set if another client has read from it since its last boot.
    is_read_by_another: bool,
}

/// Progress of the node.
#[derive(Clone, Debug)]
enum Stage {
    Booting(Box<Boot>),
    Watched {
        watch: Watch,
        inquiry: Option<Box<Inquiry>>,
        /// Read-back under way; abandoned for an inquiry.
        reading: Option<read_back::ObjectReader>,
    },
    /// Absent and optional: polled at this time, or booted at its next heartbeat.
    Awaited(Instant),
    Failed,
}

/// Change of a node.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Report {
    /// Configured, and monitored from now on.
    Configured(Configuration),
    /// Boot failed.
    Failed(BootError),
    /// Optional and absent. Reported once.
    Absent(Duration),
    /// Change of its NMT state, or loss of its heartbeat.
    HeartbeatEvent(HeartbeatEvent),
    /// Content of its error history (1003h).
    History(History),
    /// Content of its statusword (6041h).
    Statusword(Statusword),
    /// Outcome of a read-back.
    ReadBack(Object, ReadBack),
    /// Outcome of the end of its monitoring of the master.
    Monitoring(Ended),
}

impl Slave {
    /// Returns a slave that starts to boot with the first call of [`on_time`](Self::on_time).
    pub(super) fn new(channel: Channel, plan: NodePlan) -> Self {
        let stage = Stage::Booting(Box::new(Boot::new(&plan)));
        Self {
            channel,
            plan,
            stage,
            is_late: false,
            was_enabled: false,
            missing: Vec::new(),
            refused: Vec::new(),
            held: Vec::new(),
            traffic: SdoTraffic::default(),
            is_read_by_another: false,
        }
    }

    /// Starts again, as after power-up.
    pub(super) fn restart(&mut self) {
        self.stage = Stage::Booting(Box::new(Boot::new(&self.plan)));
        self.is_late = false;
        self.is_read_by_another = false;
    }

    /// Returns the NMT state, as far as it is known.
    pub(super) const fn health(&self) -> Health {
        match &self.stage {
            Stage::Booting(_) | Stage::Awaited(_) => Health::NeverSeen,
            Stage::Watched { watch, .. } => watch.health(),
            Stage::Failed => Health::Lost,
        }
    }

    /// Returns whether the other nodes wait for its boot.
    pub(super) const fn is_pending(&self) -> bool {
        !self.is_late && matches!(self.stage, Stage::Booting(_))
    }

    /// Returns whether it is configured and monitored.
    pub(super) const fn is_watched(&self) -> bool {
        matches!(self.stage, Stage::Watched { .. })
    }

    /// Returns whether it is configured in time but has not reported operational yet.
    pub(super) fn is_starting(&self) -> bool {
        let is_operational = self.health() == Health::Alive(NmtState::Operational);
        !self.is_late && self.is_watched() && !is_operational
    }

    /// Returns whether it has failed.
    pub(super) const fn has_failed(&self) -> bool {
        matches!(self.stage, Stage::Failed)
    }

    /// Takes one frame with its node-id; frames to send are appended to `out`.
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
                watch.on_frame(now, frame).map(Report::HeartbeatEvent)
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

    /// Takes a frame that this master sends to the node.
    pub(super) fn on_sent(&mut self, frame: &Frame) {
        if frame.cob_id == request_cob_id(self.plan.node) {
            self.traffic.on_sent(frame);
        }
    }

    /// Takes a request that another client has sent to the node's SDO server.
    pub(super) fn on_foreign_request(&mut self, now: Instant, frame: &Frame) -> Option<Foreign> {
        let foreign = self.traffic.on_request(now, frame)?;
        match &mut self.stage {
            Stage::Booting(boot) => boot.on_foreign_request(frame),
            Stage::Watched { inquiry, reading, .. } => {
                inquiry.iter_mut().for_each(|inquiry| inquiry.disturb());
                reading.iter_mut().for_each(read_back::ObjectReader::disturb);
            }
            Stage::Awaited(_) | Stage::Failed => {}
        }
        Some(foreign)
    }

    /// Returns whether an SDO reply confirms a download that this master did not request. During the boot a
    /// second node with the same node-id is the likelier reason.
    pub(super) fn is_foreign_reply(&mut self, now: Instant, frame: &Frame) -> bool {
        frame.cob_id == response_cob_id(self.plan.node)
            && self.traffic.is_foreign_reply(now, frame)
            && self.is_watched()
    }

    /// Records an upload by another client; returns whether it is the first since the boot.
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
                if let Some(answer) = inquiry.as_mut().and_then(|inquiry| inquiry.on_time(now, out))
                {
                    *inquiry = None;
                    return Report::of(answer);
                }
                let read = reading.as_mut().and_then(|reading| reading.on_time(now, out));
                if let Some(report) = finish(reading, read) {
                    return Some(report);
                }
                watch.on_time(now, out).map(Report::HeartbeatEvent)
            }
            Stage::Awaited(poll_at) if now >= *poll_at => {
                self.stage = Stage::Booting(Box::new(Boot::probe(&self.plan)));
                None
            }
            Stage::Awaited(_) | Stage::Failed => None,
        }
    }

    /// Time of the next call of [`on_time`](Self::on_time).
    pub(super) fn deadline(&self) -> Option<Instant> {
        match &self.stage {
            Stage::Booting(boot) => boot.deadline(),
            Stage::Watched { watch, inquiry, reading } => {
                let inquiry = inquiry.as_ref().and_then(|inquiry| inquiry.deadline());
                let reading = reading.as_ref().map(read_back::ObjectReader::deadline);
                watch.deadline().into_iter().chain(inquiry).chain(reading).min()
            }
            Stage::Awaited(poll_at) => Some(*poll_at),
            Stage::Failed => None,
        }
    }

    /// Starts to read the error history, unless another request is under way.
    pub(super) fn read_error_history(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Stage::Watched { inquiry: inquiry @ None, reading, .. } = &mut self.stage {
            *reading = None;
            *inquiry = Some(Box::new(Inquiry::history(self.plan.node, now, out)));
        }
    }

    /// Starts to read the statusword, unless another request is under way.
    pub(super) fn read_statusword(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Stage::Watched { inquiry: inquiry @ None, reading, .. } = &mut self.stage {
            *reading = None;
            *inquiry = Some(Box::new(Inquiry::statusword(self.plan.node, now, out)));
        }
    }

    /// Starts to read an object again; returns false while another request is under way.
    pub(super) fn read_back(
        &mut self,
        now: Instant,
        setting: Setting,
        out: &mut Vec<Frame>,
    ) -> bool {
        let Stage::Watched { inquiry: None, reading: reading @ None, .. } = &mut self.stage else {
            return false;
        };
        *reading = Some(read_back::ObjectReader::start(self.plan.node, setting, now, out));
        true
    }

    /// Stops guarding the node, if it is guarded.
    pub(super) const fn pause_guarding(&mut self) {
        if let Stage::Watched { watch, .. } = &mut self.stage {
            watch.pause();
        }
    }

    /// Guards the node again.
    pub(super) fn resume_guarding(&mut self, now: Instant) {
        if let Stage::Watched { watch, .. } = &mut self.stage {
            watch.resume(now);
        }
    }

    /// Sends "disable voltage", abandons any request under way, and reads the statusword next.
    pub(super) fn power_off(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Stage::Watched { inquiry, reading, .. } = &mut self.stage {
            *reading = None;
            *inquiry = Inquiry::power_off(self.plan.node, now, out).map(Box::new);
        }
    }

    /// Reads the statusword ahead of all other requests, unless an urgent one is under way.
    pub(super) fn read_statusword_at_once(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Stage::Watched { inquiry, reading, .. } = &mut self.stage
            && !inquiry.as_ref().is_some_and(|inquiry| inquiry.is_urgent())
        {
            *reading = None;
            *inquiry = Some(Box::new(Inquiry::statusword(self.plan.node, now, out).urgent()));
        }
    }

    /// Abandons any request under way: the node no longer answers.
    pub(super) fn abandon_requests(&mut self) {
        if let Stage::Watched { inquiry, reading, .. } = &mut self.stage {
            (*inquiry, *reading) = (None, None);
        }
    }

    /// Returns whether an urgent request is under way.
    pub(super) fn has_urgent_request(&self) -> bool {
        matches!(&self.stage, Stage::Watched { inquiry: Some(inquiry), .. } if inquiry.is_urgent())
    }

    /// Ends its monitoring of the master, and abandons any request under way. Returns false if there is nothing to end.
    pub(super) fn end_monitoring(&mut self, now: Instant, out: &mut Vec<Frame>) -> bool {
        let Stage::Watched { inquiry, reading, .. } = &mut self.stage else { return false };
        let ending = Inquiry::monitoring_off(&self.plan, &self.missing, now, out);
        let is_requested = ending.is_some();
        if is_requested {
            *reading = None;
            *inquiry = ending.map(Box::new);
        }
        is_requested
    }

    /// Awaits a late node that was lost again, without a report.
    pub(super) fn await_again(&mut self, now: Instant) {
        self.stage = Stage::Awaited(now);
    }

    /// Marks the node as failed.
    pub(super) fn fail(&mut self, problem: Problem) -> BootError {
        self.stage = Stage::Failed;
        BootError::new(&self.plan, problem)
    }

    /// Handles the outcome of a boot: monitors the node, or awaits an absent optional one.
    fn after_boot(&mut self, now: Instant, outcome: BootOutcome) -> Option<Report> {
        if let Stage::Booting(boot) = &self.stage {
            self.was_enabled = boot.was_enabled();
            self.missing = boot.missing().to_vec();
            self.refused = boot.refused().to_vec();
            self.held = boot.held().to_vec();
        }
        match outcome {
            Ok(configuration) => {
                let watch = Watch::new(&self.plan, now);
                self.stage = Stage::Watched { watch, inquiry: None, reading: None };
                self.pause_guarding();
                Some(Report::Configured(configuration))
            }
            Err(BootError { problem: Problem::Absent { waited }, .. }) if self.plan.is_optional => {
                self.stage = Stage::Awaited(now + POLL_PERIOD);
                let was_known = std::mem::replace(&mut self.is_late, true);
                (!was_known).then_some(Report::Absent(waited))
            }
            Err(error) if self.is_late && error.problem.is_passing() => {
                self.stage = Stage::Awaited(now + POLL_PERIOD);
                None
            }
            Err(error) => {
                self.stage = Stage::Failed;
                Some(Report::Failed(error))
            }
        }
    }
}

/// Removes a read-back that has ended and returns its report.
fn finish(reading: &mut Option<read_back::ObjectReader>, read: Option<ReadBack>) -> Option<Report> {
    let (object, read) = (reading.as_ref()?.object(), read?);
    *reading = None;
    Some(Report::ReadBack(object, read))
}

impl Report {
    /// Returns the report of an answer; `None` for a confirmed write.
    const fn of(answer: Answer) -> Option<Self> {
        match answer {
            Answer::History(history) => Some(Self::History(history)),
            Answer::Statusword(statusword) => Some(Self::Statusword(statusword)),
            Answer::Monitoring(ended) => Some(Self::Monitoring(ended)),
            Answer::Nothing => None,
        }
    }
}
