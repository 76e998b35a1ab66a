//! The link in figures, for people.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use contract::{Reason, Reject};

/// The link in figures.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LinkStatus {
    /// Session of this node.
    pub session: u64,
    /// A process is connected.
    pub is_connected: bool,
    /// Session of the far side; zero for none.
    pub far_session: u64,
    /// Session of the node that leads it; zero for none.
    pub leader: u64,
    /// Why it holds; `None` before the first feedback.
    pub reason: Option<Reason>,
    /// 50th and 99th percentile of the newest round trips.
    pub round_trips: Option<[Duration; 2]>,
    /// Messages of the far side that did not arrive.
    pub lost: u64,
    /// Messages that the far side's queue had no room for.
    pub dropped: u64,
    /// Messages that had no effect, by reason.
    pub rejects: Vec<(Reject, u64)>,
}

/// The newest status, shared with the console.
#[derive(Clone, Debug, Default)]
pub struct LatestLink(Arc<Mutex<LinkStatus>>);

impl LatestLink {
    /// Returns the newest status.
    pub fn get(&self) -> LinkStatus {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Replaces the status, unless it is being read.
    pub(super) fn offer(&self, status: &LinkStatus) {
        if let Ok(mut latest) = self.0.try_lock() {
            latest.clone_from(status);
        }
    }
}
