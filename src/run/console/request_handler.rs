//! Execution of requests: passes them to the cycle, and withdraws them if the client disconnects.

use std::fmt;
use std::pin::{Pin, pin};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::oneshot;
use tokio::time::{Sleep, sleep, timeout};

use crate::console::journal::{self, Journal};
use crate::console::request_queue::{Denial, Outcome, Phase, RequestSender};
use crate::console::{ConsoleCommand, Response};
use crate::latest_status::LatestStatus;
use controller::switches::CommandMode;
use node::Request;
use node::record::{Mode, Record};
use units::time::Instant;

/// Time allowed for the cycle to answer. A reset, which may boot, has no limit here.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(1);

/// Polling interval for the completion of a disarm.
const DISARM_POLL: Duration = Duration::from_millis(1);

/// Polling interval of the status.
const STATUS_POLL: Duration = Duration::from_millis(1);

/// Time allowed for the status to show a granted request.
const STATUS_TIMEOUT: Duration = Duration::from_millis(50);

/// Passes clients' requests to the cycle and returns the responses.
pub(crate) struct RequestHandler {
    sender: RequestSender,
    latest: LatestStatus,
    clock: Box<dyn Fn() -> Instant + Send + Sync>,
    journal: Mutex<Journal>,
    /// Time from a request to disarm until its response names the joints that may push.
    disarm_timeout: Duration,
}

impl fmt::Debug for RequestHandler {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RequestHandler").field("sender", &self.sender).finish_non_exhaustive()
    }
}

/// Guard that sets a flag when dropped, to withdraw the request of a client that disconnects.
struct WithdrawOnDrop(Arc<AtomicBool>);

impl Drop for WithdrawOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

impl RequestHandler {
    /// Returns a handler. `clock` returns the time on the bus; the status contains `remark` until a reset succeeds. A disarm
    /// is answered after `disarm_timeout` at the latest.
    pub(crate) fn new(
        sender: RequestSender,
        latest: LatestStatus,
        clock: impl Fn() -> Instant + Send + Sync + 'static,
        remark: Option<String>,
        disarm_timeout: Duration,
    ) -> Self {
        let journal = Mutex::new(Journal::new(remark));
        Self { sender, latest, clock: Box::new(clock), journal, disarm_timeout }
    }

    /// Returns the time on the bus.
    pub(super) fn now(&self) -> Instant {
        (self.clock)()
    }

    /// Executes a request of user `uid`. Dropping the future withdraws the request.
    pub(super) async fn answer(
        self: &Arc<Self>,
        ask: ConsoleCommand,
        uid: Option<u32>,
    ) -> Response {
        let request = match ask {
            ConsoleCommand::Status => return self.status(),
            ConsoleCommand::Disarm => return self.disarm(uid).await,
            ConsoleCommand::Arm => Request::Arm,
            ConsoleCommand::Reset => Request::Reset,
            ConsoleCommand::Zero(joint) => Request::Zero(joint),
            ConsoleCommand::Park => Request::Park,
            ConsoleCommand::Try(trial) => Request::Trial(trial),
            ConsoleCommand::Rate => Request::Command(CommandMode::Rate),
            ConsoleCommand::Pose => Request::Command(CommandMode::Pose),
            ConsoleCommand::Adjust(adjustment) => Request::Adjust(adjustment),
        };
        let outcome = self.execute(request, uid).await;
        match outcome {
            Ok(mode) => {
                self.wait_for_status().await;
                Response::granted(mode)
            }
            Err(reason) => Response::refused(&reason),
        }
    }

