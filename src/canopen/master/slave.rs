//! One node as its master sees it: booting, monitored, awaited or failed.
//!
//! Reports changes to the [master](crate::master), which decides the consequence for the network.

use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::sdo::{request_cob_id, response_cob_id};

use crate::abort::AbortCode;
use crate::frame::{Channel, Frame};
use crate::heartbeat::{Health, HeartbeatEvent};
use crate::master::boot_error::{BootError, Problem};
use crate::master::commission::{Boot, BootOutcome};
use crate::master::error_control::ErrorControlMonitor;
use crate::master::inquiry::Inquiry;
use crate::master::node_request::{self, NodeRequest};
use crate::master::read_back::{ObjectRead, ObjectReader};
use crate::master::report::Report;
use crate::master::sdo_traffic::{Foreign, SdoTraffic};
use crate::master::steps::{self, Configuration};
use crate::nameplate::StoredValue;
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
    /// Set if the node was absent when the others started.
    pub(super) is_late: bool,
    /// Set if the last boot found the drive's power on.
    pub(super) was_enabled: bool,
    /// Optional objects that the last boot found absent, or whose value was refused.
    pub(super) missing: Vec<Object>,
    /// Optional objects whose value the node refused, until they are reported.
    pub(super) refused: Vec<(Object, AbortCode)>,
    /// Nameplate that the last boot read.
    pub(super) held: Vec<StoredValue>,
    /// Set while the mode is still to be commanded: some drives take none before they are operational.
    awaits_mode: bool,
    traffic: SdoTraffic,
    /// Set if another client has read from the node since the last boot.
    is_read_by_another: bool,
}

