//! Log of requests with the client's user id, and the remark on the status that follows from resets.

use std::time::Duration;

use crate::console::request_queue::{Denial, Outcome};
use controller::switches::CommandMode;
use node::safety::Refusal;
use node::trial::TrialRequest;
use node::{Request, RequestError};
use telemetry::token_bucket::TokenBucket;
use units::time::Instant;

/// Mean interval between log lines about requests.
const LINE_EVERY: Duration = Duration::from_millis(100);

/// Burst of log lines about requests.
const LINES_AT_ONCE: u32 = 20;

/// Rate limit of the log, and the remark on the status.
#[derive(Debug)]
pub(super) struct Journal {
    bucket: TokenBucket,
    suppressed: u64,
    /// Reason why the node waited for a reset at its start, until one succeeds.
    remark: Option<String>,
    /// Reason why the last reset failed, until one succeeds.
    failed_reset: Option<String>,
}

impl Journal {
    /// Returns a journal of a node that has waited for a reset because of `remark`, if it has.
    pub(super) const fn new(remark: Option<String>) -> Self {
        let bucket = TokenBucket::new(LINE_EVERY, LINES_AT_ONCE);
        Self { bucket, suppressed: 0, remark, failed_reset: None }
    }

    /// Returns the remark on the status.
    pub(super) fn note(&self) -> Option<String> {
        let failed = self.failed_reset.as_ref();
        let failed = failed.map(|reason| format!("the last reset failed: {reason}"));
        let parts: Vec<_> = self.remark.iter().cloned().chain(failed).collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }

    /// Updates the remarks on the status after a reset. A request that was never executed does not change them.
    pub(super) fn on_reset(&mut self, outcome: &Outcome) {
        match outcome {
            // Without a stop there is nothing to remark.
            Ok(_) | Err(Denial::Refused(RequestError::Mode(Refusal::NotStopped(_)))) => {
                self.remark = None;
                self.failed_reset = None;
            }
            Err(Denial::Refused(_) | Denial::Latch(_)) => {
                self.failed_reset = outcome.as_ref().err().map(ToString::to_string);
            }
            Err(
                Denial::Booting
                | Denial::Ending
                | Denial::Busy
                | Denial::TooOld(_)
                | Denial::Disarmed
                | Denial::Withdrawn,
            ) => {}
        }
    }

    /// Returns the number of lines suppressed since the last one; `None` if a line at `now` is to be suppressed as well.
    pub(super) fn take_line(&mut self, now: Instant) -> Option<u64> {
        if self.bucket.take(now) {
            return Some(std::mem::take(&mut self.suppressed));
        }
        self.suppressed += 1;
        None
    }
}

/// Logs a request of user `uid`, after `suppressed` lines that were not logged.
pub(super) fn log(suppressed: u64, uid: Option<u32>, request: Request, outcome: &str) {
    if suppressed > 0 {
        tracing::warn!("console: {suppressed} more suppressed");
    }
    let uid = uid.map_or_else(|| "unknown".to_owned(), |uid| uid.to_string());
    tracing::info!(%uid, "console: {}: {outcome}", name(request));
}

fn name(request: Request) -> String {
    match request {
        Request::Arm => "arm".to_owned(),
        Request::Disarm => "disarm".to_owned(),
        Request::Reset => "reset".to_owned(),
        Request::Zero(None) => "zero".to_owned(),
        Request::Zero(Some(joint)) => format!("zero of joint {joint}"),
        Request::Park => "park".to_owned(),
        Request::Trial(TrialRequest { joint, share }) => {
            format!("trial of joint {joint} within {share} ‰")
        }
        Request::Command(CommandMode::Rate) => "mode rate".to_owned(),
        Request::Command(CommandMode::Pose) => "mode pose".to_owned(),
        Request::Adjust(adjustment) => adjustment.to_string(),
    }
}
