//! SDO requests to a configured node, one at a time: an inquiry, a read-back, or a stage of its boot that waits for its
//! start.

use crate::frame::Frame;
use crate::master::commission::{Boot, BootOutcome};
use crate::master::inquiry::{Answer, Inquiry};
use crate::master::read_back::ObjectReader;
use crate::master::report::Report;
use units::time::Instant;

/// Pending request to a configured node.
#[derive(Clone, Debug)]
pub(super) enum NodeRequest {
    Inquiry(Box<Inquiry>),
    /// Abandoned for an inquiry.
    ReadBack(ObjectReader),
    /// Boot stage that runs after the node's start: its mode, or its torque limits.
    Stage(Box<Boot>),
}

/// End of a request, with its report to the network, if any.
#[derive(Clone, Debug)]
pub(super) struct Completion(pub(super) Option<Report>);

impl NodeRequest {
    /// Takes one received frame. Returns the end of the request once.
    pub(super) fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Completion> {
        match self {
            Self::Inquiry(inquiry) => inquiry.on_frame(now, frame, out).map(of_answer),
            Self::ReadBack(reader) => {
                let object = reader.object();
                let read = reader.on_frame(now, frame, out)?;
                Some(Completion(Some(Report::ReadBack(object, read))))
            }
            Self::Stage(stage) => {
                let outcome = stage.on_frame(now, frame, out)?;
                Some(of_stage(stage, outcome))
            }
        }
    }

    /// Handles expired timers. Returns the end of the request once.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Completion> {
        match self {
            Self::Inquiry(inquiry) => inquiry.on_time(now, out).map(of_answer),
            Self::ReadBack(reader) => {
                let object = reader.object();
                let read = reader.on_time(now, out)?;
                Some(Completion(Some(Report::ReadBack(object, read))))
            }
            Self::Stage(stage) => {
                let outcome = stage.on_time(now, out)?;
                Some(of_stage(stage, outcome))
            }
        }
    }

    /// Time of the next call of [`on_time`](Self::on_time).
    pub(super) const fn deadline(&self) -> Option<Instant> {
        match self {
            Self::Inquiry(inquiry) => inquiry.deadline(),
            Self::ReadBack(reader) => Some(reader.deadline()),
            Self::Stage(stage) => stage.deadline(),
        }
    }

    /// Takes a request that another client has sent to the same server.
    pub(super) fn on_foreign_request(&mut self, frame: &Frame) {
        match self {
            Self::Inquiry(inquiry) => inquiry.disturb(),
            Self::ReadBack(reader) => reader.disturb(),
            Self::Stage(stage) => stage.on_foreign_request(frame),
        }
    }

    /// Returns whether the frames precede those of all other nodes.
    pub(super) const fn is_urgent(&self) -> bool {
        matches!(self, Self::Inquiry(inquiry) if inquiry.is_urgent())
    }

    /// Returns whether an inquiry may replace the request. Its owner repeats a replaced read-back later.
    pub(super) const fn yields(&self) -> bool {
        matches!(self, Self::ReadBack(_))
    }
}

const fn of_answer(answer: Answer) -> Completion {
    Completion(match answer {
        Answer::History(history) => Some(Report::History(history)),
        Answer::Statusword(statusword) => Some(Report::Statusword(statusword)),
        Answer::Monitoring(ended) => Some(Report::Monitoring(ended)),
        Answer::Nothing => None,
    })
}

fn of_stage(boot: &Boot, outcome: BootOutcome) -> Completion {
    Completion(Some(match outcome {
        Ok(_) => Report::StageDone(boot.stage()),
        Err(error) => Report::Failed(error),
    }))
}