    /// Sends a request to the cycle and waits for its outcome. Logs the outcome even if the client disconnects.
    async fn execute(self: &Arc<Self>, request: Request, uid: Option<u32>) -> Result<Mode, String> {
        let is_withdrawn = Arc::new(AtomicBool::new(false));
        let _withdraw_on_drop = WithdrawOnDrop(Arc::clone(&is_withdrawn));
        if request == Request::Reset {
            self.log(uid, request, "requested");
        }
        let answered = match self.sender.send(request, self.now(), &is_withdrawn) {
            Ok(answered) => answered,
            Err(denied) => return self.conclude(uid, request, Err(denied)),
        };
        let (reply, concluded) = oneshot::channel();
        let handler = Arc::clone(self);
        tokio::spawn(async move {
            let outcome = answered.await.unwrap_or(Err(Denial::Ending));
            // The receiver is gone when the client has disconnected.
            reply.send(handler.conclude(uid, request, outcome)).ok();
        });
        let stopped = || Err("the node has stopped".to_owned());
        if request.may_boot() {
            return concluded.await.unwrap_or_else(|_| stopped());
        }
        match timeout(ANSWER_TIMEOUT, concluded).await {
            Ok(concluded) => concluded.unwrap_or_else(|_| stopped()),
            Err(_) => {
                Err("the node did not answer within 1 s: the request is withdrawn".to_owned())
            }
        }
    }

    /// Logs the outcome of a request, and keeps the reason of a failed reset for the status.
    fn conclude(
        &self,
        uid: Option<u32>,
        request: Request,
        outcome: Outcome,
    ) -> Result<Mode, String> {
        if request == Request::Reset {
            self.journal().on_reset(&outcome);
        }
        let outcome = outcome.map_err(|denied| denied.to_string());
        match &outcome {
            Ok(mode) => self.log(uid, request, mode.name()),
            Err(reason) => {
                self.log(uid, request, &format!("refused: {}", reason.replace('\n', "; ")));
            }
        }
        outcome
    }

    /// Disarms, even if the client disconnects.
    pub(super) async fn disarm(&self, uid: Option<u32>) -> Response {
        let limit = pin!(sleep(self.disarm_timeout));
        let disarm = self.sender.request_disarm();
        let done = async {
            loop {
                match (self.sender.disarm_result(disarm), self.sender.phase()) {
                    (Some(mode), _) => return Ok(mode),
                    (None, Phase::Ending) => return Err(Denial::Ending),
                    (None, Phase::Booting | Phase::Running) => sleep(DISARM_POLL).await,
                }
            }
        };
        match timeout(ANSWER_TIMEOUT, done).await {
            Ok(Ok(mode)) => {
                let outcome =
                    if mode.allows_torque() { "torque ramps to zero" } else { mode.name() };
                self.log(uid, Request::Disarm, outcome);
                let response = self.response_to_disarm(mode, limit).await;
                if let Some(reason) = &response.error {
                    self.log(uid, Request::Disarm, reason);
                }
                response
            }
            Ok(Err(denied)) => Response::refused(&denied),
            Err(_) => {
                self.log(uid, Request::Disarm, "not confirmed within 1 s");
                Response::refused(
                    &"the node did not confirm within 1 s: the disarm stays requested",
                )
            }
        }
    }

    /// Waits until the status is newer than the granted request, so that the client's next status shows it.
    async fn wait_for_status(&self) {
        let granted_at = self.now();
        let is_stale = || self.latest.at().is_none_or(|at| at < granted_at);
        let shown = async {
            while self.sender.phase() == Phase::Running && is_stale() {
                sleep(STATUS_POLL).await;
            }
        };
        // On timeout the recorder thread is late; the request was granted nevertheless.
        timeout(STATUS_TIMEOUT, shown).await.ok();
    }

