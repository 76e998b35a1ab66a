//! Tests of sessions that are recorded, replaced, restarted, and forged in great number.

use proptest::prelude::*;

use super::{ARM, Dice, Ends, HOLD_AFTER, OFFSET, UnderWay, at, force, rate, send};
use crate::head::{Echo, Head};
use crate::{Command, FarEnd, Feedback, Measurements, Motion, NodeEnd, Reason, Reject};
use units::time::Instant;

/// Returns a command of any session.
fn command_of(own: Echo, echo: Echo) -> Vec<u8> {
    let head = Head { arm: ARM, epoch: 1, own, echo };
    let motion = Motion::Rate([9.0; 6]);
    Command { head, motion, is_engaged: true, asks_capability: false, gripper: None }
        .encode()
        .to_vec()
}

/// Returns a feedback of any session.
fn feedback_of(own: Echo, echo: Echo) -> Vec<u8> {
    let head = Head { arm: ARM, epoch: 1, own, echo };
    let measured = Measurements { wrench: Some([9.0; 6]), ..Measurements::default() };
    let (reason, obeyed_session, acted_sequence) = (Reason::None, 11, 1);
    Feedback { head, reason, obeyed_session, acted_sequence, measured }.encode().to_vec()
}

/// Messages of 500 ms, to the far side and to the node.
type Recording = [Vec<Vec<u8>>; 2];

/// Returns both ends 500 ms after the start of both sessions, and all messages.
fn recorded() -> (Ends, Recording) {
    let (mut ends, mut recording) = (Ends::new(), Recording::default());
    for ms in 0..500 {
        let command = ends.command(at(ms), rate(at(ms)));
        ends.far.on_message(at(ms) + OFFSET, &command);
        ends.far.motion(at(ms) + OFFSET);
        let feedback = ends.feedback(at(ms));
        ends.node.on_message(at(ms), &feedback);
        recording[0].push(command);
        recording[1].push(feedback);
        if ms == 5 {
            ends.node.begin_epoch();
        }
    }
    assert_eq!((ends.far.leader(), ends.far.reason()), ((11, 1), Reason::None));
    (ends, recording)
}

/// Inserts a message among twenty recorded ones.
fn among(recording: &[Vec<u8>], message: &[u8], dice: &mut Dice) -> Vec<Vec<u8>> {
    let mut all: Vec<_> = (0..20).map(|_| recording[dice.below(recording.len())].clone()).collect();
    all.insert(dice.below(21), message.to_vec());
    all
}

/// Restarts ends, and sends recorded messages beside those of the new sessions, which alone must be accepted.
fn replayed_beside(start: u64, new_node: bool, new_far: bool) {
    let case = (start, new_node, new_far);
    let (mut ends, [commands, feedbacks]) = recorded();
    let mut dice = Dice(start);
    if new_node {
        ends.node = NodeEnd::new(ARM, 33);
    }
    if new_far {
        ends.far = FarEnd::new(ARM, 44, HOLD_AFTER);
    }
    let (mut followed, mut felt) = (0, 0);
    for ms in start..start + 600 {
        let (now, fars) = (at(ms), at(ms) + OFFSET);
        if ms == start + 300 {
            ends.node.begin_epoch();
        }
        let command = ends.command(now, rate(now));
        let messages = among(&commands, &command, &mut dice);
        messages.iter().for_each(|message| ends.far.on_message(fars, message));
        let performed = ends.far.motion(fars);
        // The last command of the former session is effective until its echo, of 498 ms, is too old.
        let is_last = ms <= 598 && performed == rate(at(499));
        let is_new = ms >= start + 300 && performed == rate(now);
        assert!(performed == Motion::Hold || is_last || is_new, "{case:?}, {ms} ms");
        followed += u64::from(is_new);
        let feedback = ends.feedback(now);
        for message in among(&feedbacks, &feedback, &mut dice) {
            let Some(sample) = ends.node.on_message(now, &message) else { continue };
            assert_eq!(sample.feedback.measured.wrench, Some(force(now)), "{case:?}, {ms} ms");
            felt += 1;
        }
    }
    assert!(followed > 250 && felt > 300, "{case:?}: {followed}, {felt}");
}

#[test]
fn hazard_37_recorded_session_never_acts_in_a_later_one() {
    for start in [500, 700] {
        replayed_beside(start, true, true);
        replayed_beside(start, true, false);
        replayed_beside(start, false, true);
    }
}

#[test]
fn hazard_37_recorded_start_begins_no_session() {
    let (silent, [commands, feedbacks]) = recorded();
    let fresh = Ends { node: NodeEnd::new(ARM, 33), far: FarEnd::new(ARM, 44, HOLD_AFTER) };
    for (mut ends, sessions) in [(silent, (11, 22)), (fresh, (0, 0))] {
        for (ms, (command, feedback)) in (800..).zip(commands.iter().zip(&feedbacks)) {
            ends.far.on_message(at(ms) + OFFSET, command);
            assert_eq!(ends.far.motion(at(ms) + OFFSET), Motion::Hold);
            assert_eq!(ends.node.on_message(at(ms), feedback), None);
            assert_eq!((ends.far.leader().0, ends.node.far_session()), sessions);
        }
    }
}

