//! Requests from the console to the cycle: a short queue, and a separate counter for disarm.
//!
//! The cycle compares the disarm counter once a cycle, so no queued request and no client can delay a disarm.
//!
//! An abandoned request must not act later. A queued request is refused if it is older than a second, or if its client has
//! disconnected. It is also refused if it precedes the end of a boot or a disarm.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::time::Duration;

use derive_more::Display;
use tokio::sync::{mpsc, oneshot};

use node::record::Mode;
use node::{Request, RequestError};
use units::time::Instant;

/// Maximum number of queued requests; further ones are refused as [`Denial::Busy`].
const QUEUE_CAPACITY: usize = 8;

/// Maximum age of a request.
const MAX_AGE: Duration = Duration::from_secs(1);

/// Reasons why a request is refused.
#[derive(Debug, Display)]
pub enum Denial {
    /// Refusal by the node, with the reason.
    #[display("{_0}")]
    Refused(RequestError),
    /// Reset whose latch cannot be written: no drive may be enabled.
    #[display("{_0}")]
    Latch(String),
    /// Boot in progress.
    #[display("the node is booting: retry when it is ready")]
    Booting,
    /// Stop in progress.
    #[display("the node is stopping")]
    Ending,
    /// Full queue.
    #[display("too many requests are waiting: retry")]
    Busy,
    /// Request older than a second, with its age.
    #[display("the request is {:.1} s old: retry", _0.as_secs_f64())]
    TooOld(Duration),
    /// Request that precedes a disarm.
    #[display("disarmed meanwhile: retry")]
    Disarmed,
    /// Request whose client has disconnected.
    #[display("its client has disconnected")]
    Withdrawn,
}

/// Result of a request: the mode after it.
pub type Outcome = Result<Mode, Denial>;

/// Phase of the node, which decides the requests it accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Only disarm is accepted.
    Booting,
    /// All requests are accepted.
    Running,
    /// No request is accepted, because the node stops.
    Ending,
}

impl Phase {
    const fn number(self) -> u8 {
        match self {
            Self::Booting => 0,
            Self::Running => 1,
            Self::Ending => 2,
        }
    }

    const fn of_number(number: u8) -> Self {
        match number {
            0 => Self::Booting,
            1 => Self::Running,
            _ => Self::Ending,
        }
    }
}

/// Lock-free state shared by sender and receiver.
#[derive(Debug)]
struct QueueState {
    /// Number of the [`Phase`].
    phase: AtomicU8,
    /// Number of disarms requested so far.
    disarms: AtomicU64,
    /// Number of disarms completed so far.
    disarmed: AtomicU64,
    /// Index in [`Mode::ALL`] of the mode after the last completed disarm.
    disarmed_to: AtomicU8,
}

impl QueueState {
    fn phase(&self) -> Phase {
        Phase::of_number(self.phase.load(Ordering::Acquire))
    }
}

/// Queued request, with the way to its client.
#[derive(Debug)]
struct Pending {
    request: Request,
    made_at: Instant,
    /// Number of disarms requested before this request.
    disarms: u64,
    is_withdrawn: Arc<AtomicBool>,
    answer: oneshot::Sender<Outcome>,
}

impl Pending {
    /// Sends the outcome to the client, if it is still connected.
    fn answer(self, outcome: Outcome) {
        self.answer.send(outcome).ok();
    }
}

/// Returns sender and receiver, in phase booting.
pub fn channel() -> (RequestSender, RequestReceiver) {
    let (queue, queued) = mpsc::channel(QUEUE_CAPACITY);
    let shared = Arc::new(QueueState {
        phase: AtomicU8::new(Phase::Booting.number()),
        disarms: AtomicU64::new(0),
        disarmed: AtomicU64::new(0),
        disarmed_to: AtomicU8::new(0),
    });
    let receiver = RequestReceiver { queued, shared: Arc::clone(&shared), ready_at: Instant::ZERO };
    (RequestSender { queue, shared }, receiver)
}

/// Sender of requests, used by the console.
#[derive(Clone, Debug)]
pub struct RequestSender {
    queue: mpsc::Sender<Pending>,
    shared: Arc<QueueState>,
}

/// Number of a requested disarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Disarm(u64);

impl RequestSender {
    /// Returns the node's phase.
    pub fn phase(&self) -> Phase {
        self.shared.phase()
    }

    /// Requests a disarm. It cannot be lost or refused.
    pub fn request_disarm(&self) -> Disarm {
        Disarm(self.shared.disarms.fetch_add(1, Ordering::AcqRel) + 1)
    }

