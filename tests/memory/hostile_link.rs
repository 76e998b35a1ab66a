//! Hostile messages at the socket of a complete node that is engaged and in contact: its frames equal those of a run
//! without them, and the link counts each rejected message by its reason.

use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::rc::Rc;

use contract::{Echo, FarEnd, Feedback, Measurements, Pose, Reject};

use crate::common::linked::LINK;
use crate::common::prelude::*;
use crate::linked_node::{Network, Peer, ask, booted_with, cycles, engage};
use remote::link::LinkStatus;
use sim::random::SplitMix;

/// Cycles in which hostile messages are sent, of 1 ms.
const CYCLES: usize = 50_000;

/// Messages of each kind in a cycle: seven kinds and the two of the far side are the 16 that the link takes.
const OF_EACH_KIND: usize = 2;

/// Number of cycles for which a message is delayed, so that newer ones overtake it.
const HELD_FOR: usize = 20;

/// Large wrench that the operator would feel, in N and N·m.
const LOUD: Measurements = Measurements {
    wrench: Some([30.0, -30.0, 30.0, 1.0, 1.0, 1.0]),
    pose: Some(Pose { position: [0.5; 3], orientation: [0.0, 0.0, 0.0, 1.0] }),
    gripper: None,
};

// Offsets in a message, after its encapsulation header of four bytes (docs/link.md).
const VERSION: usize = 4 + 1;
const ARM: usize = 4 + 2;
const SESSION: Range<usize> = 4 + 8..4 + 16;
const ECHO: Range<usize> = 4 + 24..4 + 40;
const VALID: usize = 4 + 42;
const WRENCH: usize = 4 + 64;

/// Numbers of a Feedback: wrench, pose, gripper.
const NUMBERS: usize = 15;

/// Values that no field may have.
const NOT_POSSIBLE: [f64; 4] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300];

/// Counts of messages by the reason for which they must have no effect.
type Counts = BTreeMap<u8, u64>;

/// Sender of hostile messages behind the socket of the far side.
struct Sender {
    random: SplitMix,
    sent: Rc<RefCell<Counts>>,
    /// Feedback of the far side that the node has received: the first ones, of free space, and the newest.
    old: Vec<Vec<u8>>,
    recent: VecDeque<Vec<u8>>,
    /// Messages that are overtaken.
    held: VecDeque<Vec<u8>>,
}

impl Sender {
    fn new(sent: &Rc<RefCell<Counts>>) -> Self {
        Self {
            random: SplitMix::new(37),
            sent: Rc::clone(sent),
            old: Vec::new(),
            recent: VecDeque::new(),
            held: VecDeque::new(),
        }
    }

