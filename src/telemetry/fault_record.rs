//! What is kept of a trip: everything on the buses and every cycle of the 2 s before it and the 1 s after.
//!
//! A pure machine, off the cycle's thread. It is shown all that happens, remembers the newest 2 s in a ring
//! that never grows, and says when a trip begins and when its second is over. Nothing is written here.

use std::collections::VecDeque;
use std::time::Duration;

use crate::session::Brief;
use canopen::frame::Telegram;
use node::cause::Cause;
use node::record::Mode;
use units::time::Instant;

/// How much of the past a record begins with.
pub const BEFORE: Duration = Duration::from_secs(2);

/// How much of what follows it ends with.
pub const AFTER: Duration = Duration::from_secs(1);

/// Two buses at 1 Mbit/s carry some 36,000 frames of usual length in 2 s, and cycles stand between them. In
/// a flood of the shortest frames the ring reaches back less far.
const MOST: usize = 1 << 16;

/// Something that happened.
#[derive(Clone, Copy, Debug)]
pub enum Moment {
    /// A frame that passed by.
    Frame(Instant, Telegram),
    /// A cycle.
    Cycle(Brief),
}

impl Moment {
    const fn at(&self) -> Instant {
        match self {
            Self::Frame(at, _) => *at,
            Self::Cycle(brief) => brief.at,
        }
    }
}

/// An entry into a latched mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trip {
    /// The cycle in which it happened, from 1.
    pub cycle: u64,
    /// When its SYNC was sent.
    pub at: Instant,
    /// What stopped the node: the first cause, if others followed within the cycle.
    pub cause: Cause,
    /// The mode it left.
    pub from: Mode,
    /// The mode it latched.
    pub to: Mode,
}

/// The newest past, and the trip whose second is not over.
#[derive(Debug)]
pub struct FaultWatch {
    past: VecDeque<Moment>,
    most: usize,
    mode: Mode,
    cause: Option<Cause>,
    /// When the second after the last trip is over.
    until: Option<Instant>,
}

impl Default for FaultWatch {
    fn default() -> Self {
        Self::remembering(MOST)
    }
}

impl FaultWatch {
    fn remembering(most: usize) -> Self {
        let past = VecDeque::with_capacity(most);
        Self { past, most, mode: Mode::Boot, cause: None, until: None }
    }

    /// Whether, by `now`, the second after the last trip is over; said once. To be asked before each moment.
    pub fn is_over(&mut self, now: Instant) -> bool {
        let is_over = self.until.is_some_and(|until| now >= until);
        if is_over {
            self.until = None;
        }
        is_over
    }

    /// A frame has passed by.
    pub fn frame(&mut self, at: Instant, telegram: &Telegram) {
        self.remember(Moment::Frame(at, *telegram));
    }

    /// A cycle has run. `Some` if it tripped the node: a latched mode was entered, or the cause of one is
    /// another than before. Within the second after a trip everything belongs to that one.
    pub fn cycle(&mut self, brief: &Brief) -> Option<Trip> {
        self.remember(Moment::Cycle(*brief));
        let &Brief { cycle, at, mode: to, cause, .. } = brief;
        let from = std::mem::replace(&mut self.mode, to);
        let earlier = std::mem::replace(&mut self.cause, cause);
        let is_new = to.is_latched() && (from, earlier) != (to, cause);
        let cause = cause.filter(|_| is_new && self.until.is_none())?;
        self.until = Some(at + AFTER);
        Some(Trip { cycle, at, cause, from, to })
    }

    /// The newest 2 s, oldest first; at a trip, with the cycle that tripped.
    pub fn past(&self) -> impl Iterator<Item = &Moment> {
        self.past.iter()
    }

    /// How far back they reach.
    pub fn reach(&self) -> Duration {
        let ends = self.past.front().zip(self.past.back());
        ends.map_or(Duration::ZERO, |(oldest, newest)| newest.at().since(oldest.at()))
    }

    fn remember(&mut self, moment: Moment) {
        let horizon = moment.at() - BEFORE;
        while self.past.len() >= self.most
            || self.past.front().is_some_and(|oldest| oldest.at() < horizon)
        {
            self.past.pop_front();
        }
        self.past.push_back(moment);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use canopen::frame::Channel;
    use canopen::frame::Frame;
    use units::numbering::Joint;
    use units::spatial::Wrench;

    const LEFT: Cause = Cause::DriveLeft { joint: Joint::of::<3>(), statusword: 0x218 };

    fn brief(millis: u64, mode: Mode, cause: Option<Cause>) -> Brief {
        let at = Instant::from_micros(millis * 1_000);
        let f_s = Wrench::default();
        Brief { cycle: millis, at, mode, cause, inputs: None, sampled: [true; 6], f_s }
    }

    fn shown(watch: &mut FaultWatch, brief: &Brief) -> (bool, Option<Trip>) {
        (watch.is_over(brief.at), watch.cycle(brief))
    }

    #[test]
    fn promise_15_a_trip_is_told_with_its_cause_and_the_two_seconds_before_it() {
        let mut watch = FaultWatch::default();
        for millis in 0..5_000 {
            let (over, trip) = shown(&mut watch, &brief(millis, Mode::Engaged, None));
            assert_eq!((over, trip), (false, None));
        }
        let (_, trip) = shown(&mut watch, &brief(5_000, Mode::ZeroTorque, Some(LEFT)));
        let trip = trip.unwrap();
        assert_eq!((trip.cycle, trip.cause), (5_000, LEFT));
        assert_eq!((trip.from, trip.to), (Mode::Engaged, Mode::ZeroTorque));
        assert_eq!((watch.reach(), watch.past().count()), (BEFORE, 2_001));
    }

    #[test]
    fn promise_15_what_follows_within_a_second_belongs_to_the_first_trip() {
        let mut watch = FaultWatch::default();
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
    fn a_reset_that_fails_for_another_reason_is_a_trip_of_its_own() {
        let mut watch = FaultWatch::default();
        assert!(watch.cycle(&brief(0, Mode::DrivesOff, Some(LEFT))).is_some());
        let timeout = Cause::EnableTimeout { joint: Joint::of::<1>(), statusword: 0 };
        let (over, trip) = shown(&mut watch, &brief(9_000, Mode::DrivesOff, Some(timeout)));
        assert!(over);
        assert_eq!(trip.unwrap().cause, timeout);
    }

    #[test]
    fn a_flood_is_remembered_less_far_back_and_takes_no_more_room() {
        let mut watch = FaultWatch::remembering(100);
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
        fn promise_15_every_entry_into_a_latched_mode_is_within_a_second_of_a_trip(
            steps in proptest::collection::vec((1..800_u64, 0..Mode::ALL.len()), 1..60),
        ) {
            let mut watch = FaultWatch::remembering(64);
            let (mut millis, mut mode, mut tripped) = (0, Mode::Boot, None);
            for (step, to) in steps {
                millis += step;
                let to = Mode::ALL[to];
                let now = brief(millis, to, to.is_latched().then_some(LEFT));
                let (_, trip) = shown(&mut watch, &now);
                tripped = trip.map(|trip| trip.at).or(tripped);
                if to.is_latched() && to != mode {
                    prop_assert!(now.at.since(tripped.unwrap()) < AFTER);
                }
                mode = to;
                prop_assert!(watch.reach() <= BEFORE);
            }
        }
    }
}
