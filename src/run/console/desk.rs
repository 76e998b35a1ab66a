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

use crate::console::Answer;
use crate::console::Ask;
use crate::console::requests::Denied;
use crate::console::requests::Outcome;
use crate::console::requests::Phase;
use crate::console::requests::Requests;
use crate::recorder::Latest;
use controller::switches::Mode as CommandMode;
use node::Request;
use node::record::Mode;
use telemetry::token_bucket::TokenBucket;
use units::time::Instant;

/// Time the cycle has for an answer, but for a reset, which may boot.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(1);

/// Interval at which a disarm that was asked for is looked after.
const DISARM_POLL: Duration = Duration::from_millis(1);

/// Interval at which the status is looked after …
const STATUS_POLL: Duration = Duration::from_millis(1);

/// … until it shows what was granted, and the time allowed for that.
const STATUS_TIMEOUT: Duration = Duration::from_millis(50);

/// Time allowed for the ramp of a disarm, 50 ms, and for the status to show its end.
const RAMP_TIMEOUT: Duration = Duration::from_millis(100);

/// Interval between lines about requests, in the long run …
const LINE_EVERY: Duration = Duration::from_millis(100);

/// … and their number at once.
const LINES_AT_ONCE: u32 = 20;

/// Users' requests on one side, the cycle's on the other.
pub(crate) struct Desk {
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
    pub(crate) fn new(
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
                let outcome = if mode.may_push() { "torque ramps to zero" } else { mode.name() };
                self.log(uid, Request::Disarm, outcome);
                self.show().await;
                Answer::granted(self.ramped(mode).await)
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

    /// Returns the mode once the ramp of a disarm that led to `granted` is over, or the last one that is shown.
    async fn ramped(&self, granted: Mode) -> Mode {
        let shown = || {
            let status = self.latest.get();
            status.and_then(|status| Mode::ALL.into_iter().find(|mode| mode.name() == status.mode))
        };
        let over = async {
            while granted.may_push() && self.requests.phase() == Phase::Running {
                match shown() {
                    Some(mode) if !mode.may_push() => break,
                    Some(_) | None => sleep(STATUS_POLL).await,
                }
            }
        };
        // A recorder that is late, or who arms again, holds up no answer.
        timeout(RAMP_TIMEOUT, over).await.ok();
        if granted.may_push() { shown().unwrap_or(granted) } else { granted }
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::console::Inbox;
    use crate::console::channel;
    use config::Config;
    use lab::bench::Bench;
    use node::Refused;
    use node::safety::Refusal;
    use sim::scenario::Scenario;
    use telemetry::losses::Losses;
    use telemetry::status::Status;

    const NOW: Instant = Instant::from_micros(1_000_000);

    /// Runs `test` at the desk of a node that runs, in a runtime whose timers end as soon as nothing else can happen.
    fn run<T: Future<Output = ()>>(test: impl FnOnce(Arc<Desk>, Inbox, Latest) -> T) {
        let (requests, mut inbox) = channel();
        inbox.booted(Instant::ZERO);
        let latest = Latest::default();
        let note = Some("left of a run".to_owned());
        let desk = Arc::new(Desk::new(requests, latest.clone(), || NOW, note));
        let mut runtime = tokio::runtime::Builder::new_current_thread();
        let runtime = runtime.enable_time().start_paused(true).build().unwrap();
        runtime.block_on(test(desk, inbox, latest));
    }

    /// The answer to `ask`, while the cycle does with its request what `outcome` says.
    async fn granted(
        desk: &Arc<Desk>,
        inbox: &mut Inbox,
        ask: Ask,
        outcome: Result<Mode, Refused>,
    ) -> (Answer, Request) {
        let cycle = async {
            loop {
                match inbox.next(NOW) {
                    Some(due) => {
                        let request = due.request;
                        due.answer(outcome);
                        return request;
                    }
                    None => sleep(Duration::from_millis(1)).await,
                }
            }
        };
        tokio::join!(desk.answer(ask, None), cycle)
    }

    #[test]
    fn every_word_is_its_own_request() {
        run(|desk, mut inbox, _| async move {
            for (ask, request) in [
                (Ask::Arm, Request::Arm),
                (Ask::Reset, Request::Reset),
                (Ask::Rate, Request::Command(CommandMode::Rate)),
                (Ask::Pose, Request::Command(CommandMode::Pose)),
            ] {
                let (answer, asked) = granted(&desk, &mut inbox, ask, Ok(Mode::Armed)).await;
                assert_eq!((asked, answer.ok, answer.mode), (request, true, Some("armed")));
            }
        });
    }

    #[test]
    fn refused_request_is_answered_with_its_reason() {
        run(|desk, mut inbox, _| async move {
            let refusal = Err(Refused::Mode(Refusal::NotStopped(Mode::Ready)));
            let (answer, _) = granted(&desk, &mut inbox, Ask::Arm, refusal).await;
            let reason = Some("nothing to reset: the node is ready");
            assert_eq!((answer.ok, answer.error.as_deref(), answer.mode), (false, reason, None));
        });
    }

    #[test]
    fn note_stands_in_the_status_until_a_reset_succeeds() {
        run(|desk, mut inbox, _| async move {
            let note = async || desk.answer(Ask::Status, None).await.note;
            assert_eq!(note().await.as_deref(), Some("left of a run"));
            granted(&desk, &mut inbox, Ask::Arm, Ok(Mode::Armed)).await;
            assert_eq!(note().await.as_deref(), Some("left of a run"));
            let refusal = Err(Refused::Mode(Refusal::NotStopped(Mode::Ready)));
            granted(&desk, &mut inbox, Ask::Reset, refusal).await;
            assert!(note().await.unwrap().starts_with("the last reset failed: "));
            granted(&desk, &mut inbox, Ask::Reset, Ok(Mode::Ready)).await;
            assert_eq!(note().await, None);
        });
    }

    #[test]
    fn disarm_without_a_cycle_stands_and_says_so() {
        run(|desk, inbox, _| async move {
            let answer = desk.answer(Ask::Disarm, None).await;
            assert!(answer.error.unwrap().ends_with("within 1 s: the disarm stands"));
            assert!(inbox.disarm().is_some());
        });
    }

    #[test]
    fn disarm_of_a_node_that_stops_is_not_waited_for() {
        run(|desk, mut inbox, _| async move {
            inbox.end();
            let answer = timeout(Duration::ZERO, desk.answer(Ask::Disarm, None)).await.unwrap();
            assert_eq!(answer.error.as_deref(), Some("the node is stopping"));
        });
    }

    #[test]
    fn reset_that_boots_is_waited_for_longer_than_a_second() {
        run(|desk, mut inbox, _| async move {
            let boot = async {
                sleep(Duration::from_millis(1)).await;
                let due = inbox.next(NOW).unwrap();
                inbox.boots();
                sleep(Duration::from_secs(30)).await;
                inbox.booted(NOW);
                due.answer(Ok(Mode::Ready));
            };
            let (answer, ()) = tokio::join!(desk.answer(Ask::Reset, None), boot);
            assert_eq!((answer.ok, answer.mode), (true, Some("ready")));
        });
    }

    #[test]
    fn status_during_a_boot_shows_nothing_of_before() {
        run(|desk, mut inbox, latest| async move {
            let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
            let script = Scenario::parse("seconds = 1").unwrap();
            let record = Bench::new(&config, script, 1, false, ()).cycle();
            latest.set(NOW, Status::of(&record, 0, Losses::default()));
            assert!(desk.answer(Ask::Status, None).await.status.is_some());
            inbox.boots();
            let answer = desk.answer(Ask::Status, None).await;
            assert_eq!((answer.mode, answer.status.is_none()), (Some("boot"), true));
            inbox.booted(NOW);
            assert!(desk.answer(Ask::Status, None).await.status.is_some());
        });
    }
}