proptest! {
    #[test]
    fn hazard_37_fresh_session_is_never_replaced(
        steps in prop::collection::vec((0..70_u64, 0..3_u8), 1..100),
    ) {
        let mut ends = Ends::armed();
        // Send times of the newest echo at each end, after an exchange at 3 ms; the far side's is of the one before.
        let (mut far_echo, mut node_echo, mut before, mut now) = (at(2), at(3), at(3), at(3));
        for (number, (gap, kind)) in (1..).zip(steps) {
            now = now + std::time::Duration::from_millis(gap);
            if kind > 0 {
                ends.exchange(now, Motion::Hold);
                far_echo = if now.since(before) <= HOLD_AFTER { before } else { far_echo };
                (node_echo, before) = (now, now);
                continue;
            }
            // Strangers echo the newest message, as the other end would.
            let newest = Feedback::decode(&ends.feedback(now)).unwrap().head.own;
            let stranger = command_of(Echo { session: 33, sequence: number }, newest);
            ends.far.on_message(now + OFFSET, &stranger);
            let newest = Command::decode(&ends.command(now, Motion::Hold)).unwrap().head.own;
            let stranger = feedback_of(Echo { session: 44, sequence: number }, newest);
            let sample = ends.node.on_message(now, &stranger);
            let [far_kept, node_kept] = [far_echo, node_echo].map(|at| now.since(at) <= HOLD_AFTER);
            prop_assert_eq!(ends.far.leader().0, if far_kept { 11 } else { 33 });
            prop_assert_eq!(ends.node.far_session(), if node_kept { 22 } else { 44 });
            prop_assert_eq!(sample.is_none(), node_kept);
            prop_assert_eq!(ends.far.motion(now + OFFSET), Motion::Hold);
            if !(far_kept && node_kept) {
                return Ok(());
            }
        }
    }
}

#[test]
fn hazard_37_flood_of_first_messages_moves_nothing() {
    let mut ends = Ends::armed();
    // 300 ms of silence, after which another session could become current.
    for session in 100..100_100 {
        let own = Echo { session, sequence: 1 };
        ends.far.on_message(at(303) + OFFSET, &command_of(own, Echo::NONE));
        assert_eq!(ends.node.on_message(at(303), &feedback_of(own, Echo::NONE)), None);
    }
    assert_eq!(ends.far.motion(at(303) + OFFSET), Motion::Hold);
    assert_eq!((ends.far.leader(), ends.node.far_session()), ((11, 1), 22));
    (304..308).for_each(|ms| _ = ends.exchange(at(ms), Motion::Hold));
    ends.node.begin_epoch();
    let (performed, sample) = ends.exchange(at(308), rate(at(308)));
    assert_eq!((performed, sample.is_some()), (rate(at(308)), true), "the peer gets through");
}

#[test]
fn hazard_37_sessions_that_an_end_remembers_are_bounded() {
    let mut ends = Ends::armed();
    let mut led = 0;
    for session in 100..5_000 {
        // Each has a fresh echo, after 101 ms of silence of its predecessor.
        let now = at(101 * session);
        let newest = Feedback::decode(&ends.feedback(now)).unwrap().head.own;
        let own = Echo { session, sequence: 1 };
        ends.far.on_message(now + OFFSET, &command_of(own, newest));
        led += u64::from(ends.far.leader().0 == session);
        assert_eq!(ends.far.motion(now + OFFSET), Motion::Hold);
    }
    assert_eq!((led, ends.far.rejects().get(Reject::Left)), (4_096, 4_900 - 4_096));
}

/// Network that delays, reorders, loses and duplicates messages.
struct Network {
    way: UnderWay,
    dice: Dice,
}

impl Network {
    fn new(seed: u64) -> Self {
        Self { way: UnderWay::new(), dice: Dice(seed) }
    }

    /// Sends a message; returns the arrivals: up to 44 ms late, a fifth lost, half of them twice.
    fn carry(&mut self, ms: u64, message: &[u8]) -> Vec<Vec<u8>> {
        let [delay, lost, copies] = [23, 5, 2].map(|count| self.dice.below(count));
        let fate = [delay, lost, 1 + copies].map(|one| u64::try_from(one).unwrap());
        send(&mut self.way, ms, message, fate);
        self.way.remove(&ms).unwrap_or_default()
    }
}

/// Runs both ends over a network with a new epoch every 250 ms; returns the numbers of followed commands and of samples.
fn run(ends: &mut Ends, [there, back]: [&mut Network; 2], span: std::ops::Range<u64>) -> [u64; 2] {
    let [mut followed, mut felt] = [0; 2];
    let newest = |sampled: Instant, now: Instant| now.since(sampled) <= HOLD_AFTER;
    for ms in span {
        if ms % 250 == 249 {
            ends.node.begin_epoch();
        }
        let command = ends.command(at(ms), rate(at(ms)));
        for message in there.carry(ms, &command) {
            ends.far.on_message(at(ms) + OFFSET, &message);
        }
        followed += u64::from(ends.far.motion(at(ms) + OFFSET) != Motion::Hold);
        let feedback = ends.feedback(at(ms));
        for message in back.carry(ms, &feedback) {
            let Some(sample) = ends.node.on_message(at(ms), &message) else { continue };
            assert!(newest(sample.at, at(ms)));
            felt += 1;
        }
    }
    [followed, felt]
}

#[test]
fn hazard_34_link_recovers_from_losses_and_any_restart() {
    for seed in 0..4 {
        let (mut there, mut back) = (Network::new(seed), Network::new(seed + 100));
        let mut ends = Ends::new();
        for (span, new_node, new_far) in
            [(0, false, false), (1, false, true), (2, true, false), (3, true, true)]
        {
            // Messages in transit are of the former sessions.
            if new_node {
                ends.node = NodeEnd::new(ARM, 1_000 + span);
            }
            if new_far {
                ends.far = FarEnd::new(ARM, 2_000 + span, HOLD_AFTER);
            }
            let span = 3_000 * span..3_000 * (span + 1);
            let counts = run(&mut ends, [&mut there, &mut back], span.clone());
            assert!(counts.iter().all(|count| *count > 500), "seed {seed}, {span:?}: {counts:?}");
        }
    }
}
