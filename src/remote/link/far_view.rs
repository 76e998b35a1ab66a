//! The node's knowledge of the far side in a cycle.

use std::time::Duration;

use crate::Sensed;
use contract::{Capability, FarState, Feedback, Reason, Reject};
use units::time::Instant;

/// The far side, as it was last seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FarView {
    /// Newest valid sample; `None` before the first of a connection.
    pub sensed: Option<Sensed>,
    /// Newest feedback that may act.
    pub feedback: Option<Feedback>,
    /// Time on the node's clock at which that feedback was made, or before.
    pub sample_at: Option<Instant>,
    /// Capability of the present far side.
    pub capability: Option<Capability>,
    /// 99th percentile of the newest round trips; `None` while too few are known.
    pub p99: Option<Duration>,
    /// Why the newest message is foreign to this contract or arm, while there is no feedback.
    pub foreign: Option<Reject>,
}

impl FarView {
    /// Returns the session of the far side; zero for none.
    pub fn session(&self) -> u64 {
        self.feedback.map_or(0, |feedback| feedback.head.own.session)
    }

    /// Returns why the far side holds in this epoch of the node.
    pub fn hold(&self, epoch: u32) -> Option<Reason> {
        let feedback = self.feedback.filter(|feedback| feedback.head.epoch == epoch)?;
        (feedback.reason.state() == FarState::Holding).then_some(feedback.reason)
    }
}
