//! Properties of the link: both sides together, with an attacker between them.

use std::time::Duration;

use nalgebra::{Isometry3, Vector3};
use proptest::prelude::*;

use crate::datagram::{Content, HEADER, LENGTH, PLAIN, Payload};
use crate::handshake::{INITIATION, Keys, Pair, RESPONSE};
use crate::initiator::Initiator;
use crate::reject::Reject;
use crate::responder::{COOKIE_REPLY, Outcome, Responder};
use crate::session::Received;
use units::spatial::{Motion, Twist, Wrench};
use units::time::Instant;

const HERE: &[u8] = b"192.0.2.1:7447";
const HOLD: Content = Content::Command(Motion::Hold);

fn at(millis: u64) -> Instant {
    Instant::from_micros(millis * 1_000)
}

/// Returns a sample that encodes its time.
fn taken(at: Instant) -> Content {
    let force = Vector3::new(at.since(Instant::ZERO).as_secs_f64() * 1_000.0, 0.0, 0.0);
    Content::Sample { f_s: Wrench { force, ..Wrench::ZERO }, x_b_m: Isometry3::identity() }
}

/// Returns the time that such a sample encodes, in ms.
fn sample_time(received: &Received) -> f64 {
    let Content::Sample { f_s, .. } = received.content else { panic!("{received:?}") };
    f_s.force.x
}

/// Returns both sides with each other's keys.
fn peers() -> (Initiator, Responder) {
    let (node, robot) = (Pair::generate().unwrap(), Pair::generate().unwrap());
    let node_keys = Keys { secret: node.secret, peer: robot.public };
    let robot_keys = Keys { secret: robot.secret, peer: node.public };
    (Initiator::new(node_keys, 0), Responder::new(robot_keys, [3; 32]))
}

/// Returns the initiation with its cookie.
fn initiation(node: &mut Initiator, robot: &mut Responder, now: Instant) -> [u8; INITIATION] {
    let first = node.on_time(now).unwrap();
    let Outcome::Cookie(cookie) = robot.on_datagram(now, HERE, &first) else { panic!("no cookie") };
    assert_eq!(node.on_datagram(now, &cookie), None);
    node.on_time(now).unwrap()
}

/// Runs the handshake, and starts the session at the robot.
fn connect(node: &mut Initiator, robot: &mut Responder, now: Instant) {
    node.begin(now).unwrap();
    let initiation = initiation(node, robot, now);
    let Outcome::Response(response) = robot.on_datagram(now, HERE, &initiation) else {
        panic!("no response")
    };
    assert_eq!(node.on_datagram(now, &response), None);
    let first = command(node, now, false);
    assert_eq!(robot.on_datagram(now, HERE, &first), Outcome::Nothing, "no echo yet");
    assert_eq!(robot.session().unwrap().epoch(), node.session().unwrap().epoch());
    let sample = sample(robot, now);
    assert!(node.on_datagram(now, &sample).is_some());
}

fn connected() -> (Initiator, Responder) {
    let (mut node, mut robot) = peers();
    connect(&mut node, &mut robot, at(0));
    (node, robot)
}

fn command(node: &mut Initiator, now: Instant, armed: bool) -> [u8; LENGTH] {
    let session = node.session().unwrap();
    session.seal(session.stamp(now), armed, HOLD).unwrap()
}

fn sample(robot: &mut Responder, now: Instant) -> [u8; LENGTH] {
    let session = robot.session().unwrap();
    session.seal(session.stamp(now), false, taken(now)).unwrap()
}

/// Returns all of a session's state but its keys.
fn state(robot: &mut Responder) -> String {
    format!("{:?}", robot.session())
}

/// A reproducible generator (Knuth's MMIX).
struct Dice(u64);

impl Dice {
    fn roll(&mut self, sides: u64) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % sides
    }

    fn byte(&mut self) -> u8 {
        u8::try_from(self.roll(256)).unwrap()
    }

    fn place(&mut self, length: usize) -> usize {
        usize::try_from(self.roll(u64::try_from(length).unwrap())).unwrap()
    }
}