    /// Returns the mode after this disarm, once it is complete.
    pub fn disarm_result(&self, Disarm(number): Disarm) -> Option<Mode> {
        let is_done = self.shared.disarmed.load(Ordering::Acquire) >= number;
        let place = usize::from(self.shared.disarmed_to.load(Ordering::Acquire));
        Mode::ALL.get(place).copied().filter(|_| is_done)
    }

    /// Queues any other request; returns the receiver of its outcome. Setting `is_withdrawn` withdraws it.
    ///
    /// # Errors
    /// When the node is booting or stopping, or the queue is full.
    pub fn send(
        &self,
        request: Request,
        made_at: Instant,
        is_withdrawn: &Arc<AtomicBool>,
    ) -> Result<oneshot::Receiver<Outcome>, Denial> {
        match self.phase() {
            Phase::Running => {}
            Phase::Booting => return Err(Denial::Booting),
            Phase::Ending => return Err(Denial::Ending),
        }
        let (answer, answered) = oneshot::channel();
        let disarms = self.shared.disarms.load(Ordering::Acquire);
        let is_withdrawn = Arc::clone(is_withdrawn);
        let pending = Pending { request, made_at, disarms, is_withdrawn, answer };
        self.queue.try_send(pending).map_err(|_| Denial::Busy)?;
        Ok(answered)
    }
}

/// Receiver of requests, used by the cycle thread; never blocks.
#[derive(Debug)]
pub struct RequestReceiver {
    queued: mpsc::Receiver<Pending>,
    shared: Arc<QueueState>,
    /// End of the last boot. Earlier requests are refused.
    ready_at: Instant,
}

/// Request to execute in this cycle.
#[derive(Debug)]
pub struct AcceptedRequest {
    pub request: Request,
    pending: Pending,
}

impl AcceptedRequest {
    /// Sends the outcome to the client.
    pub fn answer(self, outcome: Result<Mode, RequestError>) {
        self.pending.answer(outcome.map_err(Denial::Refused));
    }

    /// Refuses a reset because its latch cannot be written.
    pub fn refuse_without_latch(self, reason: String) {
        self.pending.answer(Err(Denial::Latch(reason)));
    }
}

impl RequestReceiver {
    /// Returns the newest disarm that is not complete.
    pub fn pending_disarm(&self) -> Option<Disarm> {
        let queued = self.disarms();
        (queued != self.shared.disarmed.load(Ordering::Relaxed)).then_some(Disarm(queued))
    }

    /// Completes this disarm and all before it; the mode is now `mode`.
    pub fn complete_disarm(&self, Disarm(number): Disarm, mode: Mode) {
        let place = Mode::ALL.iter().position(|one| *one == mode);
        let place = place.and_then(|place| u8::try_from(place).ok()).unwrap_or_default();
        self.shared.disarmed_to.store(place, Ordering::Release);
        self.shared.disarmed.store(number, Ordering::Release);
    }

    fn disarms(&self) -> u64 {
        self.shared.disarms.load(Ordering::Acquire)
    }

    /// Returns the next valid request; refuses the invalid ones before it.
    pub fn next(&mut self, now: Instant) -> Option<AcceptedRequest> {
        while let Ok(pending) = self.queued.try_recv() {
            match self.denies(&pending, now) {
                None => return Some(AcceptedRequest { request: pending.request, pending }),
                Some(denied) => pending.answer(Err(denied)),
            }
        }
        None
    }

    fn denies(&self, pending: &Pending, now: Instant) -> Option<Denial> {
        let age = now.since(pending.made_at);
        if pending.is_withdrawn.load(Ordering::Acquire) {
            Some(Denial::Withdrawn)
        } else if pending.made_at < self.ready_at {
            Some(Denial::Booting)
        } else if age > MAX_AGE {
            Some(Denial::TooOld(age))
        } else if pending.disarms != self.disarms() {
            Some(Denial::Disarmed)
        } else {
            None
        }
    }

    /// Enters phase booting: until [`end_boot`](Self::end_boot) only disarm is accepted.
    pub fn begin_boot(&self) {
        self.enter(Phase::Booting);
    }

    /// Completes disarms and refuses all other requests; to be called during a boot, when all torques are zero.
    pub fn answer_during_boot(&mut self) {
        if let Some(disarm) = self.pending_disarm() {
            self.complete_disarm(disarm, Mode::Boot);
        }
        while let Ok(pending) = self.queued.try_recv() {
            pending.answer(Err(Denial::Booting));
        }
    }

