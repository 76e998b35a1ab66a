//! Lost and late answers to the reads of 6041h in the proof test: hazard 16.

use std::collections::VecDeque;

use crate::common::prelude::*;
use canopen_device::station::{Station, earlier};
use node::{BringUpError, Node};
use remote::site::VirtualSite;

/// Drives with an RPDO timer on grouped and separate PDOs, with a heartbeat consumer alone, and with guarding alone.
const CONFIGS: [&str; 5] = [
    KRAFT,
    KRAFT_500HZ,
    "config/drives/ingenia_eve.toml",
    "config/drives/maxon_epos4.toml",
    "config/drives/technosoft_ipos.toml",
];

/// Delay of a late answer: longer than the answer timeout of the proof test, shorter than that of SDO.
const LATE: Duration = Duration::from_millis(400);

/// Fate of selected answers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fate {
    Lost,
    Late,
}

/// Answers of one drive to reads of 6041h after the first SYNC, by their number from 1.
#[derive(Clone, Copy, Debug)]
struct Selection {
    joint: Joint,
    first: u32,
    last: u32,
    fate: Fate,
}

impl Selection {
    fn one(joint: Joint, number: u32, fate: Fate) -> Option<Self> {
        Some(Self { joint, first: number, last: number, fate })
    }
}

/// Devices whose selected answers are lost or late.
struct Replies {
    world: World,
    /// Identifiers of the drives' answers.
    cob_ids: [u16; 6],
    selection: Option<Selection>,
    has_synced: bool,
    /// Answers of each drive.
    counts: [u32; 6],
    delayed: VecDeque<(Instant, Telegram)>,
}

impl Replies {
    fn filter(&mut self, now: Instant, sent: Vec<Telegram>, out: &mut Vec<Telegram>) {
        for telegram in sent {
            let of = self.cob_ids.iter().position(|it| *it == telegram.frame.cob_id);
            let is_statusword = telegram.frame.data().starts_with(&[0x4B, 0x41, 0x60, 0]);
            let Some(place) = of.filter(|_| is_statusword && self.has_synced) else {
                out.push(telegram);
                continue;
            };
            self.counts[place] += 1;
            let number = self.counts[place];
            let selected = self
                .selection
                .filter(|it| it.joint.index() == place && (it.first..=it.last).contains(&number));
            match selected.map(|it| it.fate) {
                None => out.push(telegram),
                Some(Fate::Lost) => {}
                Some(Fate::Late) => self.delayed.push_back((now + LATE, telegram)),
            }
        }
    }
}

impl Station for Replies {
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        self.has_synced |= frame.cob_id == 0x80;
        let mut sent = Vec::new();
        self.world.on_frame(now, channel, frame, &mut sent);
        self.filter(now, sent, out);
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        while self.delayed.front().is_some_and(|(at, _)| *at <= now) {
            out.extend(self.delayed.pop_front().map(|(_, telegram)| telegram));
        }
        if self.world.deadline().is_some_and(|due| due <= now) {
            let mut sent = Vec::new();
            self.world.on_time(now, &mut sent);
            self.filter(now, sent, out);
        }
    }

    fn deadline(&self) -> Option<Instant> {
        earlier(self.world.deadline(), self.delayed.front().map(|(at, _)| *at))
    }
}

type RepliesNode = Node<Memory<Replies, ()>, VirtualSite>;

/// Boots the arm whose elbow's drive has this quirk, if any.
fn booted(
    config: &Config,
    quirk: Option<&str>,
    selection: Option<Selection>,
) -> (RepliesNode, Result<(), BringUpError>) {
    let mut script = script("seconds = 5");
    script.quirks_mut().add(ELBOW, quirk.map(|it| it.parse::<Quirk>().unwrap()));
    let replies = Replies {
        world: world::build(config, script, 1),
        cob_ids: config.joints.each_ref().map(|joint| 0x580 + u16::from(joint.node.raw())),
        selection,
        has_synced: false,
        counts: [0; 6],
        delayed: VecDeque::new(),
    };
    let bitrates: Vec<u32> = config.buses.iter().map(|bus| bus.bitrate).collect();
    let site = VirtualSite::new(&config.remote, config.period);
    let mut node = Node::new(config, Memory::new(&bitrates, replies, ()), site);
    let outcome = node.bring_up(&mut || false);
    (node, outcome)
}

