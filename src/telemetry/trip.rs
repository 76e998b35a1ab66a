//! Detection of trips, and the content of their fault records: all frames and cycles from 2 s before a trip to 1 s after it.
//!
//! Performs no I/O, and does not run on the cycle's thread. Keeps the events of the last 2 s in a ring of constant size,
//! and reports a trip and the end of its record.

use std::collections::VecDeque;
use std::time::Duration;

use crate::session::Brief;
use canopen::frame::Telegram;
use node::cause::Cause;
use node::record::Mode;
use units::time::Instant;

/// Time before a trip in its record.
pub const PRE_TRIGGER: Duration = Duration::from_secs(2);

/// Time after a trip in its record.
pub const POST_TRIGGER: Duration = Duration::from_secs(1);

/// Capacity of the ring. Two buses at 1 Mbit/s carry some 36,000 frames of typical length in 2 s, plus the cycles. In a
/// flood of the shortest frames the ring covers less than 2 s.
const CAPACITY: usize = 1 << 16;

/// Capacity reserved for cycles: more than 2 s at 1 kHz. At a higher rate it grows once.
const CYCLES: usize = 1 << 11;

/// Observed frame or cycle.
#[derive(Clone, Copy, Debug)]
pub enum Observation<'a> {
    /// Frame sent or received, with its time.
    Frame(Instant, &'a Telegram),
    /// End of a cycle, with the part of its record that the log keeps.
    Cycle(&'a Brief),
}

/// Entry in the order of events. Cycles are in a separate ring, because they are rare and four times as large.
#[derive(Clone, Copy, Debug)]
enum Place {
    Frame(Instant, Telegram),
    Cycle(Instant),
}

impl Place {
    const fn at(&self) -> Instant {
        let (Self::Frame(at, _) | Self::Cycle(at)) = self;
        *at
    }
}

/// Entry into a latched mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trip {
    /// Cycle of the entry, from 1.
    pub cycle: u64,
    /// Time of the cycle's SYNC.
    pub at: Instant,
    /// Cause of the stop: the first one of the cycle.
    pub cause: Cause,
    /// Mode before.
    pub from: Mode,
    /// Latched mode.
    pub to: Mode,
}

/// Ring of recent events, and the trip in progress.
#[derive(Debug)]
pub struct TripDetector {
    past: VecDeque<Place>,
    /// Cycles of these events, oldest first.
    cycles: VecDeque<Brief>,
    capacity: usize,
    mode: Mode,
    cause: Option<Cause>,
    /// End of the record of the last trip.
    until: Option<Instant>,
}

impl Default for TripDetector {
    fn default() -> Self {
        Self::with_capacity(CAPACITY)
    }
}

impl TripDetector {
    fn with_capacity(capacity: usize) -> Self {
        let past = VecDeque::with_capacity(capacity);
        let cycles = VecDeque::with_capacity(CYCLES);
        Self { past, cycles, capacity, mode: Mode::Boot, cause: None, until: None }
    }

    /// Returns true once, when the record of the last trip has ended by `now`. Call it before each event.
    pub fn is_over(&mut self, now: Instant) -> bool {
        let is_over = self.until.is_some_and(|until| now >= until);
        if is_over {
            self.until = None;
        }
        is_over
    }

    /// Observes a frame.
    pub fn frame(&mut self, at: Instant, telegram: &Telegram) {
        self.push(Place::Frame(at, *telegram));
    }

    /// Observes a cycle. Returns a trip if the cycle entered a latched mode, or changed its cause. Events within a
    /// second of a trip belong to that trip.
    pub fn cycle(&mut self, brief: &Brief) -> Option<Trip> {
        self.push(Place::Cycle(brief.at));
        self.cycles.push_back(*brief);
        let &Brief { cycle, at, mode: to, cause, .. } = brief;
        let from = std::mem::replace(&mut self.mode, to);
        let earlier = std::mem::replace(&mut self.cause, cause);
        let is_new = to.is_latched() && (from, earlier) != (to, cause);
        let cause = cause.filter(|_| is_new && self.until.is_none())?;
        self.until = Some(at + POST_TRIGGER);
        Some(Trip { cycle, at, cause, from, to })
    }

