//! Invalid messages at both ends: a link with invalid messages must behave as a second link without them.

use super::{ARM, Dice, Ends, OFFSET, at, rate};
use crate::head::Head;
use crate::{Capability, Command, Feedback, Reject};

/// Number of cycles of 1 ms, and of invalid messages at each end per cycle.
const CYCLES: u64 = 1_000;
const OF_EACH_CYCLE: usize = 100;

// Offsets in a message, behind its encapsulation header of four bytes (docs/link.md).
const SESSION: usize = 4 + 8;
const HEAD_END: usize = 4 + 40;

/// Sender of invalid messages to one end.
struct Forger {
    dice: Dice,
    /// Decodes the head of a message of the kind that this end receives.
    head: fn(&[u8]) -> Option<Head>,
    /// Current session at this end.
    session: u64,
    /// Offset of the first of six numbers that must be in their range.
    numbers: usize,
    /// Messages that this end has received.
    taken: Vec<Vec<u8>>,
}

impl Forger {
    fn to_far() -> Self {
        let head = |bytes: &[u8]| Command::decode(bytes).ok().map(|command| command.head);
        Self { dice: Dice(37), head, session: 11, numbers: 4 + 48, taken: Vec::new() }
    }

    fn to_node() -> Self {
        let head = |bytes: &[u8]| {
            let feedback = Feedback::decode(bytes).ok().map(|feedback| feedback.head);
            feedback.or(Capability::decode(bytes).ok().map(|(head, _)| head))
        };
        Self { dice: Dice(38), head, session: 22, numbers: 4 + 64, taken: Vec::new() }
    }

    /// Returns whether a message is valid and of the current session.
    fn is_valid(&self, bytes: &[u8]) -> bool {
        let head = (self.head)(bytes);
        head.is_some_and(|head| head.arm == ARM && head.own.session == self.session)
    }

    /// Delivers a message of the other end among invalid ones.
    fn flood(&mut self, message: &[u8], mut deliver: impl FnMut(&[u8])) {
        self.taken.push(message.to_vec());
        let place = self.dice.below(OF_EACH_CYCLE);
        for count in 0..OF_EACH_CYCLE {
            if count == place {
                deliver(message);
            }
            deliver(&self.wrong(message, count < place));
        }
    }

    /// Returns an invalid message, made from `message`, the newest of the other end. `is_due`: it is not delivered yet.
    fn wrong(&mut self, message: &[u8], is_due: bool) -> Vec<u8> {
        let mut bytes = message.to_vec();
        match self.dice.below(7) {
            0 => (0..self.dice.below(300)).map(|_| self.dice.byte()).collect(),
            1 => {
                bytes[6..].fill_with(|| self.dice.byte());
                bytes
            }
            2 => self.received(is_due),
            3 => {
                // Other content with a number that was received.
                let mut bytes = self.received(is_due);
                bytes[HEAD_END..].fill_with(|| self.dice.byte());
                bytes
            }
            4 => {
                while self.is_valid(&bytes) {
                    let place = self.dice.below(bytes.len());
                    bytes[place] ^= 1 << self.dice.below(8);
                }
                bytes
            }
            5 => {
                bytes
                    .resize([self.dice.below(bytes.len()), bytes.len() + 1][self.dice.below(2)], 0);
                bytes
            }
            _ => {
                if self.dice.below(2) == 0 {
                    // Another session with the fresh echo of the current one.
                    bytes[SESSION..SESSION + 4].fill_with(|| self.dice.byte());
                } else {
                    let value = [f64::NAN, f64::NEG_INFINITY, 1e300][self.dice.below(3)];
                    let place = self.numbers + 8 * self.dice.below(6);
                    bytes[place..place + 8].copy_from_slice(&value.to_le_bytes());
                }
                bytes
            }
        }
    }

    /// Returns a message received before.
    fn received(&mut self, is_due: bool) -> Vec<u8> {
        let count = self.taken.len() - usize::from(is_due);
        self.taken[self.dice.below(count)].clone()
    }
}

#[test]
fn promise_06_100000_wrong_messages_act_at_neither_end() {
    let [mut with, mut without] = [Ends::armed(), Ends::armed()];
    let (mut to_far, mut to_node) = (Forger::to_far(), Forger::to_node());
    to_far.taken.push(with.command(at(4), rate(at(4))));
    to_node.taken.push(with.feedback(at(4)));
    assert_eq!(without.command(at(4), rate(at(4))), to_far.taken[0]);
    assert_eq!(without.feedback(at(4)), to_node.taken[0]);
    for ends in [&mut with, &mut without] {
        ends.far.on_message(at(4) + OFFSET, &to_far.taken[0]);
        assert!(ends.node.on_message(at(4), &to_node.taken[0]).is_some());
    }
    for now in (5..5 + CYCLES).map(at) {
        let command = with.command(now, rate(now));
        assert_eq!(without.command(now, rate(now)), command);
        without.far.on_message(now + OFFSET, &command);
        to_far.flood(&command, |bytes| with.far.on_message(now + OFFSET, bytes));
        let motions = [&mut with, &mut without].map(|ends| ends.far.motion(now + OFFSET));
        assert_eq!(motions, [rate(now); 2]);
        let feedback = with.feedback(now);
        assert_eq!(without.feedback(now), feedback);
        let expected = without.node.on_message(now, &feedback).unwrap();
        let mut samples = Vec::new();
        to_node.flood(&feedback, |bytes| samples.extend(with.node.on_message(now, bytes)));
        assert_eq!(samples, [expected]);
    }
    assert_eq!((with.node.lost(), with.far.leader()), (0, (11, 1)));
    for (rejects, none) in
        [(with.far.rejects(), without.far.rejects()), (with.node.rejects(), without.node.rejects())]
    {
        assert_eq!(
            (rejects.iter().map(|(_, count)| count).sum::<u64>(), none.iter().count()),
            (100_000, 0)
        );
        for reason in [Reject::Length, Reject::Foreign, Reject::Impossible, Reject::Replayed] {
            assert!(rejects.get(reason) > 8_000, "{reason}: {rejects:?}");
        }
        assert!(rejects.get(Reject::NotLeader) > 5_000, "{rejects:?}");
    }
}

#[test]
fn hazard_37_corrupt_messages_break_no_start() {
    let [mut with, mut without] = [Ends::new(), Ends::new()];
    let (to_far, to_node) = (Forger::to_far(), Forger::to_node());
    // Each byte inverted in part, if that makes the message invalid.
    let corrupt = |forger: &Forger, message: &[u8]| {
        let all = (0..message.len()).map(|place| {
            let mut bytes = message.to_vec();
            bytes[place] ^= 0x40;
            bytes
        });
        all.filter(|bytes| (forger.head)(bytes).is_none()).collect::<Vec<_>>()
    };
    let mut count = 0;
    for now in (0..5).map(at) {
        let command = with.command(now, rate(now));
        let wrong = corrupt(&to_far, &command);
        wrong.iter().for_each(|bytes| with.far.on_message(now + OFFSET, bytes));
        count += wrong.len();
        with.far.on_message(now + OFFSET, &command);
        with.far.motion(now + OFFSET);
        let feedback = with.feedback(now);
        let wrong = corrupt(&to_node, &feedback);
        assert!(wrong.iter().all(|bytes| with.node.on_message(now, bytes).is_none()));
        count += wrong.len();
        let sample = with.node.on_message(now, &feedback);
        assert_eq!(without.exchange(now, rate(now)).1, sample);
    }
    assert!(count > 100, "{count}");
    assert_eq!((with.far.leader(), with.node.far_session()), ((11, 0), 22));
}
