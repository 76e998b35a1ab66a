//! Requests between the console and the cycle: a short queue, and beside it a way for disarm alone.
//!
//! A disarm is a number that counts up. The cycle compares it once a cycle, so nothing that is queued, and no client,
//! can stand before it. A request carries the time at which it was made. One that is older than a second, that was made
//! before a boot ended or before a disarm, or whose client has left, is refused: what a person has given up does not
//! happen later.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::AtomicU8;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering;
use std::time::Duration;

use tokio::sync::mpsc;
use tokio::sync::oneshot;

use node::Refused;
use node::Request;
use node::record::Mode;
use units::time::Instant;

/// Requests that may wait for the next cycle.
const QUEUE: usize = 8;

/// Age from which a request is refused.
const MAX_AGE: Duration = Duration::from_secs(1);

/// Reason why a request was not granted.
#[derive(Debug)]
pub(crate) enum Denied {
    /// The node refuses it.
    Refused(Refused),
    /// The network boots.
    Booting,
    /// The node ends.
    Ending,
    /// Too many requests wait.
    Busy,
    /// The request is this old.
    TooOld(Duration),
    /// A disarm was asked for after it was made.
    Disarmed,
    /// Its client has left.
    Withdrawn,
}

impl fmt::Display for Denied {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(refused) => refused.fmt(f),
            Self::Booting => f.write_str("the node is booting: ask again when it is ready"),
            Self::Ending => f.write_str("the node is stopping"),
            Self::Busy => f.write_str("too many requests wait: ask again"),
            Self::TooOld(age) => {
                write!(f, "the request is {:.1} s old: ask again", age.as_secs_f64())
            }
            Self::Disarmed => f.write_str("disarmed meanwhile: ask again"),
            Self::Withdrawn => f.write_str("its client has left"),
        }
    }
}

/// Outcome of a request: the mode it led to.
pub(crate) type Outcome = Result<Mode, Denied>;

/// Part of the node's life, as far as requests go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// Nothing but disarm is granted.
    Booting,
    /// Cycles run.
    Running,
    /// Torque is being taken off, for good.
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

/// State that both ends see without waiting.
#[derive(Debug)]
struct Shared {
    /// Number of the [`Phase`].
    phase: AtomicU8,
    /// Disarms asked for so far.
    disarms: AtomicU64,
    /// Disarms done so far.
    disarmed: AtomicU64,
    /// Place in [`Mode::ALL`] of the mode that the last of these led to.
    disarmed_to: AtomicU8,
}

impl Shared {
    fn phase(&self) -> Phase {
        Phase::of_number(self.phase.load(Ordering::Acquire))
    }
}

/// A request on its way to the cycle.
#[derive(Debug)]
struct Pending {
    request: Request,
    made_at: Instant,
    /// Disarms asked for when it was made.
    disarms: u64,
    is_withdrawn: Arc<AtomicBool>,
    answer: oneshot::Sender<Outcome>,
}

impl Pending {
    /// Answers. A client that has left gets none.
    fn answer(self, outcome: Outcome) {
        self.answer.send(outcome).ok();
    }
}

/// The two ends; the node boots.
pub(crate) fn channel() -> (Requests, Inbox) {
    let (queue, asked) = mpsc::channel(QUEUE);
    let shared = Arc::new(Shared {
        phase: AtomicU8::new(Phase::Booting.number()),
        disarms: AtomicU64::new(0),
        disarmed: AtomicU64::new(0),
        disarmed_to: AtomicU8::new(0),
    });
    let inbox = Inbox { asked, shared: Arc::clone(&shared), ready_at: Instant::ZERO };
    (Requests { queue, shared }, inbox)
}

/// The console's end.
#[derive(Clone, Debug)]
pub(crate) struct Requests {
    queue: mpsc::Sender<Pending>,
    shared: Arc<Shared>,
}

/// Number of a disarm that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Disarm(u64);

impl Requests {
    /// The node's phase.
    pub(crate) fn phase(&self) -> Phase {
        self.shared.phase()
    }

    /// Asks for a disarm. It cannot be lost, and is done however long the answer takes.
    pub(crate) fn disarm(&self) -> Disarm {
        Disarm(self.shared.disarms.fetch_add(1, Ordering::AcqRel) + 1)
    }

