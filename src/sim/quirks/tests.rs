//! Each quirk changes what it names, as its name says, and nothing else.

use std::time::Duration;

use canopen_rs::NodeId;
use proptest::prelude::*;

use crate::actuator::ActuatorSettings;
use crate::drive::Drive;
use crate::drive::DriveSettings;
use crate::motion::Tuning;
use crate::quirks::Quirk;
use crate::quirks::QuirkEffects;
use crate::quirks::Quirks;
use canopen::dictionary::Dictionary;
use canopen::drive::State;
use canopen::eds::Eds;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::object::Object;
use canopen::station::Station;
use units::time::Instant;

const BUS: Channel = Channel(0);

fn node() -> NodeId {
    NodeId::new(3).unwrap()
}

fn dictionary() -> Dictionary {
    let eds = Eds::parse(include_bytes!("../../../eds/frhc_drive.eds")).unwrap();
    Dictionary::new(&eds, node())
}

fn quirks(names: &[&str]) -> Quirks {
    Quirks::new(names.iter().map(|quirk| quirk.parse().unwrap()))
}

fn drive(names: &[&str]) -> Drive {
    let settings = DriveSettings {
        channel: BUS,
        node: node(),
        dictionary: dictionary(),
        actuator: ActuatorSettings {
            counts_per_rev: 4096.0,
            gear_ratio: 50.0,
            zero_counts: 0,
            rated_torque: 0.3,
            torque_curve: [10.0, 0.0, 0.0],
            max_torque: 30.0,
        },
        latency: Duration::ZERO,
        tuning: Tuning::default(),
    };
    Drive::with(settings, &quirks(names))
}

fn ms(millis: u64) -> Instant {
    Instant::from_micros(1_000 * millis)
}

/// What a drive says until `end`, and when, to these frames.
fn said(drive: &mut Drive, told: &[(Instant, Frame)], end: Instant) -> Vec<(Instant, Frame)> {
    let (mut said, mut told) = (Vec::new(), told.iter().peekable());
    loop {
        let due = drive.deadline().filter(|due| *due <= end);
        let next = told.peek().map(|(at, _)| *at);
        let Some(now) = due.into_iter().chain(next).min() else { return said };
        let mut out = Vec::new();
        match told.next_if(|(at, _)| *at <= now) {
            Some((_, frame)) => drive.on_frame(now, BUS, frame, &mut out),
            None => drive.on_time(now, &mut out),
        }
        said.extend(out.into_iter().map(|telegram| (now, telegram.frame)));
    }
}

fn read(object: Object) -> Frame {
    let [low, high] = object.index.to_le_bytes();
    Frame::new(0x603, [0x40, low, high, object.sub, 0, 0, 0, 0])
}

fn write(object: Object, bytes: &[u8]) -> Frame {
    let [low, high] = object.index.to_le_bytes();
    let unused = 4 - u8::try_from(bytes.len()).unwrap();
    let mut payload = [0x23 | unused << 2, low, high, object.sub, 0, 0, 0, 0];
    payload[4..4 + bytes.len()].copy_from_slice(bytes);
    Frame::new(0x603, payload)
}

/// Reads and writes of all kinds, a start, SYNCs, RPDOs and a reset, a millisecond apart.
fn conversation() -> Vec<(Instant, Frame)> {
    let frames = [
        read(Object::DEVICE_TYPE),
        read(Object::DEVICE_NAME),
        Frame::new(0x603, [0x60, 0, 0, 0, 0, 0, 0, 0]),
        write(Object::PRODUCER_HEARTBEAT, &[25, 0]),
        write(Object::CONSUMER_HEARTBEAT, &[22, 0, 127, 0]),
        write(Object::MAX_TORQUE, &[100, 0]),
        write(Object::STATUSWORD, &[0, 0]),
        read(Object::MAX_TORQUE),
        Frame::new(0x000, [1, 3]),
        Frame::new(0x080, []),
        Frame::new(0x303, [0x06, 0, 0]),
        Frame::new(0x080, []),
        read(Object::STATUSWORD),
        Frame::new(0x000, [0x82, 3]),
        read(Object::DEVICE_TYPE),
    ];
    (1..).map(|at| ms(at * 20)).zip(frames).collect()
}

fn told_by(names: &[&str]) -> Vec<(Instant, Frame)> {
    said(&mut drive(names), &conversation(), ms(500))
}

#[test]
fn a_drive_without_quirks_is_the_good_one() {
    assert!(QuirkEffects::of(&Quirks::default(), dictionary(), node()).dictionary == dictionary());
    let silent = drive(&[]);
    assert_eq!((silent.state(), silent.demand()), (State::NotReadyToSwitchOn, 0.0));
}

