//! Tests of the certificates with which a peer can send messages to an end, or receive its messages. The peer is a session
//! of zenoh in this test, without access control.
#![allow(
    clippy::indexing_slicing,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

mod common;

use time::{Duration, OffsetDateTime};

use common::Authority;
use common::peer::Peer;
use common::program::{FarEnd, NearEnd};

/// Messages of each attempt.
const COUNT: usize = 100;

fn now() -> OffsetDateTime {
    #[expect(clippy::disallowed_methods, reason = "validity of certificates is of the wall clock")]
    std::time::SystemTime::now().into()
}

/// A peer that passes, and peers with certificates that do not: what they have, and the line about them.
struct Cast {
    folder: tempfile::TempDir,
    strangers: Vec<(&'static str, &'static str)>,
}

impl Cast {
    /// Makes keys of an end in `own`, of the right peer in `right`, and of strangers; `peer` is the right peer's name.
    fn new(own: &str, peer: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let authority = Authority::new();
        let (from, to) = (now() - Duration::DAY, now() + Duration::DAY);
        authority.write(&at("own"), own, &format!("frhc-1-{own}"), from, to);
        authority.write(&at("right"), "peer", peer, from, to);
        authority.write(&at("other name"), "peer", "frhc-1-stranger", from, to);
        authority.write(&at("other arm"), "peer", &peer.replace('1', "2"), from, to);
        authority.write(&at("own name"), "peer", &format!("frhc-1-{own}"), from, to);
        authority.write(&at("expired"), "peer", peer, from - Duration::DAY, from);
        authority.write(&at("not yet"), "peer", peer, to, to + Duration::DAY);
        Authority::new().write(&at("other authority"), "peer", peer, from, to);
        let strangers = vec![
            ("other name", "has the certificate of \"frhc-1-stranger\""),
            ("other arm", "has the certificate of \"frhc-2-"),
            ("own name", "has the certificate of \"frhc-1-"),
            ("expired", "has expired"),
            ("not yet", "is not valid yet"),
            ("other authority", "is of another authority"),
            ("none", "is missing"),
        ];
        Self { folder, strangers }
    }

    fn at(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join(name)
    }
}

/// Keys of a peer; `none` has only the authority of the end.
fn keys(cast: &Cast, name: &str) -> common::PeerKeys {
    let authority = cast.at(if name == "other authority" { name } else { "own" });
    let own = (name != "none").then(|| cast.at(name));
    common::PeerKeys { authority: authority.join("authority.pem"), own }
}

#[test]
fn promise_06_and_hazard_37_far_end_takes_near_end_alone() {
    let cast = Cast::new("far", "frhc-1-near");
    let mut far = FarEnd::start(&cast.at("own"));
    let mut robot = far.robot();
    let mut strangers = Vec::new();
    for (name, line) in &cast.strangers {
        let stranger = Peer::connect(far.port, &keys(&cast, name));
        far.end.wait_for(line);
        stranger.publish("frhc/1/command", COUNT);
        strangers.push((name, stranger));
    }
    let near = Peer::connect(far.port, &keys(&cast, "right"));
    far.end.wait_for("connected to frhc-1-near");
    near.wait_for_subscriber("frhc/1/command");
    let passed = (0..COUNT).filter(|_| near.command_reaches(&mut robot)).count();
    assert_eq!(passed, COUNT);
    assert_eq!(robot.others(), 0, "messages of strangers");
    // The first datagram may overtake the declaration of its key.
    near.sends_first(&mut robot);
    assert!((0..COUNT).all(|_| near.takes_feedback_of(&mut robot)));
    for (name, stranger) in &strangers {
        assert_eq!(stranger.received(), 0, "{name}");
    }
}

#[test]
fn promise_06_and_hazard_37_near_end_takes_far_end_alone() {
    let cast = Cast::new("near", "frhc-1-far");
    let mut near = NearEnd::start(&cast.at("own"));
    let mut node = near.node();
    let mut strangers = Vec::new();
    for (name, line) in &cast.strangers {
        let stranger = Peer::connect(near.port, &keys(&cast, name));
        near.end.wait_for(line);
        stranger.publish("frhc/1/feedback", COUNT);
        strangers.push((name, stranger));
    }
    let far = Peer::connect(near.port, &keys(&cast, "right"));
    near.end.wait_for("connected to frhc-1-far");
    far.wait_for_subscriber("frhc/1/feedback");
    let passed = (0..COUNT).filter(|_| far.feedback_reaches(&mut node)).count();
    assert_eq!(passed, COUNT);
    assert_eq!(node.others(), 0, "messages of strangers");
    far.sends_first(&mut node);
    assert!((0..COUNT).all(|_| far.takes_command_of(&mut node)));
    for (name, stranger) in &strangers {
        assert_eq!(stranger.received(), 0, "{name}");
    }
}

#[test]
fn end_says_why_it_is_refused() {
    let cast = Cast::new("near", "frhc-1-far");
    for name in ["expired", "other authority"] {
        let listener = Peer::listen(&keys(&cast, name));
        let mut near = NearEnd::connecting(&cast.at("own"), listener.port);
        near.end.wait_for("connection refused: ");
    }
}

#[test]
fn ends_of_two_authorities_say_so_in_one_line_each() {
    let (ours, theirs) = (Cast::new("near", "frhc-1-far"), Cast::new("far", "frhc-1-near"));
    let mut far = FarEnd::start(&theirs.at("own"));
    let mut near = NearEnd::connecting(&ours.at("own"), far.port);
    for end in [&mut far.end, &mut near.end] {
        end.wait_for("connection refused: ");
    }
    // By now both have seen several attempts.
    let listener = Peer::connect(far.port, &keys(&theirs, "right"));
    far.end.wait_for("connected to frhc-1-near");
    drop(listener);
    assert_eq!(far.end.lines_with("connection refused: "), 1);
    assert_eq!(near.end.lines_with("connection refused: "), 1);
}
