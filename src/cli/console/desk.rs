//! What a client asks for: answered, logged with the client's user, and taken back when the client leaves.

use std::fmt;
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering;
use std::time::Duration;

use tokio::sync::oneshot;
use tokio::time::sleep;
use tokio::time::timeout;

use crate::cli::console::Answer;
use crate::cli::console::Ask;
use crate::cli::console::requests::Denied;
use crate::cli::console::requests::Outcome;
use crate::cli::console::requests::Phase;
use crate::cli::console::requests::Requests;
use crate::cli::recorder::Latest;
use crate::controller::switches::Mode as CommandMode;
use crate::node::Request;
use crate::telemetry::record::Mode;
use crate::telemetry::token_bucket::TokenBucket;
use crate::time::Instant;

/// Time the cycle has for an answer, but for a reset, which may boot.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(1);

/// Interval at which a disarm that was asked for is looked after.
const DISARM_POLL: Duration = Duration::from_millis(1);

/// Interval at which the status is looked after …
const STATUS_POLL: Duration = Duration::from_millis(1);

/// … until it shows what was granted, and the time allowed for that.
const STATUS_TIMEOUT: Duration = Duration::from_millis(50);

/// Interval between lines about requests, in the long run …
const LINE_EVERY: Duration = Duration::from_millis(100);

/// … and their number at once.
const LINES_AT_ONCE: u32 = 20;

/// Users' requests on one side, the cycle's on the other.
pub(in crate::cli) struct Desk {
    requests: Requests,
    latest: Latest,
    clock: Box<dyn Fn() -> Instant + Send + Sync>,
    journal: Mutex<Journal>,
}

/// Log of requests, and the remark on the status.
#[derive(Debug)]
struct Journal {
    bucket: TokenBucket,
    suppressed: u64,
    /// Remark on the status: why the node waits for a reset, or why the last one failed.
    note: Option<String>,
}

impl fmt::Debug for Desk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Desk").field("requests", &self.requests).finish_non_exhaustive()
    }
}

/// Sets a flag when dropped: with its client a request ends.
struct Withdraws(Arc<AtomicBool>);

impl Drop for Withdraws {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

impl Desk {
    /// `clock` is the bus's; `note` is shown with the status until a reset succeeds.
    pub(in crate::cli) fn new(
        requests: Requests,
        latest: Latest,
        clock: impl Fn() -> Instant + Send + Sync + 'static,
        note: Option<String>,
    ) -> Self {
        let bucket = TokenBucket::new(LINE_EVERY, LINES_AT_ONCE);
        let journal = Mutex::new(Journal { bucket, suppressed: 0, note });
        Self { requests, latest, clock: Box::new(clock), journal }
    }

    /// The time on the bus.
    pub(super) fn now(&self) -> Instant {
        (self.clock)()
    }

    /// Answers a client of user `uid`. Dropped before its end, it withdraws the request.
    pub(super) async fn answer(self: &Arc<Self>, ask: Ask, uid: Option<u32>) -> Answer {
        let request = match ask {
            Ask::Status => return self.status(),
            Ask::Disarm => return self.disarm(uid).await,
            Ask::Arm => Request::Arm,
            Ask::Reset => Request::Reset,
            Ask::Rate => Request::Command(CommandMode::Rate),
            Ask::Pose => Request::Command(CommandMode::Pose),
        };
        let outcome = self.ask(request, uid).await;
        match outcome {
            Ok(mode) => {
                self.show().await;
                Answer::granted(mode)
            }
            Err(reason) => Answer::refused(&reason),
        }
    }

    /// Asks the cycle. A request that it has taken is followed to its end, whether its client stays or not.
    async fn ask(self: &Arc<Self>, request: Request, uid: Option<u32>) -> Result<Mode, String> {
        let is_withdrawn = Arc::new(AtomicBool::new(false));
        let _withdraws = Withdraws(Arc::clone(&is_withdrawn));
        if request == Request::Reset {
            self.log(uid, request, "asked");
        }
        let answered = match self.requests.ask(request, self.now(), &is_withdrawn) {
            Ok(answered) => answered,
            Err(denied) => return self.conclude(uid, request, Err(denied)),
        };
        let (reply, concluded) = oneshot::channel();
        let desk = Arc::clone(self);
        tokio::spawn(async move {
            let outcome = answered.await.unwrap_or(Err(Denied::Ending));
            // The client may have left.
            reply.send(desk.conclude(uid, request, outcome)).ok();
        });
        let stopped = || Err("the node has stopped".to_owned());
        if request == Request::Reset {
            return concluded.await.unwrap_or_else(|_| stopped());
        }
        match timeout(ANSWER_TIMEOUT, concluded).await {
            Ok(concluded) => concluded.unwrap_or_else(|_| stopped()),
            Err(_) => {
                Err("the node did not answer within 1 s: the request is withdrawn".to_owned())
            }
        }
    }