#[test]
fn promise_06_100000_forged_datagrams_have_no_effect() {
    let (mut node, mut robot) = connected();
    let mut dice = Dice(37);
    let genuine: Vec<_> = (1..200).map(|now| command(&mut node, at(now), true)).collect();
    for (now, bytes) in (1..).zip(&genuine) {
        robot.on_datagram(at(now), HERE, bytes);
    }
    let received = sample(&mut robot, at(199));
    node.on_datagram(at(199), &received);
    let unsent: Vec<_> = (200..400).map(|now| command(&mut node, at(now), true)).collect();
    let (before, rejected) = (state(&mut robot), robot.rejects().total());
    for round in 0..100_000_u64 {
        let forged: Vec<u8> = match round % 4 {
            // Random bytes.
            0 => (0..dice.roll(200)).map(|_| dice.byte()).collect(),
            // A datagram sent before.
            1 => genuine[dice.place(genuine.len())].to_vec(),
            // A datagram not sent yet, with a bit inverted.
            2 => {
                let mut bytes = unsent[dice.place(unsent.len())].to_vec();
                bytes[dice.place(LENGTH)] ^= 1 << dice.roll(8);
                bytes
            }
            // With another counter, or truncated, or longer.
            _ => {
                let mut bytes = unsent[dice.place(unsent.len())].to_vec();
                bytes[HEADER + dice.place(8)] = bytes[HEADER].wrapping_add(dice.byte().max(1));
                bytes.resize(LENGTH - 3 + dice.place(7), 0);
                bytes
            }
        };
        if unsent.iter().any(|bytes| bytes[..] == forged[..]) {
            continue;
        }
        assert_eq!(robot.on_datagram(at(250), HERE, &forged), Outcome::Nothing);
        if round % 100 == 0 {
            assert_eq!(state(&mut robot), before);
        }
    }
    assert_eq!(state(&mut robot), before);
    assert!(robot.rejects().total() - rejected > 99_000, "each is counted: {:?}", robot.rejects());
    assert!(
        robot.rejects().of(Reject::Tag) > 20_000 && robot.rejects().of(Reject::Replayed) > 20_000
    );
    let received = unsent.iter().filter(|bytes| {
        matches!(robot.on_datagram(at(250), HERE, &bytes[..]), Outcome::Command(_))
    });
    assert_eq!(received.count(), unsent.len(), "the peer's datagrams are accepted as before");
}

#[test]
fn hazard_37_recorded_session_is_rejected_in_the_next() {
    let (mut node, mut robot) = connected();
    let recorded: Vec<_> = (1..20).map(|now| command(&mut node, at(now), true)).collect();
    connect(&mut node, &mut robot, at(500));
    let before = state(&mut robot);
    for mut bytes in recorded {
        assert_eq!(robot.on_datagram(at(501), HERE, &bytes), Outcome::Nothing);
        bytes[8..16].copy_from_slice(&2_u64.to_le_bytes());
        assert_eq!(robot.on_datagram(at(501), HERE, &bytes), Outcome::Nothing);
    }
    assert_eq!((robot.rejects().of(Reject::Epoch), robot.rejects().of(Reject::Tag)), (19, 19));
    assert_eq!(state(&mut robot), before);
}

#[test]
fn hazard_37_armed_active_session_is_not_replaced() {
    let (mut node, mut robot) = connected();
    let sample = sample(&mut robot, at(10));
    node.on_datagram(at(10), &sample);
    let armed = command(&mut node, at(10), true);
    assert!(matches!(robot.on_datagram(at(10), HERE, &armed), Outcome::Command(_)));

    node.begin(at(20)).unwrap();
    let asked = initiation(&mut node, &mut robot, at(20));
    assert_eq!(robot.on_datagram(at(110), HERE, &asked), Outcome::Nothing);
    assert_eq!((robot.rejects().of(Reject::InUse), robot.session().unwrap().epoch()), (1, 1));
    let outcome = robot.on_datagram(at(111), HERE, &asked);
    assert!(matches!(outcome, Outcome::Response(_)), "inactive for more than 100 ms");
    assert_eq!(robot.session().unwrap().epoch(), 1, "not before the peer has used it");
}

#[test]
fn hazard_37_replayed_initiation_never_starts_a_session() {
    let (mut node, mut robot) = peers();
    node.begin(at(0)).unwrap();
    let recorded = initiation(&mut node, &mut robot, at(0));
    let Outcome::Response(response) = robot.on_datagram(at(0), HERE, &recorded) else { panic!() };
    node.on_datagram(at(0), &response);
    let first = command(&mut node, at(0), false);
    robot.on_datagram(at(0), HERE, &first);
    let before = state(&mut robot);
    assert!(matches!(robot.on_datagram(at(300), HERE, &recorded), Outcome::Response(_)));
    assert_eq!(state(&mut robot), before);
    let next = command(&mut node, at(301), false);
    robot.on_datagram(at(301), HERE, &next);
    assert_ne!(state(&mut robot), before, "the present session continues");
}