    /// Returns a number below `count`.
    fn below(&mut self, count: usize) -> usize {
        usize::try_from(self.random.bits() % u64::try_from(count).unwrap()).unwrap()
    }

    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        std::array::from_fn(|_| self.random.bits().to_le_bytes()[0])
    }

    /// Adds a message, and counts it.
    fn add(&self, to: &mut Vec<Vec<u8>>, message: Vec<u8>, reason: Reject) {
        *self.sent.borrow_mut().entry(reason.code()).or_default() += 1;
        to.push(message);
    }

    /// Mixes messages of all seven kinds with those of the far side.
    fn mix(&mut self, now: Instant, far: &mut FarEnd, own: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
        self.remember(&own);
        let mut hostile = Vec::new();
        for _ in 0..OF_EACH_KIND {
            self.add_truncated(&mut hostile, &own);
            self.add_random(&mut hostile);
            self.add_replayed(&mut hostile);
            self.add_overtaken(&mut hostile, &far.feedback(now, &LOUD));
            let loud = loudened(&own);
            self.add_other_session(&mut hostile, &loud);
            self.add_other_arm(&mut hostile, &loud);
            self.add_impossible(&mut hostile, far.feedback(now, &LOUD).to_vec());
        }
        for place in (1..hostile.len()).rev() {
            let other = self.below(place + 1);
            hostile.swap(place, other);
        }
        let place = self.below(hostile.len() + 1);
        hostile.splice(place..place, own);
        hostile
    }

    /// Sends authentic messages behind those of the far side whose echoes cannot be.
    fn echo(&mut self, now: Instant, far: &mut FarEnd, own: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
        let fresh = echo_of(&loudened(&own));
        let mut all = own;
        for _ in 0..7 * OF_EACH_KIND {
            let mut message = far.feedback(now, &LOUD).to_vec();
            let (echo, reason) = self.echo_that_cannot_be(fresh);
            set_echo(&mut message, echo);
            self.add(&mut all, message, reason);
        }
        all
    }

    /// Stores the messages that the node receives, to send them again.
    fn remember(&mut self, own: &[Vec<u8>]) {
        if self.old.len() < 200 {
            self.old.extend_from_slice(own);
        }
        self.recent.extend(own.iter().cloned());
        while self.recent.len() > 200 {
            self.recent.pop_front();
        }
    }

    fn add_truncated(&mut self, to: &mut Vec<Vec<u8>>, own: &[Vec<u8>]) {
        let whole = &own[self.below(own.len())];
        let length = self.below(whole.len());
        let reason = if length < 4 { Reject::Foreign } else { Reject::Length };
        self.add(to, whole[..length].to_vec(), reason);
    }

    /// Adds random bytes: half of them behind an encapsulation header, and half of those of this version.
    fn add_random(&mut self, to: &mut Vec<Vec<u8>>) {
        let mut bytes = self.bytes::<600>().to_vec();
        bytes.truncate(self.below(600));
        if self.below(2) == 0 && bytes.len() >= 6 {
            bytes[..4].copy_from_slice(&[0, 1, 0, 0]);
            bytes[VERSION] = [1, bytes[VERSION]][self.below(2)];
        }
        let reason = match bytes.as_slice() {
            // Feedback or Capability of this version, of another length.
            [0, 1, 0, 0, 2 | 3, 1, ..] => Reject::Length,
            [0, 1, 0, 0, _, 1, ..] => Reject::Foreign,
            [0, 1, 0, 0, _, _, ..] => Reject::Version,
            _ => Reject::Foreign,
        };
        self.add(to, bytes, reason);
    }

    fn add_replayed(&mut self, to: &mut Vec<Vec<u8>>) {
        let (from_old, old, recent) =
            (self.below(2) == 0, self.below(self.old.len()), self.below(self.recent.len()));
        let message = if from_old { &self.old[old] } else { &self.recent[recent] };
        self.add(to, message.clone(), Reject::Replayed);
    }

    /// Delays a message of the far side, and adds the one whose delay has elapsed.
    fn add_overtaken(&mut self, to: &mut Vec<Vec<u8>>, message: &[u8]) {
        self.held.push_back(message.to_vec());
        if self.held.len() > OF_EACH_KIND * HELD_FOR {
            let message = self.held.pop_front().unwrap();
            self.add(to, message, Reject::Overtaken);
        }
    }

    /// Adds a message of a session that is not current: with a fresh echo, without one, and with echoes that cannot be.
    fn add_other_session(&mut self, to: &mut Vec<Vec<u8>>, loud: &[u8]) {
        let mut message = loud.to_vec();
        message[SESSION].copy_from_slice(&(self.random.bits() | 1).to_le_bytes());
        let fresh = echo_of(loud);
        let echo = [fresh, Echo::NONE, self.echo_that_cannot_be(fresh).0][self.below(3)];
        set_echo(&mut message, echo);
        self.add(to, message, Reject::NotLeader);
    }

    fn add_other_arm(&mut self, to: &mut Vec<Vec<u8>>, loud: &[u8]) {
        let mut message = loud.to_vec();
        let (place, reason) = [(ARM, Reject::Arm), (VERSION, Reject::Version)][self.below(2)];
        message[place] ^= u8::try_from(1 + self.below(255)).unwrap();
        self.add(to, message, reason);
    }

    /// Adds an authentic message in which a value that counts is NaN, infinite or out of range.
    fn add_impossible(&mut self, to: &mut Vec<Vec<u8>>, mut message: Vec<u8>) {
        // All values count.
        message[VALID] = 7;
        let value = NOT_POSSIBLE[self.below(NOT_POSSIBLE.len())];
        let place = WRENCH + 8 * self.below(NUMBERS);
        message[place..place + 8].copy_from_slice(&value.to_le_bytes());
        self.add(to, message, Reject::Impossible);
    }

    /// Returns an echo of another session, of a message never sent, or of an old one.
    fn echo_that_cannot_be(&mut self, fresh: Echo) -> (Echo, Reject) {
        let Echo { session, sequence } = fresh;
        let next = sequence + 1 + self.random.bits() % 1_000;
        [
            (Echo { session: self.random.bits() | 1, sequence }, Reject::Session),
            (Echo::NONE, Reject::Session),
            (Echo { session, sequence: 0 }, Reject::NeverSent),
            (Echo { session, sequence: next }, Reject::NeverSent),
            (Echo { session, sequence: u64::MAX }, Reject::NeverSent),
            (Echo { session, sequence: 1 }, Reject::Old),
            // 150 ms ago.
            (Echo { session, sequence: sequence - 150 }, Reject::Old),
        ][self.below(7)]
    }
}

/// Returns the feedback message among `own`, with the wrench of [`LOUD`].
fn loudened(own: &[Vec<u8>]) -> Vec<u8> {
    let mut message = own.iter().find(|one| one.len() == Feedback::LENGTH).unwrap().clone();
    for (place, number) in LOUD.wrench.unwrap().into_iter().enumerate() {
        let place = WRENCH + 8 * place;
        message[place..place + 8].copy_from_slice(&number.to_le_bytes());
    }
    message
}

fn echo_of(message: &[u8]) -> Echo {
    Feedback::decode(message).unwrap().head.echo
}

fn set_echo(message: &mut [u8], Echo { session, sequence }: Echo) {
    let bytes = [session, sequence].map(u64::to_le_bytes).concat();
    message[ECHO].copy_from_slice(&bytes);
}

/// Frames, newest record and link of a node that was engaged and in contact.
struct Run {
    frames: Vec<(Instant, Telegram)>,
    record: Record,
    status: LinkStatus,
}