    /// The mode it led to, once it is done.
    pub(crate) fn disarmed(&self, Disarm(number): Disarm) -> Option<Mode> {
        let is_done = self.shared.disarmed.load(Ordering::Acquire) >= number;
        let place = usize::from(self.shared.disarmed_to.load(Ordering::Acquire));
        Mode::ALL.get(place).copied().filter(|_| is_done)
    }

    /// Asks for anything else; where the outcome comes. Setting `is_withdrawn` takes the request back.
    ///
    /// # Errors
    /// When the node boots or ends, or too many requests wait.
    pub(crate) fn ask(
        &self,
        request: Request,
        made_at: Instant,
        is_withdrawn: &Arc<AtomicBool>,
    ) -> Result<oneshot::Receiver<Outcome>, Denied> {
        match self.phase() {
            Phase::Running => {}
            Phase::Booting => return Err(Denied::Booting),
            Phase::Ending => return Err(Denied::Ending),
        }
        let (answer, answered) = oneshot::channel();
        let disarms = self.shared.disarms.load(Ordering::Acquire);
        let is_withdrawn = Arc::clone(is_withdrawn);
        let pending = Pending { request, made_at, disarms, is_withdrawn, answer };
        self.queue.try_send(pending).map_err(|_| Denied::Busy)?;
        Ok(answered)
    }
}

/// The cycle's end. Nothing here waits.
#[derive(Debug)]
pub(crate) struct Inbox {
    asked: mpsc::Receiver<Pending>,
    shared: Arc<Shared>,
    /// Requests made before were made during a boot.
    ready_at: Instant,
}

/// A request that is to be done now.
#[derive(Debug)]
pub(crate) struct Due {
    pub(crate) request: Request,
    pending: Pending,
}

impl Due {
    /// Answers with what it came to.
    pub(crate) fn answer(self, outcome: Result<Mode, Refused>) {
        self.pending.answer(outcome.map_err(Denied::Refused));
    }
}

impl Inbox {
    /// The newest disarm that is not done.
    pub(crate) fn disarm(&self) -> Option<Disarm> {
        let asked = self.disarms();
        (asked != self.shared.disarmed.load(Ordering::Relaxed)).then_some(Disarm(asked))
    }

    /// This disarm is done, with all before it, and led to `mode`.
    pub(crate) fn disarmed(&self, Disarm(number): Disarm, mode: Mode) {
        let place = Mode::ALL.iter().position(|one| *one == mode);
        let place = place.and_then(|place| u8::try_from(place).ok()).unwrap_or_default();
        self.shared.disarmed_to.store(place, Ordering::Release);
        self.shared.disarmed.store(number, Ordering::Release);
    }

    fn disarms(&self) -> u64 {
        self.shared.disarms.load(Ordering::Acquire)
    }

    /// The next request that is still wanted; the others are refused.
    pub(crate) fn next(&mut self, now: Instant) -> Option<Due> {
        while let Ok(pending) = self.asked.try_recv() {
            match self.denies(&pending, now) {
                None => return Some(Due { request: pending.request, pending }),
                Some(denied) => pending.answer(Err(denied)),
            }
        }
        None
    }

    fn denies(&self, pending: &Pending, now: Instant) -> Option<Denied> {
        let age = now.since(pending.made_at);
        if pending.is_withdrawn.load(Ordering::Acquire) {
            Some(Denied::Withdrawn)
        } else if pending.made_at < self.ready_at {
            Some(Denied::Booting)
        } else if age > MAX_AGE {
            Some(Denied::TooOld(age))
        } else if pending.disarms != self.disarms() {
            Some(Denied::Disarmed)
        } else {
            None
        }
    }

    /// A boot begins: until [`booted`](Self::booted) only disarm is granted.
    pub(crate) fn boots(&self) {
        self.enter(Phase::Booting);
    }

    /// To be called during a boot: disarms are granted, as no torque flows then, and all else is refused.
    pub(crate) fn attend_boot(&mut self) {
        if let Some(disarm) = self.disarm() {
            self.disarmed(disarm, Mode::Boot);
        }
        while let Ok(pending) = self.asked.try_recv() {
            pending.answer(Err(Denied::Booting));
        }
    }

