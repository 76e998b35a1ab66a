//! Status of the link, for the console.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use contract::{InvalidCapability, Reason, Reject};

/// Sessions, round trips and counters of the link.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinkStatus {
    /// Session of this node.
    pub session: u64,
    /// A process is connected.
    pub is_connected: bool,
    /// Session of the far side; zero without one.
    pub far_session: u64,
    /// Session of the node that leads the far side; zero without one.
    pub leader: u64,
    /// Reason of a hold, [`Reason::None`] while the far side follows; `None` before the first feedback.
    pub reason: Option<Reason>,
    /// 50th and 99th percentile of the newest round trips; `None` with too few of them.
    pub round_trips: Option<[Duration; 2]>,
    /// Number of messages lost from the far side.
    pub lost: u64,
    /// Number of messages dropped because the far side's queue was full.
    pub dropped: u64,
    /// Reason why the newest capability was rejected; `None` with a valid one, and before the first.
    pub invalid_capability: Option<InvalidCapability>,
    /// Number of rejected messages, by reason.
    pub rejects: Vec<(Reject, u64)>,
}

/// Newest status, shared between link and console.
#[derive(Clone, Debug, Default)]
pub struct LatestLink(Arc<Mutex<LinkStatus>>);

impl LatestLink {
    /// Returns the newest status.
    pub fn get(&self) -> LinkStatus {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Replaces the status, unless a reader holds the lock.
    pub(super) fn offer(&self, status: &LinkStatus) {
        if let Ok(mut latest) = self.0.try_lock() {
            latest.clone_from(status);
        }
    }
}
