//! Link with delay between node and commanded side, in memory: constant delay, jitter, loss, reordering, outage.
//!
//! Both ends are those of the [`contract`], whose messages are delayed. The far side runs its own cycle, independently of
//! arrivals:
//!
//! ```text
//!  node       Command t0 ─┐                      ┌─► Feedback, echo t0: its age is now − t0
//!  far side               └─► newest echo t0 ────┘   measured in the first cycle after the arrival
//! ```

use std::time::Duration;

use contract::{FarEnd, FarState, Feedback, NodeEnd, Reason, Reject};
use remote::delay::DelaySettings;
use remote::{Command, Remote, RemoteSample, RobotJoints, SideError, messages};
use sim::random::SplitMix;
use units::time::Instant;

/// Shortest time between two messages of one direction, for the length of the queues.
const MIN_PERIOD: Duration = Duration::from_micros(250);

/// Maximum number of messages in transit in one direction.
const MAX_UNDER_WAY: usize = 8_192;

/// Maximum time that the far side catches up with after a pause of the node.
const MAX_CATCH_UP: Duration = Duration::from_millis(100);

/// Number of the arm.
const ARM: u16 = 0;

/// Counts of sent messages by their fate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Messages sent.
    pub sent: u64,
    /// Messages lost at random or in an outage.
    pub lost: u64,
    /// Messages lost because the queue was full.
    pub overflowed: u64,
    /// Messages received after a newer one, and dropped.
    pub overtaken: u64,
}

/// Commanded side behind a link with delay, or directly connected.
#[derive(Clone, Debug)]
pub struct DelayedSide<R> {
    far: R,
    link: Option<DelayedLink>,
}

/// Both directions of the link, and both ends.
#[derive(Clone, Debug)]
struct DelayedLink {
    settings: DelaySettings,
    there: Way<[u8; contract::Command::LENGTH]>,
    back: Way<[u8; Feedback::LENGTH]>,
    node: NodeEnd,
    far: FarEnd,
    /// Time of the first exchange.
    begun: Option<Instant>,
    /// Next cycle of the far side; `None` before the first exchange.
    next: Option<Instant>,
    /// Newest sample at the node.
    newest: Option<RemoteSample>,
    /// Reason of the far side to hold in the present epoch.
    holds: Option<Reason>,
}

impl<R> DelayedSide<R> {
    /// Connects `far` directly, without a link.
    pub const fn direct(far: R) -> Self {
        Self { far, link: None }
    }

    /// Creates a link between the node and `far`. Allocates here, not in exchanges.
    pub fn new(far: R, settings: DelaySettings) -> Self {
        Self { far, link: Some(DelayedLink::new(settings)) }
    }

    /// Connects `far` by a link with `settings`, or directly without.
    pub fn by(far: R, settings: Option<DelaySettings>) -> Self {
        Self { far, link: settings.map(DelayedLink::new) }
    }

    /// Returns the commanded side.
    pub const fn far(&self) -> &R {
        &self.far
    }

    /// Returns the commanded side, for changes between two exchanges.
    pub const fn far_mut(&mut self) -> &mut R {
        &mut self.far
    }

    /// Returns the counts of commands and of feedbacks; `None` without a link.
    pub fn counts(&self) -> Option<[Counts; 2]> {
        self.link.as_ref().map(DelayedLink::counts)
    }
}

impl<R: Remote> Remote for DelayedSide<R> {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        match &mut self.link {
            None => self.far.exchange(now, command),
            Some(link) => link.exchange(now, command, &mut self.far),
        }
    }

    fn begin_epoch(&mut self) {
        match &mut self.link {
            None => self.far.begin_epoch(),
            Some(link) => {
                link.holds = None;
                link.node.begin_epoch();
            }
        }
    }

    fn end_epoch(&mut self) {
        if self.link.is_none() {
            self.far.end_epoch();
        }
    }

    fn joints(&self) -> Option<RobotJoints> {
        self.far.joints()
    }

    fn error(&mut self) -> Option<SideError> {
        match &self.link {
            None => self.far.error(),
            Some(link) => link.holds.map(SideError::Holds),
        }
    }
}

impl DelayedLink {
    fn new(settings: DelaySettings) -> Self {
        let DelaySettings { delay, jitter, seed, hold_after, .. } = settings;
        let settings = DelaySettings { period: settings.period.max(MIN_PERIOD), ..settings };
        let length = ((delay + jitter).as_micros() / MIN_PERIOD.as_micros()).saturating_add(4);
        let length = usize::try_from(length).unwrap_or(MAX_UNDER_WAY).min(MAX_UNDER_WAY);
        Self {
            settings,
            there: Way::new(length, seed),
            back: Way::new(length, !seed),
            // The sessions are constant, so that a run repeats; no other process is on this link.
            node: NodeEnd::new(ARM, 1),
            far: FarEnd::new(ARM, 2, hold_after),
            begun: None,
            next: None,
            newest: None,
            holds: None,
        }
    }