#[test]
fn hazard_37_flood_of_initiations_has_bounded_cost() {
    let (mut node, mut robot) = connected();
    let before = state(&mut robot);
    let mut dice = Dice(1);
    node.begin(at(1)).unwrap();
    let genuine = initiation(&mut node, &mut robot, at(1));
    for round in 0..2_000_u64 {
        let address = dice.roll(1 << 30).to_le_bytes();
        let outcome = robot.on_datagram(at(2), &address, &genuine);
        assert!(matches!(outcome, Outcome::Cookie(_)), "{round}: a cookie is one address's");
    }
    let mut forged = genuine;
    forged[HEADER] ^= 1;
    for _ in 0..100 {
        assert_eq!(robot.on_datagram(at(3), HERE, &forged), Outcome::Nothing);
    }
    assert_eq!((robot.rejects().of(Reject::Tag), robot.rejects().of(Reject::Busy)), (7, 93));
    assert_eq!(state(&mut robot), before);
    let later = robot.on_datagram(at(1_100), HERE, &genuine);
    assert!(matches!(later, Outcome::Response(_)), "the peer gets through afterwards");
}

#[test]
fn responses_are_no_longer_than_their_requests() {
    const { assert!(COOKIE_REPLY <= INITIATION && RESPONSE <= INITIATION) }
}

#[test]
fn hazard_37_forged_responses_do_not_break_a_handshake() {
    let (mut node, mut robot) = peers();
    node.begin(at(0)).unwrap();
    let first = node.on_time(at(0)).unwrap();
    let Outcome::Cookie(cookie) = robot.on_datagram(at(0), HERE, &first) else { panic!() };
    let mut forged = cookie;
    forged[HEADER] ^= 1;
    node.on_datagram(at(0), &forged);
    assert_eq!(node.on_time(at(0)), None, "a response needs the initiation");
    node.on_datagram(at(0), &cookie);
    let second = node.on_time(at(0)).unwrap();
    let Outcome::Response(response) = robot.on_datagram(at(0), HERE, &second) else { panic!() };
    for place in HEADER..RESPONSE {
        let mut forged = response;
        forged[place] ^= 0x40;
        assert_eq!(node.on_datagram(at(0), &forged), None);
        assert!(node.session().is_none());
    }
    node.on_datagram(at(0), &response);
    assert!(node.session().is_some());
    let answer = command(&mut node, at(1), false);
    robot.on_datagram(at(1), HERE, &answer);
    assert!(robot.session().is_some());
}

#[test]
fn hazard_37_only_the_peer_gets_a_session() {
    let (mut node, _) = peers();
    let (_, mut other) = peers();
    node.begin(at(0)).unwrap();
    let asked = initiation(&mut node, &mut other, at(0));
    assert_eq!(
        other.on_datagram(at(0), HERE, &asked),
        Outcome::Nothing,
        "addressed to another robot"
    );

    // Has the robot's public key, but not the static key that the robot expects.
    let (robots, own) = (Pair::generate().unwrap(), Pair::generate().unwrap());
    let keys = Keys { secret: robots.secret, peer: Pair::generate().unwrap().public };
    let mut robot = Responder::new(keys, [3; 32]);
    let mut intruder = Initiator::new(Keys { secret: own.secret, peer: robots.public }, 0);
    intruder.begin(at(0)).unwrap();
    let asked = initiation(&mut intruder, &mut robot, at(0));
    assert_eq!(robot.on_datagram(at(0), HERE, &asked), Outcome::Nothing);
    assert_eq!(robot.rejects().of(Reject::Tag), 1);
    assert!(robot.session().is_none());
}

/// A network that loses, delays, shuffles and duplicates datagrams.
struct Network {
    under_way: Vec<(Instant, Vec<u8>)>,
    dice: Dice,
    longest: u64,
}

impl Network {
    fn new(seed: u64, longest: u64) -> Self {
        Self { under_way: Vec::new(), dice: Dice(seed), longest }
    }

    fn send(&mut self, now: Instant, bytes: &[u8]) {
        let copies = match self.dice.roll(10) {
            0 => 0,
            1 => 2,
            _ => 1,
        };
        for _ in 0..copies {
            let delay = Duration::from_millis(self.dice.roll(self.longest + 1));
            self.under_way.push((now + delay, bytes.to_vec()));
        }
    }

    fn arrived(&mut self, now: Instant) -> Vec<Vec<u8>> {
        let under_way = std::mem::take(&mut self.under_way).into_iter();
        let (arrived, under_way) = under_way.partition(|(due, _)| *due <= now);
        self.under_way = under_way;
        let arrived: Vec<(Instant, Vec<u8>)> = arrived;
        arrived.into_iter().map(|(_, bytes)| bytes).collect()
    }
}