    /// Enters phase running; the boot has ended at `now`.
    pub fn end_boot(&mut self, now: Instant) {
        self.ready_at = now;
        self.enter(Phase::Running);
    }

    /// Enters phase ending and refuses all queued requests.
    pub fn close(&mut self) {
        self.enter(Phase::Ending);
        while let Ok(pending) = self.queued.try_recv() {
            pending.answer(Err(Denial::Ending));
        }
    }

    fn enter(&self, phase: Phase) {
        self.shared.phase.store(phase.number(), Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    fn running() -> (RequestSender, RequestReceiver) {
        let (sender, mut receiver) = channel();
        receiver.end_boot(at(0));
        (sender, receiver)
    }

    fn send(
        sender: &RequestSender,
        request: Request,
        made_at: Instant,
    ) -> oneshot::Receiver<Outcome> {
        sender.send(request, made_at, &Arc::default()).unwrap()
    }

    fn denied(mut answered: oneshot::Receiver<Outcome>) -> String {
        answered.try_recv().unwrap().unwrap_err().to_string()
    }

    #[test]
    fn disarm_overtakes_a_full_queue() {
        let (sender, mut receiver) = running();
        let mut armed: Vec<_> =
            (0..QUEUE_CAPACITY).map(|_| send(&sender, Request::Arm, at(1))).collect();
        assert!(matches!(sender.send(Request::Arm, at(1), &Arc::default()), Err(Denial::Busy)));
        let disarm = sender.request_disarm();
        assert_eq!(receiver.pending_disarm(), Some(disarm));
        assert_eq!(sender.disarm_result(disarm), None);
        receiver.complete_disarm(disarm, Mode::Armed);
        assert_eq!(sender.disarm_result(disarm), Some(Mode::Armed));
        assert_eq!(receiver.pending_disarm(), None);
        assert!(receiver.next(at(2)).is_none(), "requests before a disarm are void");
        assert_eq!(denied(armed.remove(0)), "disarmed meanwhile: retry");
    }

    #[test]
    fn request_older_than_a_second_is_refused() {
        let (sender, mut receiver) = running();
        let stale = send(&sender, Request::Arm, at(1));
        let fresh = send(&sender, Request::Arm, at(2));
        let accepted = receiver.next(at(1_002)).unwrap();
        assert_eq!(denied(stale), "the request is 1.0 s old: retry");
        accepted.answer(Ok(Mode::Armed));
        assert_eq!(fresh.blocking_recv().unwrap().unwrap(), Mode::Armed);
    }

    #[test]
    fn request_of_a_disconnected_client_is_refused() {
        let (sender, mut receiver) = running();
        let is_withdrawn = Arc::default();
        let answered = sender.send(Request::Arm, at(1), &is_withdrawn).unwrap();
        is_withdrawn.store(true, Ordering::Release);
        assert!(receiver.next(at(2)).is_none());
        assert_eq!(denied(answered), "its client has disconnected");
    }

    #[test]
    fn request_made_during_a_boot_is_refused() {
        let (sender, mut receiver) = channel();
        assert!(matches!(sender.send(Request::Arm, at(1), &Arc::default()), Err(Denial::Booting)));
        receiver.end_boot(at(5));
        // Requests made between two calls of `answer_during_boot`.
        let early = send(&sender, Request::Arm, at(4));
        let later = send(&sender, Request::Arm, at(5));
        assert_eq!(receiver.next(at(6)).unwrap().request, Request::Arm);
        assert_eq!(denied(early), "the node is booting: retry when it is ready");
        receiver.begin_boot();
        receiver.answer_during_boot();
        assert!(later.blocking_recv().is_err(), "the accepted request was dropped unanswered");
    }

    #[test]
    fn disarm_during_a_boot_completes_at_once() {
        let (sender, mut receiver) = channel();
        let disarm = sender.request_disarm();
        receiver.answer_during_boot();
        assert_eq!(sender.disarm_result(disarm), Some(Mode::Boot));
    }

    #[test]
    fn stopping_node_refuses_queued_requests() {
        let (sender, mut receiver) = running();
        let waiting = send(&sender, Request::Arm, at(1));
        receiver.close();
        assert_eq!(denied(waiting), "the node is stopping");
        assert!(matches!(sender.send(Request::Arm, at(1), &Arc::default()), Err(Denial::Ending)));
        assert_eq!(sender.phase(), Phase::Ending);
    }
}