    fn exchange(
        &mut self,
        now: Instant,
        command: &Command,
        far: &mut impl Remote,
    ) -> Option<RemoteSample> {
        let elapsed = now.since(*self.begun.get_or_insert(now));
        let order = messages::order(command);
        self.there.send(now, elapsed, self.node.command(now, &order), &self.settings);
        self.run_far_side(now, far);
        while let Some(feedback) = self.back.receive(now) {
            let Some(sample) = self.node.on_message(now, &feedback) else { continue };
            self.newest = messages::sensed(&sample).or(self.newest);
            let Feedback { head, reason, .. } = sample.feedback;
            let holds = head.epoch == self.node.epoch() && reason.state() == FarState::Holding;
            self.holds = holds.then_some(reason);
        }
        self.newest
    }

    /// Runs the cycles of the far side up to `now`.
    fn run_far_side(&mut self, now: Instant, far: &mut impl Remote) {
        let begun = self.begun.unwrap_or(now);
        let mut next = self.next.unwrap_or(now);
        if now.since(next) > MAX_CATCH_UP {
            next = now;
        }
        while next <= now {
            let before = self.far.leader();
            while let Some(command) = self.there.receive(next) {
                self.far.on_message(next, &command);
            }
            if self.far.leader() != before {
                far.begin_epoch();
            }
            let command = messages::command(&mut self.far, next);
            let sensed = far.exchange(next, &command).filter(|sensed| sensed.at == next);
            // A repeated sample is not sent again, because it would get a newer echo.
            if let Some(sensed) = sensed {
                let feedback = self.far.feedback(next, &messages::measured(&sensed));
                self.back.send(next, next.since(begun), feedback, &self.settings);
            }
            next = next + self.settings.period;
        }
        self.next = Some(next);
    }

    fn counts(&self) -> [Counts; 2] {
        [
            Counts { overtaken: self.far.rejects().get(Reject::Overtaken), ..self.there.counts },
            Counts { overtaken: self.node.rejects().get(Reject::Overtaken), ..self.back.counts },
        ]
    }
}

/// Message in transit.
#[derive(Clone, Copy, Debug)]
struct Datagram<T> {
    number: u64,
    arrival: Instant,
    content: T,
}

/// One direction of the link.
#[derive(Clone, Debug)]
struct Way<T> {
    under_way: Vec<Datagram<T>>,
    length: usize,
    random: SplitMix,
    counts: Counts,
    /// Arrival of the last sent message.
    last_arrival: Instant,
}

impl<T: Copy> Way<T> {
    fn new(length: usize, seed: u64) -> Self {
        Self {
            under_way: Vec::with_capacity(length),
            length,
            random: SplitMix::new(seed),
            counts: Counts::default(),
            last_arrival: Instant::ZERO,
        }
    }

    /// Sends `content`, `elapsed` after the first exchange.
    fn send(&mut self, now: Instant, elapsed: Duration, content: T, settings: &DelaySettings) {
        let DelaySettings { delay, jitter, loss, reorders, .. } = *settings;
        let number = self.counts.sent;
        self.counts.sent += 1;
        // One random number per datagram, so that a loss does not change the sequence.
        let is_unlucky = unit(&mut self.random) < loss;
        let late = jitter.mul_f64(unit(&mut self.random));
        if is_unlucky || settings.is_out(elapsed) {
            self.counts.lost += 1;
            return;
        }
        if self.under_way.len() >= self.length {
            self.counts.overflowed += 1;
            return;
        }
        let alone = now + delay + late;
        let arrival = if reorders { alone } else { alone.max(self.last_arrival) };
        self.last_arrival = self.last_arrival.max(arrival);
        self.under_way.push(Datagram { number, arrival, content });
    }

    /// Takes the oldest message that has arrived by `now`.
    fn receive(&mut self, now: Instant) -> Option<T> {
        let arrived = self.under_way.iter().enumerate().filter(|(_, one)| one.arrival <= now);
        let first = arrived.min_by_key(|(_, one)| (one.arrival, one.number));
        let (place, _) = first?;
        Some(self.under_way.swap_remove(place).content)
    }
}

/// Returns the next number of a sequence, uniform in 0..1.
fn unit(random: &mut SplitMix) -> f64 {
    let [.., a, b, c, d] = random.bits().to_le_bytes();
    f64::from(u32::from_le_bytes([a, b, c, d])) / (f64::from(u32::MAX) + 1.0)
}

#[cfg(test)]
mod tests;
