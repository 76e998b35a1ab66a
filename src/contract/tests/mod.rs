//! Tests of the messages and of both ends together, over a network that delays, loses, duplicates and reorders, and with
//! invalid messages.

mod ends;
mod hostile;
mod messages;
mod schedules;
mod sessions;

use std::collections::BTreeMap;
use std::time::Duration;

use crate::{FarEnd, Measurements, Motion, NodeEnd, Order, Sample};
use units::time::Instant;

/// Arm number of both ends.
const ARM: u16 = 3;

/// `hold_after` of the far side.
const HOLD_AFTER: Duration = Duration::from_millis(100);

/// Lead of the far side's clock on the node's.
const OFFSET: Duration = Duration::from_secs(3_600);

fn at(millis: u64) -> Instant {
    Instant::from_micros(1_000 * millis)
}

/// Both ends, with clocks an hour apart.
struct Ends {
    node: NodeEnd,
    far: FarEnd,
}

impl Ends {
    fn new() -> Self {
        Self { node: NodeEnd::new(ARM, 11), far: FarEnd::new(ARM, 22, HOLD_AFTER) }
    }

    /// Returns both ends, armed, after exchanges at 0, 1, 2 and 3 ms.
    fn armed() -> Self {
        let mut ends = Self::new();
        (0..2).for_each(|millis| _ = ends.exchange(at(millis), Motion::Hold));
        ends.node.begin_epoch();
        (2..4).for_each(|millis| _ = ends.exchange(at(millis), Motion::Hold));
        ends
    }

    fn command(&mut self, now: Instant, motion: Motion) -> Vec<u8> {
        self.node.command(now, &Order { motion, is_engaged: true, gripper: None }).to_vec()
    }

    fn feedback(&mut self, now: Instant) -> Vec<u8> {
        let measured = Measurements { wrench: Some(force(now)), ..Measurements::default() };
        self.far.feedback(now + OFFSET, &measured).to_vec()
    }

    /// Exchanges a command and a feedback without delay; returns the far side's motion, and the sample.
    fn exchange(&mut self, now: Instant, motion: Motion) -> (Motion, Option<Sample>) {
        let command = self.command(now, motion);
        self.far.on_message(now + OFFSET, &command);
        let performed = self.far.motion(now + OFFSET);
        let feedback = self.feedback(now);
        (performed, self.node.on_message(now, &feedback))
    }
}

/// Returns a wrench that encodes its time of measurement.
fn force(now: Instant) -> [f64; 6] {
    [Duration::from_micros(now.as_micros()).as_secs_f64(), 0.0, 0.0, 0.0, 0.0, 0.0]
}

/// Returns a rate that encodes the time of its command.
fn rate(now: Instant) -> Motion {
    Motion::Rate(force(now))
}

/// Reproducible random generator (Knuth's MMIX).
struct Dice(u64);

impl Dice {
    fn bits(&mut self) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    /// Returns a number below `count`.
    fn below(&mut self, count: usize) -> usize {
        usize::try_from(self.bits()).unwrap() % count
    }

    fn byte(&mut self) -> u8 {
        u8::try_from(self.below(256)).unwrap()
    }
}

/// Messages in transit to one end, by arrival in ms.
type UnderWay = BTreeMap<u64, Vec<Vec<u8>>>;

/// Sends a message, which arrives after `delay` in ms, is lost, or arrives twice.
fn send(way: &mut UnderWay, now: u64, message: &[u8], [delay, lost, copies]: [u64; 3]) {
    for copy in 0..copies.min(2) {
        if lost % 5 != 0 {
            way.entry(now + delay + copy * delay).or_default().push(message.to_vec());
        }
    }
}
