//! A link with delay between node and commanded side, in memory: constant delay, jitter, loss, reordering, outage.
//!
//! The far side runs its own cycle, whatever arrives. Of commands and samples only ever newer ones act (ADR 16). A sample
//! carries the newest stamp of the node that the far side had when it took the sample, so its age includes the way there:
//!
//! ```text
//!  node       command, stamp t0 ─┐                      ┌─► sample, stamp t0: its age is now − t0
//!  far side                      └─► newest stamp t0 ───┘   taken in the first cycle after the arrival
//! ```

use std::time::Duration;

use remote::delay::DelaySettings;
use remote::{Remote, Sensed};
use sim::random::SplitMix;
use units::spatial::Motion;
use units::time::Instant;

/// Shortest time between two datagrams of one direction, for the length of the queues.
const MIN_PERIOD: Duration = Duration::from_micros(250);

/// Maximum number of datagrams under way in one direction.
const MAX_UNDER_WAY: usize = 8_192;

/// Maximum time that the far side catches up with after a pause of the node.
const MAX_CATCH_UP: Duration = Duration::from_millis(100);

/// Datagrams that were sent, and their fate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Sent.
    pub sent: u64,
    /// Lost by chance or in an outage.
    pub lost: u64,
    /// Lost because too many were under way.
    pub overflowed: u64,
    /// Received after a newer one, and dropped.
    pub overtaken: u64,
}

/// A commanded side behind a link with delay, or directly connected.
#[derive(Clone, Debug)]
pub struct Delayed<R> {
    far: R,
    link: Option<Link>,
}

/// Both directions of the link, and the state of its ends.
#[derive(Clone, Debug)]
struct Link {
    settings: DelaySettings,
    there: Way<(Instant, Motion)>,
    back: Way<Sensed>,
    /// Time of the first exchange.
    begun: Option<Instant>,
    /// Next cycle of the far side; `None` before the first exchange.
    next: Option<Instant>,
    /// Stamp and content of the newest command at the far side, and its arrival.
    command: Option<(Instant, Motion, Instant)>,
    /// Newest sample at the node.
    newest: Option<Sensed>,
}

impl<R> Delayed<R> {
    /// Connects `far` directly: the same as `far` alone.
    pub const fn direct(far: R) -> Self {
        Self { far, link: None }
    }

    /// Puts a link between the node and `far`. Allocates; an exchange does not.
    pub fn new(far: R, settings: DelaySettings) -> Self {
        Self { far, link: Some(Link::new(settings)) }
    }

    /// Connects `far` by a link with `settings`, or directly without.
    pub fn by(far: R, settings: Option<DelaySettings>) -> Self {
        Self { far, link: settings.map(Link::new) }
    }

    /// The commanded side.
    pub const fn far(&self) -> &R {
        &self.far
    }

    /// The commanded side, to change it between two exchanges.
    pub const fn far_mut(&mut self) -> &mut R {
        &mut self.far
    }

    /// Returns the fate of the commands and that of the samples; `None` where there is no link between.
    pub fn counts(&self) -> Option<[Counts; 2]> {
        self.link.as_ref().map(|link| [link.there.counts, link.back.counts])
    }
}

impl<R: Remote> Remote for Delayed<R> {
    fn exchange(&mut self, now: Instant, command: &Motion) -> Option<Sensed> {
        match &mut self.link {
            None => self.far.exchange(now, command),
            Some(link) => {
                let elapsed = now.since(*link.begun.get_or_insert(now));
                link.there.send(now, elapsed, (now, *command), &link.settings);
                link.run_far_side(now, &mut self.far);
                link.newest = link.back.receive(now).map(|(_, sensed)| sensed).or(link.newest);
                link.newest
            }
        }
    }
}