#[test]
fn a_quirk_of_the_dictionary_changes_the_objects_it_names() {
    let before = dictionary();
    let rpdos = |sub: u8| (1..=4).map(move |number| Object::rpdo_communication(number, sub));
    for name in Quirk::NAMES {
        let after = QuirkEffects::of(&quirks(&[name]), before.clone(), node()).dictionary;
        let objects = (0..=u16::MAX).filter(|index| before.has_index(*index));
        let all = objects.flat_map(|index| (0..=u8::MAX).map(move |sub| Object { index, sub }));
        let changed: Vec<Object> = all.filter(|o| before.entry(*o) != after.entry(*o)).collect();
        let expected: Vec<Object> = match name {
            "no-rpdo-timer" => rpdos(5).collect(),
            "no-sync-counter" => vec![Object::SYNC_OVERFLOW],
            "wrong-identity" => vec![Object::PRODUCT_CODE],
            // Their identifiers, types and controlwords are so by default.
            "open-rpdos" => (2..=4).map(|number| Object::rpdo_mapping(number, 2)).collect(),
            _ => vec![],
        };
        assert_eq!(changed, expected, "{name}");
    }
}

/// Whether a frame is an SDO reply of the drive.
fn is_reply((_, frame): &&(Instant, Frame)) -> bool {
    frame.cob_id == 0x583
}

proptest! {
    #[test]
    fn a_slow_sdo_delays_every_reply_by_exactly_its_delay_and_nothing_else(delay in 1_u64..19) {
        let (good, slow) = (told_by(&[]), told_by(&[&format!("slow-sdo:{delay}")]));
        let replies: Vec<_> = good.iter().filter(is_reply).collect();
        let late: Vec<_> = slow.iter().filter(is_reply).collect();
        prop_assert_eq!(replies.len(), late.len());
        for ((at, frame), (later, same)) in replies.into_iter().zip(late) {
            prop_assert_eq!((*at + Duration::from_millis(delay), frame), (*later, same));
        }
        let others = |said: &[(Instant, Frame)]| -> Vec<_> {
            said.iter().filter(|frame| !is_reply(frame)).copied().collect()
        };
        prop_assert_eq!(others(&good), others(&slow));
    }
}

/// What is left of what a quirk changed must be what a good drive says.
fn is_all_that_changes(quirk: &str, undo: impl Fn(&mut Vec<(Instant, Frame)>)) {
    let (mut good, mut bad) = (told_by(&[]), told_by(&[quirk]));
    assert!(good != bad, "{quirk} does something");
    undo(&mut good);
    undo(&mut bad);
    assert!(good == bad, "{quirk}");
}

#[test]
fn what_happens_to_frames_happens_to_those_that_are_named() {
    let is_boot_up = |(_, frame): &(Instant, Frame)| frame.cob_id == 0x703 && frame.data() == [0];
    let beats = |(_, frame): &(Instant, Frame)| frame.cob_id == 0x703 && frame.data() != [0];
    is_all_that_changes("double-replies", |said| said.dedup());
    is_all_that_changes("no-boot-up", |said| said.retain(|frame| !is_boot_up(frame)));
    is_all_that_changes("heartbeat-liar", |said| said.retain(|frame| !beats(frame)));
    is_all_that_changes("emcy-storm", |said| said.retain(|(_, frame)| frame.cob_id != 0x083));
    is_all_that_changes("vague-aborts", |said| {
        said.retain(|(_, frame)| frame.data().first() != Some(&0x80));
    });
    is_all_that_changes("unsized-replies", |said| {
        let is_upload = |frame: &Frame| frame.cob_id == 0x583 && frame.data()[0] >> 5 == 2;
        said.retain(|(_, frame)| !is_upload(frame));
    });
}

#[test]
fn a_coarse_timer_beats_every_tenth_of_a_second() {
    let told = [(ms(10), write(Object::PRODUCER_HEARTBEAT, &[25, 0]))];
    let said = said(&mut drive(&["heartbeat-liar"]), &told, ms(1_000));
    let beats: Vec<_> = said.iter().filter(|(_, frame)| frame.data() == [0x7F]).collect();
    assert_eq!(beats.len(), 10);
    assert!(beats.windows(2).all(|two| two[1].0.since(two[0].0) == Duration::from_millis(100)));
}

#[test]
fn a_reply_without_its_size_has_the_value_all_the_same() {
    let told = [
        (ms(1), read(Object::MAX_TORQUE)),
        (ms(2), read(Object::PRODUCT_CODE)),
        (ms(3), read(Object::MODE_DISPLAY)),
        (ms(4), read(Object::DEVICE_NAME)),
    ];
    let said = said(&mut drive(&["unsized-replies"]), &told, ms(5));
    let replies: Vec<_> = said.iter().filter(is_reply).map(|(_, frame)| frame.data()).collect();
    assert_eq!(replies[0], [0x42, 0x72, 0x60, 0, 0xB8, 0x0B, 0, 0]);
    assert_eq!(replies[1], [0x42, 0x18, 0x10, 2, 0x10, 0, 0x02, 0x04]);
    assert_eq!(replies[2], [0x42, 0x61, 0x60, 0, 0, 0, 0, 0]);
    assert_eq!(replies[3], [0x40, 0x08, 0x10, 0, 0, 0, 0, 0]);
}