/// Progress of the node.
#[derive(Clone, Debug)]
enum Stage {
    Booting(Box<Boot>),
    Watched {
        monitor: ErrorControlMonitor,
        request: Option<NodeRequest>,
    },
    /// Absent and optional: polled at this time, or booted at its next heartbeat.
    Awaited(Instant),
    Failed,
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
            awaits_mode: false,
            traffic: SdoTraffic::default(),
            is_read_by_another: false,
        }
    }

    /// Starts again, as after power-up. The node is not reset before `reset_from`.
    pub(super) fn restart(&mut self, reset_from: Instant) {
        self.stage = Stage::Booting(Box::new(Boot::new(&self.plan).resetting_from(reset_from)));
        self.is_late = false;
        self.awaits_mode = false;
        self.is_read_by_another = false;
    }

    /// Returns the NMT state, if known.
    pub(super) const fn health(&self) -> Health {
        match &self.stage {
            Stage::Booting(_) | Stage::Awaited(_) => Health::NeverSeen,
            Stage::Watched { monitor, .. } => monitor.health(),
            Stage::Failed => Health::Lost,
        }
    }

    /// Returns whether the other nodes wait for the boot of this one.
    pub(super) const fn is_pending(&self) -> bool {
        !self.is_late && matches!(self.stage, Stage::Booting(_))
    }

    /// Returns whether the node is configured and monitored.
    pub(super) const fn is_watched(&self) -> bool {
        matches!(self.stage, Stage::Watched { .. })
    }

    /// Returns whether the node is configured in time but has not reported operational yet, or has no mode yet.
    pub(super) fn is_starting(&self) -> bool {
        let is_operational = self.health() == Health::Alive(NmtState::Operational);
        !self.is_late && self.is_watched() && (!is_operational || self.awaits_mode)
    }

    /// Returns whether the node could not be booted or started.
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
            Stage::Watched { monitor, request } => {
                let ended = request.as_mut().and_then(|request| request.on_frame(now, frame, out));
                if let Some(ended) = ended {
                    return self.after_request(ended);
                }
                let news = monitor.on_frame(now, frame)?;
                if news == HeartbeatEvent::State(NmtState::Operational) {
                    self.command_mode(now, out);
                }
                Some(Report::HeartbeatEvent(news))
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
            Stage::Watched { request, .. } => {
                request.iter_mut().for_each(|request| request.on_foreign_request(frame));
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

    /// Handles expired timers.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Report> {
        match &mut self.stage {
            Stage::Booting(boot) => {
                let outcome = boot.on_time(now, out)?;
                self.after_boot(now, outcome)
            }
            Stage::Watched { monitor, request } => {
                match request.as_mut().and_then(|request| request.on_time(now, out)) {
                    Some(ended) => self.after_request(ended),
                    None => monitor.on_time(now, out).map(Report::HeartbeatEvent),
                }
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
            Stage::Watched { monitor, request } => {
                let request = request.as_ref().and_then(NodeRequest::deadline);
                monitor.deadline().into_iter().chain(request).min()
            }
            Stage::Awaited(poll_at) => Some(*poll_at),
            Stage::Failed => None,
        }
    }

    /// Starts to read the error history; returns false while another request is pending.
    pub(super) fn read_error_history(&mut self, now: Instant, out: &mut Vec<Frame>) -> bool {
        let node = self.plan.node;
        self.inquire(|| Inquiry::history(node, now, out))
    }

    /// Starts to read the statusword; returns false while another request is pending.
    pub(super) fn read_statusword(&mut self, now: Instant, out: &mut Vec<Frame>) -> bool {
        let node = self.plan.node;
        self.inquire(|| Inquiry::statusword(node, now, out))
    }

    /// Starts an inquiry, in place of a read-back; returns false while another request is pending.
    fn inquire(&mut self, start: impl FnOnce() -> Inquiry) -> bool {
        let Stage::Watched { request, .. } = &mut self.stage else { return false };
        let is_free = request.as_ref().is_none_or(NodeRequest::yields);
        if is_free {
            *request = Some(NodeRequest::Inquiry(Box::new(start())));
        }
        is_free
    }

    /// Starts to read an object again; returns false while another request is pending.
    pub(super) fn read_back(
        &mut self,
        now: Instant,
        setting: ObjectRead,
        out: &mut Vec<Frame>,
    ) -> bool {
        let Stage::Watched { request: request @ None, .. } = &mut self.stage else { return false };
        let reader = ObjectReader::start(self.plan.node, setting, now, out);
        *request = Some(NodeRequest::ReadBack(reader));
        true
    }

    /// Starts to write the planned torque limits; returns false while another request is pending.
    pub(super) fn raise_limits(&mut self, now: Instant, out: &mut Vec<Frame>) -> bool {
        self.run_stage(steps::Stage::RaiseLimits, now, out)
    }

    /// Starts to prepare a homing; returns false while another request is pending.
    pub(super) fn prepare_homing(&mut self, now: Instant, out: &mut Vec<Frame>) -> bool {
        self.run_stage(steps::Stage::PrepareHoming, now, out)
    }

    /// Starts to restore mode and torque limits after a homing; returns false while another request is pending.
    pub(super) fn leave_homing(&mut self, now: Instant, out: &mut Vec<Frame>) -> bool {
        self.run_stage(steps::Stage::LeaveHoming, now, out)
    }

    /// Starts to limit the torque to a share of the planned limits, in ‰; returns false while another request is pending.
    pub(super) fn limit_torque(&mut self, now: Instant, share: u16, out: &mut Vec<Frame>) -> bool {
        self.run_stage(steps::Stage::LimitTorque(share), now, out)
    }

    /// Commands the mode that the node did not take before it was operational.
    fn command_mode(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if self.awaits_mode {
            self.run_stage(steps::Stage::CommandMode(Configuration::Downloaded), now, out);
        }
    }

    /// Starts a single stage of the boot, unless another request is pending.
    fn run_stage(&mut self, stage: steps::Stage, now: Instant, out: &mut Vec<Frame>) -> bool {
        let Stage::Watched { request: request @ None, .. } = &mut self.stage else { return false };
        let mut boot = Box::new(Boot::of_stage(&self.plan, stage));
        // Never an outcome: the stage has a step.
        boot.on_time(now, out);
        *request = Some(NodeRequest::Stage(boot));
        true
    }

    /// Stops guarding; without effect on a node with a heartbeat.
    pub(super) const fn pause_guarding(&mut self) {
        if let Stage::Watched { monitor, .. } = &mut self.stage {
            monitor.pause();
        }
    }

    /// Guards the node again.
    pub(super) fn resume_guarding(&mut self, now: Instant) {
        if let Stage::Watched { monitor, .. } = &mut self.stage {
            monitor.resume(now);
        }
    }

    /// Sends "disable voltage", abandons any pending request, and reads the statusword next.
    pub(super) fn power_off(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Stage::Watched { request, .. } = &mut self.stage {
            let inquiry = Inquiry::power_off(self.plan.node, now, out);
            *request = inquiry.map(Box::new).map(NodeRequest::Inquiry);
        }
    }

    /// Reads the statusword ahead of all other requests, unless an urgent one is pending.
    pub(super) fn read_statusword_at_once(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Stage::Watched { request, .. } = &mut self.stage
            && !request.as_ref().is_some_and(NodeRequest::is_urgent)
        {
            let inquiry = Inquiry::statusword(self.plan.node, now, out).urgent();
            *request = Some(NodeRequest::Inquiry(Box::new(inquiry)));
        }
    }

    /// Abandons any pending request, because the node will not answer.
    pub(super) fn abandon_requests(&mut self) {
        if let Stage::Watched { request, .. } = &mut self.stage {
            *request = None;
        }
    }

    /// Returns whether an urgent request is pending.
    pub(super) fn has_urgent_request(&self) -> bool {
        matches!(&self.stage, Stage::Watched { request: Some(request), .. } if request.is_urgent())
    }

    /// Ends the node's monitoring of the master, and abandons any pending request. Returns false if it monitors nothing.
    pub(super) fn end_monitoring(&mut self, now: Instant, out: &mut Vec<Frame>) -> bool {
        let Stage::Watched { request, .. } = &mut self.stage else { return false };
        let ending = Inquiry::monitoring_off(&self.plan, &self.missing, now, out);
        let is_requested = ending.is_some();
        if is_requested {
            *request = ending.map(Box::new).map(NodeRequest::Inquiry);
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

    /// Ends the pending request.
    fn after_request(
        &mut self,
        node_request::Completion(report): node_request::Completion,
    ) -> Option<Report> {
        if let Stage::Watched { request, .. } = &mut self.stage {
            *request = None;
        }
        if matches!(report, Some(Report::StageDone(_))) {
            self.awaits_mode = false;
        }
        if self.awaits_mode && matches!(report, Some(Report::Failed(_))) {
            self.stage = Stage::Failed;
        }
        report
    }

    /// Handles the outcome of a boot: monitors the node, or awaits an absent optional one.
    fn after_boot(&mut self, now: Instant, outcome: BootOutcome) -> Option<Report> {
        if let Stage::Booting(boot) = &self.stage {
            self.was_enabled = boot.was_enabled();
            self.missing = boot.missing().to_vec();
            self.refused = boot.refused().to_vec();
            self.held = boot.held().to_vec();
            self.awaits_mode = boot.awaits_mode();
        }
        match outcome {
            Ok(configuration) => {
                let monitor = ErrorControlMonitor::new(&self.plan, now);
                self.stage = Stage::Watched { monitor, request: None };
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