    /// Waits until no drive may push after a disarm that led to `granted`, or until `limit`; returns the response.
    async fn response_to_disarm(&self, granted: Mode, limit: Pin<&mut Sleep>) -> Response {
        let granted_at = self.now();
        let is_stale = |record: &Record| record.at < granted_at;
        let is_open = |record: &Record| is_stale(record) || !record.is_torque_free();
        let over = async || {
            while granted != Mode::Boot
                && self.sender.phase() == Phase::Running
                && self.latest.record().as_ref().is_some_and(is_open)
            {
                sleep(STATUS_POLL).await;
            }
        };
        tokio::select! {
            biased;
            () = over() => {}
            () = limit => {}
        }
        if self.latest.record().is_some_and(|record| record.mode.allows_torque()) {
            // A late recorder thread, or another client that arms, must not delay the response further.
            timeout(STATUS_TIMEOUT, over()).await.ok();
        }
        let newest = self.latest.record().zip(self.latest.get());
        let is_stale = newest.as_ref().is_some_and(|(record, _)| is_stale(record));
        let newest = newest.as_ref().map(|(record, status)| (record, status));
        Response::to_disarm(granted, newest, is_stale)
    }

    fn status(&self) -> Response {
        let note = self.journal().note();
        let latest = match self.sender.phase() {
            Phase::Booting => None,
            Phase::Running | Phase::Ending => self.latest.get(),
        };
        let mode = latest.as_ref().map_or(Mode::Boot.name(), |status| status.mode);
        Response { ok: true, mode: Some(mode), status: latest, note, ..Response::default() }
    }

    fn log(&self, uid: Option<u32>, request: Request, outcome: &str) {
        let taken = self.journal().take_line(self.now());
        if let Some(suppressed) = taken {
            journal::log(suppressed, uid, request, outcome);
        }
    }

    fn journal(&self) -> std::sync::MutexGuard<'_, Journal> {
        self.journal.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::console::request_queue::{RequestReceiver, channel};
    use crate::scratch::any_record;
    use node::push::Push;
    use node::safety::Refusal;
    use node::{BringUpError, RequestError};
    use telemetry::losses::Losses;
    use units::drive::PerMille;

    const NOW: Instant = Instant::from_micros(1_000_000);

    const LIMIT: Duration = Duration::from_millis(100);

    /// Runs `test` with the handler of a running node and paused time: timers expire as soon as no task can proceed.
    fn run<T: Future<Output = ()>>(
        test: impl FnOnce(Arc<RequestHandler>, RequestReceiver, LatestStatus) -> T,
    ) {
        let (sender, mut receiver) = channel();
        receiver.end_boot(Instant::ZERO);
        let latest = LatestStatus::default();
        let note = Some("left of a run".to_owned());
        let handler = Arc::new(RequestHandler::new(sender, latest.clone(), || NOW, note, LIMIT));
        let mut runtime = tokio::runtime::Builder::new_current_thread();
        let runtime = runtime.enable_time().start_paused(true).build().unwrap();
        runtime.block_on(test(handler, receiver, latest));
    }

    /// Returns the response to `ask`, whose request the cycle answers with `outcome`, and that request.
    async fn granted(
        handler: &Arc<RequestHandler>,
        receiver: &mut RequestReceiver,
        ask: ConsoleCommand,
        outcome: Result<Mode, RequestError>,
    ) -> (Response, Request) {
        let cycle = async {
            loop {
                match receiver.next(NOW) {
                    Some(accepted) => {
                        let request = accepted.request;
                        accepted.answer(outcome);
                        return request;
                    }
                    None => sleep(Duration::from_millis(1)).await,
                }
            }
        };
        tokio::join!(handler.answer(ask, None), cycle)
    }

    #[test]
    fn commands_map_to_their_requests() {
        run(|handler, mut receiver, _| async move {
            for (ask, request) in [
                (ConsoleCommand::Arm, Request::Arm),
                (ConsoleCommand::Reset, Request::Reset),
                (ConsoleCommand::Zero(None), Request::Zero(None)),
                (ConsoleCommand::Park, Request::Park),
                (ConsoleCommand::Rate, Request::Command(CommandMode::Rate)),
                (ConsoleCommand::Pose, Request::Command(CommandMode::Pose)),
            ] {
                let (answer, asked) = granted(&handler, &mut receiver, ask, Ok(Mode::Armed)).await;
                assert_eq!((asked, answer.ok, answer.mode), (request, true, Some("armed")));
            }
        });
    }