    /// A boot has ended at `now`.
    pub(crate) fn booted(&mut self, now: Instant) {
        self.ready_at = now;
        self.enter(Phase::Running);
    }

    /// The node ends: nothing more is granted.
    pub(crate) fn end(&mut self) {
        self.enter(Phase::Ending);
        while let Ok(pending) = self.asked.try_recv() {
            pending.answer(Err(Denied::Ending));
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

    fn running() -> (Requests, Inbox) {
        let (requests, mut inbox) = channel();
        inbox.booted(at(0));
        (requests, inbox)
    }

    fn ask(requests: &Requests, request: Request, made_at: Instant) -> oneshot::Receiver<Outcome> {
        requests.ask(request, made_at, &Arc::default()).unwrap()
    }

    fn denied(mut answered: oneshot::Receiver<Outcome>) -> String {
        answered.try_recv().unwrap().unwrap_err().to_string()
    }

    #[test]
    fn disarm_overtakes_a_full_queue() {
        let (requests, mut inbox) = running();
        let mut armed: Vec<_> = (0..QUEUE).map(|_| ask(&requests, Request::Arm, at(1))).collect();
        assert!(matches!(requests.ask(Request::Arm, at(1), &Arc::default()), Err(Denied::Busy)));
        let disarm = requests.disarm();
        assert_eq!(inbox.disarm(), Some(disarm));
        assert_eq!(requests.disarmed(disarm), None);
        inbox.disarmed(disarm, Mode::Armed);
        assert_eq!(requests.disarmed(disarm), Some(Mode::Armed));
        assert_eq!(inbox.disarm(), None);
        assert!(inbox.next(at(2)).is_none(), "what was asked before a disarm is void");
        assert_eq!(denied(armed.remove(0)), "disarmed meanwhile: ask again");
    }

    #[test]
    fn request_older_than_a_second_is_refused() {
        let (requests, mut inbox) = running();
        let stale = ask(&requests, Request::Arm, at(1));
        let fresh = ask(&requests, Request::Arm, at(2));
        let due = inbox.next(at(1_002)).unwrap();
        assert_eq!(denied(stale), "the request is 1.0 s old: ask again");
        due.answer(Ok(Mode::Armed));
        assert_eq!(fresh.blocking_recv().unwrap().unwrap(), Mode::Armed);
    }

    #[test]
    fn request_whose_client_left_is_refused() {
        let (requests, mut inbox) = running();
        let is_withdrawn = Arc::default();
        let answered = requests.ask(Request::Arm, at(1), &is_withdrawn).unwrap();
        is_withdrawn.store(true, Ordering::Release);
        assert!(inbox.next(at(2)).is_none());
        assert_eq!(denied(answered), "its client has left");
    }

    #[test]
    fn request_made_during_a_boot_is_refused() {
        let (requests, mut inbox) = channel();
        assert!(matches!(requests.ask(Request::Arm, at(1), &Arc::default()), Err(Denied::Booting)));
        inbox.booted(at(5));
        // Those that slipped in between two looks of a boot.
        let early = ask(&requests, Request::Arm, at(4));
        let later = ask(&requests, Request::Arm, at(5));
        assert_eq!(inbox.next(at(6)).unwrap().request, Request::Arm);
        assert_eq!(denied(early), "the node is booting: ask again when it is ready");
        inbox.boots();
        inbox.attend_boot();
        assert!(later.blocking_recv().is_err(), "the one taken was never answered");
    }

    #[test]
    fn disarm_during_a_boot_is_granted_at_once() {
        let (requests, mut inbox) = channel();
        let disarm = requests.disarm();
        inbox.attend_boot();
        assert_eq!(requests.disarmed(disarm), Some(Mode::Boot));
    }

    #[test]
    fn node_that_ends_refuses_what_waits() {
        let (requests, mut inbox) = running();
        let waiting = ask(&requests, Request::Arm, at(1));
        inbox.end();
        assert_eq!(denied(waiting), "the node is stopping");
        assert!(matches!(requests.ask(Request::Arm, at(1), &Arc::default()), Err(Denied::Ending)));
        assert_eq!(requests.phase(), Phase::Ending);
    }
}