    /// Logs what a request came to, and keeps why a reset failed.
    fn conclude(
        &self,
        uid: Option<u32>,
        request: Request,
        outcome: Outcome,
    ) -> Result<Mode, String> {
        let outcome = outcome.map_err(|denied| denied.to_string());
        match &outcome {
            Ok(mode) => self.log(uid, request, mode.name()),
            Err(reason) => {
                self.log(uid, request, &format!("refused: {}", reason.replace('\n', "; ")));
            }
        }
        if request == Request::Reset {
            let failed = |reason| format!("the last reset failed: {reason}");
            self.journal().note = outcome.as_ref().err().map(failed);
        }
        outcome
    }

    /// Disarms. That it was asked for holds, whoever leaves meanwhile.
    pub(super) async fn disarm(&self, uid: Option<u32>) -> Answer {
        let disarm = self.requests.disarm();
        let done = async {
            loop {
                match (self.requests.disarmed(disarm), self.requests.phase()) {
                    (Some(mode), _) => return Ok(mode),
                    (None, Phase::Ending) => return Err(Denied::Ending),
                    (None, Phase::Booting | Phase::Running) => sleep(DISARM_POLL).await,
                }
            }
        };
        match timeout(ANSWER_TIMEOUT, done).await {
            Ok(Ok(mode)) => {
                self.log(uid, Request::Disarm, mode.name());
                self.show().await;
                Answer::granted(mode)
            }
            Ok(Err(denied)) => Answer::refused(&denied),
            Err(_) => {
                self.log(uid, Request::Disarm, "not confirmed within 1 s");
                Answer::refused(&"the node did not confirm within 1 s: the disarm stands")
            }
        }
    }

    /// Waits until the status is of a cycle after what was granted: a client that asks next sees it.
    async fn show(&self) {
        let granted_at = self.now();
        let is_stale = || self.latest.at().is_none_or(|at| at < granted_at);
        let shown = async {
            while self.requests.phase() == Phase::Running && is_stale() {
                sleep(STATUS_POLL).await;
            }
        };
        // The recorder may be late; what was granted holds.
        timeout(STATUS_TIMEOUT, shown).await.ok();
    }

    fn status(&self) -> Answer {
        let note = self.journal().note.clone();
        let latest = match self.requests.phase() {
            Phase::Booting => None,
            Phase::Running | Phase::Ending => self.latest.get(),
        };
        let mode = latest.as_ref().map_or(Mode::Boot.name(), |status| status.mode);
        Answer { ok: true, error: None, mode: Some(mode), status: latest, note }
    }

    /// A line on a request, but no flood of them.
    fn log(&self, uid: Option<u32>, request: Request, outcome: &str) {
        let now = self.now();
        let suppressed = {
            let mut journal = self.journal();
            if !journal.bucket.take(now) {
                journal.suppressed += 1;
                return;
            }
            std::mem::take(&mut journal.suppressed)
        };
        if suppressed > 0 {
            tracing::warn!("console: {suppressed} more suppressed");
        }
        let uid = uid.map_or_else(|| "unknown".to_owned(), |uid| uid.to_string());
        tracing::info!(%uid, "console: {}: {outcome}", name(request));
    }

    fn journal(&self) -> std::sync::MutexGuard<'_, Journal> {
        self.journal.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

const fn name(request: Request) -> &'static str {
    match request {
        Request::Arm => "arm",
        Request::Disarm => "disarm",
        Request::Reset => "reset",
        Request::Command(CommandMode::Rate) => "mode rate",
        Request::Command(CommandMode::Pose) => "mode pose",
    }
}