    #[test]
    fn refused_request_is_answered_with_the_reason() {
        run(|handler, mut receiver, _| async move {
            let refusal = Err(RequestError::Mode(Refusal::NotStopped(Mode::Ready)));
            let (answer, _) = granted(&handler, &mut receiver, ConsoleCommand::Arm, refusal).await;
            let reason = Some("nothing to reset: the node is ready");
            assert_eq!((answer.ok, answer.error.as_deref(), answer.mode), (false, reason, None));
        });
    }

    #[test]
    fn note_stays_in_the_status_until_a_reset_succeeds() {
        run(|handler, mut receiver, _| async move {
            let note = async || handler.answer(ConsoleCommand::Status, None).await.note;
            assert_eq!(note().await.as_deref(), Some("left of a run"));
            granted(&handler, &mut receiver, ConsoleCommand::Arm, Ok(Mode::Armed)).await;
            assert_eq!(note().await.as_deref(), Some("left of a run"));
            let failure = Err(RequestError::Boot(BringUpError::GivenUp));
            granted(&handler, &mut receiver, ConsoleCommand::Reset, failure).await;
            let both = "left of a run; the last reset failed: boot given up";
            assert_eq!(note().await.as_deref(), Some(both));
            granted(&handler, &mut receiver, ConsoleCommand::Reset, Ok(Mode::Ready)).await;
            assert_eq!(note().await, None);
        });
    }

    #[test]
    fn reset_of_a_node_that_is_not_stopped_leaves_no_note() {
        run(|handler, mut receiver, _| async move {
            let note = async || handler.answer(ConsoleCommand::Status, None).await.note;
            let refusal = || Err(RequestError::Mode(Refusal::NotStopped(Mode::Ready)));
            granted(&handler, &mut receiver, ConsoleCommand::Reset, refusal()).await;
            assert_eq!(note().await, None);
            // A request that is not executed is no failed reset.
            receiver.begin_boot();
            assert!(!handler.answer(ConsoleCommand::Reset, None).await.ok);
            assert_eq!(note().await, None);
        });
    }

    #[test]
    fn unconfirmed_disarm_stays_requested_and_is_reported() {
        run(|handler, receiver, _| async move {
            let answer = handler.answer(ConsoleCommand::Disarm, None).await;
            assert!(answer.error.unwrap().ends_with("within 1 s: the disarm stays requested"));
            assert!(receiver.pending_disarm().is_some());
        });
    }

    /// Returns the response to a disarm after which the newest record has these modes and pushes of the elbow, each after
    /// milliseconds, and the time of the response.
    #[expect(clippy::disallowed_methods, reason = "time of the test is paused, and is tokio's")]
    fn disarmed(shown: &'static [(u64, Mode, Push)]) -> (Response, Duration) {
        let (result, response) = std::sync::mpsc::channel();
        run(|handler, receiver, latest| async move {
            let record = any_record();
            let set = |mode, push| {
                let pushes = [
                    Push::Excluded,
                    Push::Excluded,
                    push,
                    Push::Excluded,
                    Push::Excluded,
                    Push::Excluded,
                ];
                latest.set(&Record { at: NOW, mode, pushes, ..record }, 0, Losses::default());
            };
            set(Mode::Armed, Push::Unknown);
            let asked_at = tokio::time::Instant::now();
            let node = async {
                sleep(Duration::from_millis(2)).await;
                receiver.complete_disarm(receiver.pending_disarm().unwrap(), Mode::Armed);
                for (at, mode, push) in shown {
                    tokio::time::sleep_until(asked_at + Duration::from_millis(*at)).await;
                    set(*mode, *push);
                }
            };
            let answer = async {
                let answer = handler.answer(ConsoleCommand::Disarm, None).await;
                result.send((answer, asked_at.elapsed())).unwrap();
            };
            tokio::join!(answer, node);
        });
        response.recv().unwrap()
    }