#[test]
fn hazard_36_samples_act_once_in_order_with_a_bounded_age() {
    // The robot's clock is an hour ahead of the node's.
    let robots = |now: Instant| now + Duration::from_secs(3_600);
    for (seed, longest) in [(1, 0), (2, 5), (3, 40), (4, 90), (5, 300)] {
        let (mut node, mut robot) = peers();
        connect(&mut node, &mut robot, at(0));
        let (mut there, mut back) = (Network::new(seed, longest), Network::new(seed + 50, longest));
        let (mut felt, mut last) = (0, f64::MIN);
        for now in (1..3_000).map(at) {
            there.send(now, &command(&mut node, now, true));
            for bytes in there.arrived(now) {
                robot.on_datagram(robots(now), HERE, &bytes);
            }
            let session = robot.session().unwrap();
            let sealed = session.seal(session.stamp(robots(now)), false, taken(now)).unwrap();
            back.send(now, &sealed);
            for bytes in back.arrived(now) {
                let Some(received) = node.on_datagram(now, &bytes) else { continue };
                let sampled = sample_time(&received);
                let believed = received.at.since(Instant::ZERO).as_secs_f64() * 1_000.0;
                assert!(
                    sampled > last && believed <= sampled + 1e-3,
                    "{believed} ms: {received:?}"
                );
                assert!(now.since(received.at) <= Duration::from_millis(100));
                (felt, last) = (felt + 1, sampled);
            }
        }
        assert!(felt > if longest > 100 { 10 } else { 200 }, "{felt} with up to {longest} ms");
    }
}

/// Runs both sides over networks for a time span; returns the number of accepted samples.
fn exchange(
    (node, robot): (&mut Initiator, &mut Responder),
    (there, back): (&mut Network, &mut Network),
    span: std::ops::Range<u64>,
) -> usize {
    let mut felt = 0;
    for now in span.map(at) {
        if let Some(initiation) = node.on_time(now) {
            there.send(now, &initiation);
        }
        if node.session().is_some() {
            there.send(now, &command(node, now, false));
        }
        for bytes in there.arrived(now) {
            match robot.on_datagram(now, HERE, &bytes) {
                Outcome::Nothing | Outcome::Command(_) => {}
                Outcome::Cookie(bytes) => back.send(now, &bytes),
                Outcome::Response(bytes) => back.send(now, &bytes),
            }
        }
        if robot.session().is_some() {
            back.send(now, &sample(robot, now));
        }
        let arrived = back.arrived(now);
        felt += arrived.iter().filter(|bytes| node.on_datagram(now, bytes).is_some()).count();
    }
    felt
}

#[test]
fn hazard_34_link_recovers_after_loss_and_a_robot_restart() {
    let (node_pair, robot_pair) = (Pair::generate().unwrap(), Pair::generate().unwrap());
    let keys = |own: &Pair, peer: &Pair| Keys { secret: own.secret, peer: peer.public };
    for seed in 0..4 {
        let mut node = Initiator::new(keys(&node_pair, &robot_pair), seed);
        let mut there = Network::new(seed, 45);
        let mut back = Network::new(seed + 100, 45);
        node.begin(at(0)).unwrap();
        for start in [0, 3_000] {
            // Each robot has its own cookie secret.
            let secret = [u8::try_from(start % 251).unwrap(); 32];
            let mut robot = Responder::new(keys(&robot_pair, &node_pair), secret);
            let span = start..start + 3_000;
            let felt = exchange((&mut node, &mut robot), (&mut there, &mut back), span);
            assert!(felt > 50, "seed {seed}, from {start} ms: {felt}");
        }
    }
}

#[test]
fn restarted_node_with_the_same_epochs_connects() {
    let (node_pair, robot_pair) = (Pair::generate().unwrap(), Pair::generate().unwrap());
    let keys = |own: &Pair, peer: &Pair| Keys { secret: own.secret, peer: peer.public };
    let mut robot = Responder::new(keys(&robot_pair, &node_pair), [3; 32]);
    for start in [0, 1_000, 2_000] {
        let mut node = Initiator::new(keys(&node_pair, &robot_pair), 0);
        connect(&mut node, &mut robot, at(start));
    }
}

#[test]
fn repeated_initiation_gets_the_same_response() {
    let (mut node, mut robot) = peers();
    node.begin(at(0)).unwrap();
    let asked = initiation(&mut node, &mut robot, at(0));
    let first = robot.on_datagram(at(0), HERE, &asked);
    assert!(matches!(first, Outcome::Response(_)));
    assert_eq!(robot.on_datagram(at(50), HERE, &asked), first);
}