    /// Returns the last 2 s, oldest first; at a trip, with the cycle that tripped.
    pub fn past(&self) -> impl Iterator<Item = Observation<'_>> {
        let mut cycles = self.cycles.iter();
        self.past.iter().filter_map(move |place| match place {
            Place::Frame(at, telegram) => Some(Observation::Frame(*at, telegram)),
            Place::Cycle(_) => cycles.next().map(Observation::Cycle),
        })
    }

    /// Returns the time span of the ring.
    pub fn reach(&self) -> Duration {
        let ends = self.past.front().zip(self.past.back());
        ends.map_or(Duration::ZERO, |(oldest, newest)| newest.at().since(oldest.at()))
    }

    fn push(&mut self, moment: Place) {
        let horizon = moment.at() - PRE_TRIGGER;
        while self.past.len() >= self.capacity
            || self.past.front().is_some_and(|oldest| oldest.at() < horizon)
        {
            if let Some(Place::Cycle(_)) = self.past.pop_front() {
                self.cycles.pop_front();
            }
        }
        self.past.push_back(moment);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use canopen::frame::{Channel, Frame};
    use units::numbering::Joint;
    use units::spatial::Wrench;

    const LEFT: Cause = Cause::DriveLeft { joint: Joint::of::<3>(), statusword: 0x218 };

    fn brief(millis: u64, mode: Mode, cause: Option<Cause>) -> Brief {
        let at = Instant::from_micros(millis * 1_000);
        let f_s = Wrench::default();
        Brief { cycle: millis, at, mode, cause, inputs: None, sampled: [true; 6], f_s }
    }

    fn shown(watch: &mut TripDetector, brief: &Brief) -> (bool, Option<Trip>) {
        (watch.is_over(brief.at), watch.cycle(brief))
    }

    #[test]
    fn promise_15_trip_has_its_cause_and_the_2_s_before() {
        let mut watch = TripDetector::default();
        for millis in 0..5_000 {
            let (over, trip) = shown(&mut watch, &brief(millis, Mode::Engaged, None));
            assert_eq!((over, trip), (false, None));
        }
        let (_, trip) = shown(&mut watch, &brief(5_000, Mode::ZeroTorque, Some(LEFT)));
        let trip = trip.unwrap();
        assert_eq!((trip.cycle, trip.cause), (5_000, LEFT));
        assert_eq!((trip.from, trip.to), (Mode::Engaged, Mode::ZeroTorque));
        assert_eq!((watch.reach(), watch.past().count()), (PRE_TRIGGER, 2_001));
    }

    #[test]
    fn promise_15_events_within_1_s_belong_to_the_first_trip() {
        let mut watch = TripDetector::default();
        assert!(watch.cycle(&brief(100, Mode::ZeroTorque, Some(LEFT))).is_some());
        for (millis, mode, cause) in [
            (200, Mode::DrivesOff, Some(LEFT)),
            (300, Mode::Ready, None),
            (400, Mode::DrivesOff, Some(Cause::ForeignMaster)),
        ] {
            assert_eq!(shown(&mut watch, &brief(millis, mode, cause)), (false, None));
        }
        let still = Some(Cause::ForeignMaster);
        assert_eq!(shown(&mut watch, &brief(1_100, Mode::DrivesOff, still)), (true, None));
        assert_eq!(shown(&mut watch, &brief(1_101, Mode::DrivesOff, still)), (false, None));
    }

    #[test]
    fn failed_reset_with_another_cause_is_a_new_trip() {
        let mut watch = TripDetector::default();
        assert!(watch.cycle(&brief(0, Mode::DrivesOff, Some(LEFT))).is_some());
        let timeout = Cause::EnableTimeout { joint: Joint::of::<1>(), statusword: 0 };
        let (over, trip) = shown(&mut watch, &brief(9_000, Mode::DrivesOff, Some(timeout)));
        assert!(over);
        assert_eq!(trip.unwrap().cause, timeout);
    }

    #[test]
    fn flood_shortens_the_ring_but_not_its_capacity() {
        let mut watch = TripDetector::with_capacity(100);
        let room = watch.past.capacity();
        let telegram = Telegram { channel: Channel(0), frame: Frame::new(0x80, []) };
        for micros in 0..10_000 {
            watch.frame(Instant::from_micros(micros), &telegram);
        }
        assert_eq!((watch.past().count(), watch.past.capacity()), (100, room));
        assert_eq!(watch.reach(), Duration::from_micros(99));
    }

    proptest! {
        #[test]
        fn promise_15_latched_modes_are_recorded_within_1_s(
            steps in proptest::collection::vec((1..800_u64, 0..Mode::ALL.len()), 1..60),
        ) {
            let mut watch = TripDetector::with_capacity(64);
            let (mut millis, mut mode, mut tripped) = (0, Mode::Boot, None);
            for (step, to) in steps {
                millis += step;
                let to = Mode::ALL[to];
                let now = brief(millis, to, to.is_latched().then_some(LEFT));
                let (_, trip) = shown(&mut watch, &now);
                tripped = trip.map(|trip| trip.at).or(tripped);
                if to.is_latched() && to != mode {
                    prop_assert!(now.at.since(tripped.unwrap()) < POST_TRIGGER);
                }
                mode = to;
                prop_assert!(watch.reach() <= PRE_TRIGGER);
            }
        }
    }
}