    const PUSHES: Push = Push::Shown(PerMille(-225));

    #[test]
    fn disarm_is_answered_once_no_drive_may_push() {
        let (answer, after) = disarmed(&[
            (52, Mode::Ready, Push::Unknown),
            (62, Mode::Ready, PUSHES),
            (80, Mode::Ready, Push::Excluded),
        ]);
        assert_eq!((answer.ok, answer.mode, answer.may_push), (true, Some("ready"), vec![]));
        assert!((80..=81).contains(&after.as_millis()), "{after:?}");
    }

    #[test]
    fn hazard_13_disarm_names_a_joint_that_may_push() {
        for (push, evidence) in [(PUSHES, "shows -225 ‰"), (Push::Unknown, "was not received")] {
            let shown: &'static [_] = Box::leak(Box::new([(52, Mode::Ready, push)]));
            let (answer, after) = disarmed(shown);
            assert_eq!((answer.ok, answer.mode, answer.may_push), (false, Some("ready"), vec![3]));
            assert_eq!(after.as_millis(), 100);
            let error = answer.error.unwrap();
            let expected =
                format!("ready, but joint 3 may push: 6077h {evidence}; do not reach in");
            assert!(error.starts_with(&expected), "{error}");
        }
    }

    #[test]
    fn stop_after_a_disarm_is_in_its_response() {
        let (answer, after) = disarmed(&[
            (52, Mode::Ready, PUSHES),
            (92, Mode::ZeroTorque, PUSHES),
            (98, Mode::ZeroTorque, Push::Excluded),
        ]);
        assert_eq!((answer.ok, answer.mode), (true, Some("zero-torque")));
        assert!(after.as_millis() < 100, "{after:?}");
        let (answer, _) = disarmed(&[(92, Mode::ZeroTorque, PUSHES)]);
        assert!(answer.error.unwrap().starts_with("zero-torque, but joint 3 may push"));
    }

    #[test]
    fn disarm_of_a_stopping_node_is_answered_at_once() {
        run(|handler, mut receiver, _| async move {
            receiver.close();
            let answer = timeout(Duration::ZERO, handler.answer(ConsoleCommand::Disarm, None))
                .await
                .unwrap();
            assert_eq!(answer.error.as_deref(), Some("the node is stopping"));
        });
    }

    #[test]
    fn request_with_a_boot_or_homing_may_take_longer_than_a_second() {
        for ask in [ConsoleCommand::Reset, ConsoleCommand::Zero(None)] {
            run(|handler, mut receiver, _| async move {
                let boot = async {
                    sleep(Duration::from_millis(1)).await;
                    let accepted = receiver.next(NOW).unwrap();
                    receiver.begin_boot();
                    sleep(Duration::from_secs(30)).await;
                    receiver.end_boot(NOW);
                    accepted.answer(Ok(Mode::Ready));
                };
                let (answer, ()) = tokio::join!(handler.answer(ask, None), boot);
                assert_eq!((answer.ok, answer.mode), (true, Some("ready")));
            });
        }
    }

    #[test]
    fn status_during_a_boot_is_boot_without_older_values() {
        run(|handler, mut receiver, latest| async move {
            let record = any_record();
            latest.set(&Record { at: NOW, ..record }, 0, Losses::default());
            assert!(handler.answer(ConsoleCommand::Status, None).await.status.is_some());
            receiver.begin_boot();
            let answer = handler.answer(ConsoleCommand::Status, None).await;
            assert_eq!((answer.mode, answer.status.is_none()), (Some("boot"), true));
            receiver.end_boot(NOW);
            assert!(handler.answer(ConsoleCommand::Status, None).await.status.is_some());
        });
    }
}