impl Link {
    fn new(settings: DelaySettings) -> Self {
        let DelaySettings { delay, jitter, seed, .. } = settings;
        let settings = DelaySettings { period: settings.period.max(MIN_PERIOD), ..settings };
        let length = ((delay + jitter).as_micros() / MIN_PERIOD.as_micros()).saturating_add(4);
        let length = usize::try_from(length).unwrap_or(MAX_UNDER_WAY).min(MAX_UNDER_WAY);
        Self {
            settings,
            there: Way::new(length, seed),
            back: Way::new(length, !seed),
            begun: None,
            next: None,
            command: None,
            newest: None,
        }
    }

    /// Runs the cycles of the far side that are due until `now`.
    fn run_far_side(&mut self, now: Instant, far: &mut impl Remote) {
        let DelaySettings { period, hold_after, .. } = self.settings;
        let begun = self.begun.unwrap_or(now);
        let mut next = self.next.unwrap_or(now);
        if now.since(next) > MAX_CATCH_UP {
            next = now;
        }
        while next <= now {
            if let Some((at, (stamp, motion))) = self.there.receive(next) {
                self.command = Some((stamp, motion, at));
            }
            let fresh = self.command.filter(|(.., at)| next.since(*at) <= hold_after);
            let motion = fresh.map_or(Motion::Hold, |(_, motion, _)| motion);
            let sensed = far.exchange(next, &motion).filter(|sensed| sensed.at == next);
            // What the far side repeats is not sent again: it would get a newer stamp.
            if let Some((sensed, (stamp, ..))) = sensed.zip(self.command) {
                let sensed = Sensed { at: stamp, ..sensed };
                self.back.send(next, next.since(begun), sensed, &self.settings);
            }
            next = next + period;
        }
        self.next = Some(next);
    }
}

/// A datagram on its way.
#[derive(Clone, Copy, Debug)]
struct Datagram<T> {
    number: u64,
    arrival: Instant,
    content: T,
}

/// One direction.
#[derive(Clone, Debug)]
struct Way<T> {
    under_way: Vec<Datagram<T>>,
    length: usize,
    random: SplitMix,
    counts: Counts,
    /// Arrival of the last one that was sent.
    last_arrival: Instant,
    /// Number of the newest that was received.
    received: Option<u64>,
}

impl<T: Copy> Way<T> {
    fn new(length: usize, seed: u64) -> Self {
        Self {
            under_way: Vec::with_capacity(length),
            length,
            random: SplitMix::new(seed),
            counts: Counts::default(),
            last_arrival: Instant::ZERO,
            received: None,
        }
    }

    /// Sends `content`, `elapsed` after the first exchange.
    fn send(&mut self, now: Instant, elapsed: Duration, content: T, settings: &DelaySettings) {
        let DelaySettings { delay, jitter, loss, reorders, .. } = *settings;
        let number = self.counts.sent;
        self.counts.sent += 1;
        // Drawn for every datagram, so that the loss of one changes no other.
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

    /// Takes what has arrived until `now`; returns the newest with its arrival, if it is newer than all before.
    fn receive(&mut self, now: Instant) -> Option<(Instant, T)> {
        let mut newest: Option<Datagram<T>> = None;
        let mut count = 0;
        self.under_way.retain(|datagram| {
            if datagram.arrival > now {
                return true;
            }
            let is_newer = newest.is_none_or(|newest| newest.number < datagram.number);
            newest = if is_newer { Some(*datagram) } else { newest };
            count += 1;
            false
        });
        let newest = newest.filter(|one| self.received.is_none_or(|before| before < one.number));
        self.counts.overtaken += count - u64::from(newest.is_some());
        let Datagram { number, arrival, content } = newest?;
        self.received = Some(number);
        Some((arrival, content))
    }
}

/// Returns the next number of a sequence, uniform in 0..1.
fn unit(random: &mut SplitMix) -> f64 {
    let [.., a, b, c, d] = random.bits().to_le_bytes();
    f64::from(u32::from_le_bytes([a, b, c, d])) / (f64::from(u32::MAX) + 1.0)
}

#[cfg(test)]
mod tests;