/// Runs a node from its arming on, with this peer at its socket.
fn run(count: usize, peer: Option<Peer>) -> Run {
    let wire = Wire::default();
    let (mut node, handle) = booted_with("kraft_like", LINK, Network::default(), wire.clone());
    assert_eq!(ask(&mut node, Request::Arm), Ok(Mode::Armed));
    cycles(&mut node, 200);
    *handle.peer.borrow_mut() = peer;
    let record = cycles(&mut node, count);
    *handle.peer.borrow_mut() = None;
    // The figures are those of the period before.
    cycles(&mut node, 2);
    let status = node.remote().thread.latest().get();
    assert_eq!((node.cause(), handle.unsent.get()), (None, 0));
    Run { frames: wire.all(), record, status }
}

/// Asserts that hostile messages changed no frame, and that each was counted by its reason.
fn have_no_effect(without: &Run, with: &Run, sent: &Counts) {
    let force = with.record.output.f_g_task.force.norm();
    assert_eq!((with.record.mode, force > 1.0), (Mode::Engaged, true), "{force} N");
    assert_eq!(with.frames.len(), without.frames.len());
    let differ = with.frames.iter().zip(&without.frames).find(|(with, without)| with != without);
    assert_eq!(differ, None);
    assert_eq!((without.status.rejects.as_slice(), without.status.lost), (&[][..], 0));
    let counted: Counts =
        with.status.rejects.iter().map(|(reason, count)| (reason.code(), *count)).collect();
    assert_eq!(&counted, sent);
}

#[test]
fn promise_06_and_hazard_37_100000_of_each_kind_change_no_frame() {
    let sent = Rc::default();
    let mut sender = Sender::new(&sent);
    let count = CYCLES + HELD_FOR;
    let with = run(count, Some(Box::new(move |now, far, own| sender.mix(now, far, own))));
    let sent = sent.take();
    let of = |reason: Reject| sent[&reason.code()];
    for reason in [Reject::Replayed, Reject::Overtaken, Reject::NotLeader, Reject::Impossible] {
        assert!(of(reason) >= 100_000, "{reason}: {sent:?}");
    }
    assert!(sent.values().sum::<u64>() >= 700_000, "{sent:?}");
    have_no_effect(&run(count, None), &with, &sent);
    // Authentic ones that are not taken, and those still held back.
    let missing = u64::try_from(OF_EACH_KIND * HELD_FOR).unwrap();
    assert_eq!(with.status.lost, of(Reject::Impossible) + missing);
}

#[test]
fn hazard_37_echoes_that_cannot_be_change_no_frame() {
    let sent = Rc::default();
    let mut sender = Sender::new(&sent);
    let with = run(4_000, Some(Box::new(move |now, far, own| sender.echo(now, far, own))));
    let sent = sent.take();
    have_no_effect(&run(4_000, None), &with, &sent);
    assert_eq!((with.status.lost, sent.len()), (0, 3));
}

/// Floods the connection of a far side, behind its feedback or before it; returns the greatest age at which a sample acted,
/// in s, and the cause of a stop. Afterwards the node is reset.
fn flooded(max_age: u32, is_behind: bool) -> (f64, Option<Cause>) {
    let keys = format!(
        "round_trip_ms = {max_age}.0\nmax_age_ms = {max_age}.0\nstiffest_contact_n_per_m = 20.0"
    );
    let (mut node, handle) = booted_with("kraft_like", &keys, Network::default(), ());
    handle.writes_its_time.set(true);
    handle.reads_once.set(true);
    engage(&mut node);
    *handle.peer.borrow_mut() = Some(Box::new(move |_, _, own| {
        let flood = vec![vec![7; 40]; 50];
        if is_behind { [own, flood].concat() } else { [flood, own].concat() }
    }));
    let mut oldest = 0.0_f64;
    for _ in 0..2_000 {
        let record = node.cycle();
        if record.mode == Mode::Engaged {
            let now = record.at.since(Instant::ZERO).as_secs_f64();
            oldest = oldest.max(now - record.f_s.force.x);
        }
    }
    let cause = node.cause();
    *handle.peer.borrow_mut() = None;
    // What waits in the queue is taken 16 at a time.
    cycles(&mut node, 50);
    let expected = cause.map_or(Mode::Engaged, |_| Mode::Armed);
    let mode = cause.map_or(Ok(node.mode()), |_| ask(&mut node, Request::Reset));
    cycles(&mut node, 10);
    assert_eq!((mode, node.cause()), (Ok(expected), None));
    let rejects = node.remote().thread.latest().get().rejects;
    assert!(matches!(rejects[..], [(Reject::Foreign, 30_000..=33_000)]), "{rejects:?}");
    (oldest, cause)
}

#[test]
fn flood_of_50000_a_second_leaves_only_fresh_samples() {
    let (oldest, cause) = flooded(100, true);
    assert!(oldest <= 50e-3 && cause.is_none(), "{oldest} s, {cause:?}");
    let (oldest, cause) = flooded(20, false);
    assert!(oldest <= 22e-3 && cause == Some(Cause::LinkLost), "{oldest} s, {cause:?}");
}