#[test]
fn what_is_forgotten_is_confirmed_however_it_comes() {
    let mut drive = drive(&["forgetful:6072h"]);
    let told = [
        (ms(1), write(Object::MAX_TORQUE, &[1, 0])),
        (ms(2), Frame::new(0x603, [0x21, 0x72, 0x60, 0, 2, 0, 0, 0])),
        (ms(3), Frame::new(0x603, [0x0B, 1, 0, 0, 0, 0, 0, 0])),
        (ms(4), write(Object::MAX_MOTOR_SPEED, &[1, 0, 0, 0])),
    ];
    let said = said(&mut drive, &told, ms(5));
    let replies: Vec<_> = said.iter().filter(is_reply).map(|(_, f)| f.data()[0]).collect();
    assert_eq!(replies, [0x60, 0x60, 0x20, 0x60]);
    assert_eq!(drive.dictionary().unsigned(Object::MAX_TORQUE), 3_000);
    assert_eq!(drive.dictionary().unsigned(Object::MAX_MOTOR_SPEED), 1, "another is kept");
}

#[test]
fn a_drive_that_runs_at_the_start_outlasts_its_boot_and_a_reset_of_its_communication() {
    let mut drive = drive(&["running-at-start:-250"]);
    said(&mut drive, &[(ms(1), Frame::new(0, [0x82, 3]))], ms(2));
    assert_eq!((drive.state(), drive.demand()), (State::OperationEnabled, -250.0));
    said(&mut drive, &[(ms(3), write(Object::CONTROLWORD, &[0, 0]))], ms(4));
    assert_eq!((drive.state(), drive.demand()), (State::SwitchOnDisabled, 0.0));
}

#[test]
fn a_drive_that_boots_late_hears_nothing_until_it_says_so() {
    let ask = |at| (ms(at), read(Object::DEVICE_TYPE));
    let told =
        [ask(10), ask(99), ask(101), (ms(200), Frame::new(0, [0x82, 3])), ask(299), ask(301)];
    let said = said(&mut drive(&["late-boot:100"]), &told, ms(400));
    let at: Vec<_> =
        said.iter().map(|(at, frame)| (at.as_micros() / 1_000, frame.cob_id)).collect();
    assert_eq!(at, [(100, 0x703), (101, 0x583), (300, 0x703), (301, 0x583)]);
}

/// Enables a drive by its RPDO 1 and 2 and has it push, with a timer of its RPDO 1 and 6007h = 1; then
/// silence. What it pushes with after that, and whether it has told of it.
fn after_silence(names: &[&str]) -> (f64, bool) {
    let mut drive = drive(names);
    let pdo = |word: u8| Frame::new(0x203, [word, 0]);
    let frames = [
        write(Object::ABORT_CONNECTION, &[1, 0]),
        write(Object::rpdo_communication(1, 5), &[5, 0]),
        write(Object::MODE_OF_OPERATION, &[10]),
        write(Object::TARGET_TORQUE, &[200, 0]),
        Frame::new(0x000, [1, 3]),
        pdo(6),
        pdo(7),
        pdo(15),
    ];
    let told: Vec<_> = (1..).map(ms).zip(frames).collect();
    let said = said(&mut drive, &told, ms(100));
    let tells = said.iter().any(|(_, frame)| frame.cob_id == 0x083 && frame.data()[1] == 0x82);
    (drive.demand(), tells)
}

#[test]
fn a_lost_master_is_told_of_and_only_a_liar_pushes_on() {
    assert_eq!(after_silence(&[]), (0.0, true));
    assert_eq!(after_silence(&["holds-torque"]), (200.0, true));
    assert_eq!(after_silence(&["keeps-torque"]), (200.0, true));
    assert_eq!(after_silence(&["no-rpdo-timer"]), (200.0, false));
}

#[test]
fn an_open_rpdo_enables_whom_it_was_not_meant_for() {
    let stray = |word: u8| Frame::new(0x403, [word, 0, 200, 0]);
    let frames = [
        write(Object::MODE_OF_OPERATION, &[10]),
        Frame::new(0x000, [1, 3]),
        stray(6),
        stray(7),
        stray(15),
    ];
    let told: Vec<_> = (1..).map(ms).zip(frames).collect();
    let mut drive = drive(&["open-rpdos"]);
    said(&mut drive, &told, ms(10));
    assert_eq!((drive.state(), drive.demand()), (State::OperationEnabled, 200.0));
}
