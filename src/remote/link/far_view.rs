//! View of the far side in the node, updated by the link's thread.

use std::time::Duration;

use crate::RemoteSample;
use crate::stated::Misfit;
use contract::{Capability, FarState, Feedback, InvalidCapability, Reason, Reject};
use units::time::Instant;

/// Last known state of the far side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FarView {
    /// Newest valid sample; `None` before the first of a connection.
    pub sensed: Option<RemoteSample>,
    /// Newest accepted feedback.
    pub feedback: Option<Feedback>,
    /// Lower bound of the time of that feedback, on the node's clock.
    pub sample_at: Option<Instant>,
    /// Capability of the present far side.
    pub capability: Option<Capability>,
    /// Reason why the newest capability of the present far side was rejected; `None` with a valid one.
    pub invalid_capability: Option<InvalidCapability>,
    /// 99th percentile of the newest round trips; `None` with too few of them.
    pub p99: Option<Duration>,
    /// Reason why the newest message is of another contract, version or arm; `None` after an accepted feedback.
    pub foreign: Option<Reject>,
}

impl FarView {
    /// Returns the session of the far side; zero without one.
    pub fn session(&self) -> u64 {
        self.feedback.map_or(0, |feedback| feedback.head.own.session)
    }

    /// Returns the reason against a far side without a valid capability.
    pub(super) fn no_capability(&self) -> Misfit {
        self.invalid_capability.map_or(Misfit::Unknown, Misfit::Rejected)
    }

    /// Returns the reason of a hold in this epoch of the node; `None` while the far side follows.
    pub fn hold(&self, epoch: u32) -> Option<Reason> {
        let feedback = self.feedback.filter(|feedback| feedback.head.epoch == epoch)?;
        (feedback.reason.state() == FarState::Holding).then_some(feedback.reason)
    }
}