/// Returns the failure; it must be one of the proof test.
fn failure(case: &str, outcome: Result<(), BringUpError>) -> String {
    match outcome {
        Err(error @ BringUpError::ProofTest(_)) => error.to_string(),
        other => panic!("{case}: {other:?}"),
    }
}

#[test]
fn hazard_16_single_lost_or_late_statusword_fails_no_drive() {
    let (mut tried, mut longest) = (0, Duration::ZERO);
    for file in CONFIGS {
        let config = config(file);
        let (clean, outcome) = booted(&config, None, None);
        outcome.unwrap();
        let counts = clean.bus().stations().counts;
        for joint in Joint::ALL {
            for number in 1..=counts[joint.index()] {
                for fate in [Fate::Lost, Fate::Late] {
                    let case = format!("{file}: answer {number} of {joint:?} is {fate:?}");
                    let (mut node, outcome) =
                        booted(&config, None, Selection::one(joint, number, fate));
                    outcome.unwrap_or_else(|error| panic!("{case}: {error}"));
                    tried += 1;
                    longest = longest.max(node.bus().now().since(clean.bus().now()));
                    let drives = |node: &RepliesNode| node.proof_test_report().drives.clone();
                    for (drive, usual) in drives(&node).iter().zip(drives(&clean)) {
                        // Phases of drive and node differ from test to test.
                        let usual = usual.reaction_time().unwrap();
                        let difference = drive.reaction_time().unwrap().abs_diff(usual);
                        assert!(difference <= MS, "{case}: {difference:?} besides {usual:?}");
                    }
                    // No answer of the test acts later.
                    (0..1_200).for_each(|_| _ = node.cycle());
                    assert_eq!((node.mode(), node.cause()), (Mode::Ready, None), "{case}");
                }
            }
        }
    }
    println!("{tried} lost or late answers: a boot takes at most {longest:.1?} longer");
    assert!(tried >= 24, "{tried} answers");
}

#[test]
fn hazard_16_drive_without_answers_is_not_said_to_keep_power() {
    for file in [KRAFT_500HZ, "config/drives/ingenia_eve.toml"] {
        let config = config(file);
        for fate in [Fate::Lost, Fate::Late] {
            let selection = Selection { joint: ELBOW, first: 1, last: u32::MAX, fate };
            let (_, outcome) = booted(&config, None, Some(selection));
            let case = format!("{file}: {fate:?}");
            let failure = failure(&case, outcome);
            let name = "joint 3 (elbow), node 3: did not answer 6041h in time without RPDOs";
            assert!(failure.starts_with(name), "{case}: {failure}");
            assert!(failure.contains("its emergency after "), "{case}: {failure}");
            assert!(!failure.contains("kept its power stage on"), "{case}: {failure}");
        }
    }
}

#[test]
fn hazard_16_drive_that_keeps_power_fails_at_any_lost_answer() {
    let mut tried = 0;
    for file in CONFIGS {
        let config = config(file);
        let (node, outcome) = booted(&config, Some("holds-torque"), None);
        let kept = "joint 3 (elbow), node 3: kept its power stage on for";
        assert!(failure(file, outcome).starts_with(kept));
        for number in 1..=node.bus().stations().counts[ELBOW.index()] {
            for fate in [Fate::Lost, Fate::Late] {
                let case = format!("{file}: answer {number} is {fate:?}");
                let selection = Selection::one(ELBOW, number, fate);
                let (_, outcome) = booted(&config, Some("holds-torque"), selection);
                let failure = failure(&case, outcome);
                assert!(failure.starts_with(kept), "{case}: {failure}");
                tried += 1;
            }
        }
    }
    assert!(tried >= 100, "{tried} answers");
}