#[test]
fn hazard_35_new_datagrams_with_an_old_sample_are_stale() {
    let (mut node, mut robot) = connected();
    let session = robot.session().unwrap();
    let frozen = (session.stamp(at(1)), taken(at(1)));
    let felt = (2..300).map(at).filter(|now| {
        let command = command(&mut node, *now, true);
        robot.on_datagram(*now, HERE, &command);
        let (stamp, content) = frozen;
        let bytes = robot.session().unwrap().seal(stamp, false, content).unwrap();
        node.on_datagram(*now, &bytes).is_some_and(|received| {
            assert_eq!(received.at, at(0), "the echo at sample time");
            true
        })
    });
    assert_eq!(felt.last(), Some(at(100)));
    assert!(node.rejects().of(Reject::Old) > 190);
}

#[test]
fn hazard_34_lost_link_resumes_in_the_same_session() {
    let (mut node, mut robot) = connected();
    for now in (1..2_000).map(at) {
        let is_down = (at(500)..at(1_500)).contains(&now);
        let command = command(&mut node, now, true);
        let sample = sample(&mut robot, now);
        if is_down {
            continue;
        }
        robot.on_datagram(now, HERE, &command);
        let felt = node.on_datagram(now, &sample).is_some();
        assert!(
            felt || now == at(1_500),
            "{now:?}: the first one after the gap echoes an old stamp"
        );
    }
}

proptest! {
    #[test]
    fn hazard_33_any_content_is_refused_or_within_range(
        plain in prop::collection::vec(any::<u8>(), PLAIN), flags in 0..20_u32,
    ) {
        let mut plain: [u8; PLAIN] = plain.try_into().unwrap();
        plain[16..20].copy_from_slice(&flags.to_le_bytes());
        match Payload::decode(&plain) {
            Err(reject) => prop_assert_eq!(reject, Reject::Impossible),
            Ok(Payload { content: Content::Command(Motion::Rate(v_m)), .. }) => {
                prop_assert!(v_m.is_finite());
            }
            Ok(Payload { content: Content::Command(Motion::Pose(x)), .. }) => {
                prop_assert!((x.rotation.norm() - 1.0).abs() < 1e-9);
            }
            Ok(Payload { content: Content::Sample { f_s, x_b_m }, .. }) => {
                prop_assert!(f_s.is_finite() && (x_b_m.rotation.norm() - 1.0).abs() < 1e-9);
            }
            Ok(Payload { content: Content::Command(Motion::Hold), .. }) => {}
        }
    }

    #[test]
    fn content_is_preserved_up_to_binary32(
        six in prop::array::uniform6(-90.0..90.0_f64), place in prop::array::uniform3(-5.0..5.0_f64),
        turn in prop::array::uniform3(-1.5..1.5_f64), armed: bool, micros: u64, echo: Option<u64>,
    ) {
        let x = Isometry3::new(Vector3::from(place), Vector3::from(turn));
        let stamp = Instant::from_micros(micros);
        let echo = echo.map(Instant::from_micros);
        for content in [
            HOLD,
            Content::Command(Motion::Rate(Twist::from_components(six))),
            Content::Command(Motion::Pose(x)),
            Content::Sample { f_s: Wrench::from_components(six), x_b_m: x },
        ] {
            let sent = Payload { stamp, echo, armed, content };
            let came = Payload::decode(&sent.encode()).unwrap();
            prop_assert_eq!((came.stamp, came.echo, came.armed), (stamp, echo, armed));
            prop_assert!(is_near(&content, &came.content), "{:?} {:?}", content, came.content);
        }
    }
}

fn is_near(one: &Content, other: &Content) -> bool {
    let near = |a: [f64; 6], b: [f64; 6]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
    let same = |a: &Isometry3<f64>, b: &Isometry3<f64>| {
        (a.to_homogeneous() - b.to_homogeneous()).amax() < 1e-6
    };
    match (one, other) {
        (Content::Command(Motion::Hold), Content::Command(Motion::Hold)) => true,
        (Content::Command(Motion::Rate(a)), Content::Command(Motion::Rate(b))) => {
            near(a.components(), b.components())
        }
        (Content::Command(Motion::Pose(a)), Content::Command(Motion::Pose(b))) => same(a, b),
        (Content::Sample { f_s: a, x_b_m: x }, Content::Sample { f_s: b, x_b_m: y }) => {
            near(a.components(), b.components()) && same(x, y)
        }
        _ => false,
    }
}
