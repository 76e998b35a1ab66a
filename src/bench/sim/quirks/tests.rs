//! Effect of each quirk, and that it has no other.

mod encoder;
mod stored;

use std::time::Duration;

use canopen_rs::NodeId;
use proptest::prelude::*;

use crate::actuator::ActuatorSettings;
use crate::drive::{Drive, DriveSettings, EncoderKind};
use crate::drivetrain::MotorReading;
use crate::motion::Tuning;
use crate::quirks::{Quirk, QuirkEffects, Quirks};
use canopen::drive::State;
use canopen::eds::Eds;
use canopen::error_codes;
use canopen::frame::{Channel, Frame};
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;
use canopen_device::station::Station;
use units::time::Instant;

const BUS: Channel = Channel(0);

fn node() -> NodeId {
    NodeId::new(3).unwrap()
}

fn dictionary() -> Dictionary {
    let eds = Eds::parse(include_bytes!("../../../../eds/frhc_drive.eds")).unwrap();
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
        encoder: EncoderKind::Absolute,
        is_prismatic: false,
        latency: Duration::ZERO,
        tuning: Tuning::default(),
    };
    Drive::with(settings, &quirks(names))
}

fn ms(millis: u64) -> Instant {
    Instant::from_micros(1_000 * millis)
}

/// Runs a drive with these received frames until `end`; returns its sent frames.
fn sent(drive: &mut Drive, received: &[(Instant, Frame)], end: Instant) -> Vec<(Instant, Frame)> {
    let (mut sent, mut received) = (Vec::new(), received.iter().peekable());
    loop {
        let due = drive.deadline().filter(|due| *due <= end);
        let next = received.peek().map(|(at, _)| *at);
        let Some(now) = due.into_iter().chain(next).min() else { return sent };
        let mut out = Vec::new();
        match received.next_if(|(at, _)| *at <= now) {
            Some((_, frame)) => drive.on_frame(now, BUS, frame, &mut out),
            None => drive.on_time(now, &mut out),
        }
        sent.extend(out.into_iter().map(|telegram| (now, telegram.frame)));
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

fn sent_by(names: &[&str]) -> Vec<(Instant, Frame)> {
    sent(&mut drive(names), &conversation(), ms(500))
}

#[test]
fn drive_without_quirks_conforms() {
    assert!(QuirkEffects::new(&Quirks::default(), dictionary(), node()).dictionary == dictionary());
    let silent = drive(&[]);
    assert_eq!((silent.state(), silent.demand()), (State::NotReadyToSwitchOn, 0.0));
}

#[test]
fn dictionary_quirks_change_their_objects_only() {
    let before = dictionary();
    let rpdos = |sub: u8| (1..=4).map(move |number| Object::rpdo_communication(number, sub));
    for name in Quirk::NAMES {
        let after = QuirkEffects::new(&quirks(&[name]), before.clone(), node()).dictionary;
        let objects = (0..=u16::MAX).filter(|index| before.has_index(*index));
        let all = objects.flat_map(|index| (0..=u8::MAX).map(move |sub| Object { index, sub }));
        let changed: Vec<Object> = all.filter(|o| before.entry(*o) != after.entry(*o)).collect();
        let expected: Vec<Object> = match name {
            "no-rpdo-timer" => rpdos(5).collect(),
            "no-sync-counter" => vec![Object::SYNC_OVERFLOW],
            "wrong-identity" => vec![Object::PRODUCT_CODE],
            // COB-IDs, types and controlwords have these values by default.
            "open-rpdos" => (2..=4).map(|number| Object::rpdo_mapping(number, 2)).collect(),
            // The COB-ID of TPDO 1 has bit 30 by no default of ours.
            "no-rtr" => (1..=4).map(|number| Object::tpdo_communication(number, 1)).collect(),
            "polarity-reversed" => vec![Object::POLARITY],
            "stored" => vec![Object::GEAR_MOTOR_REVOLUTIONS],
            _ => vec![],
        };
        assert_eq!(changed, expected, "{name}");
    }
}

/// Returns whether a frame is an SDO response of the drive.
fn is_reply((_, frame): &&(Instant, Frame)) -> bool {
    frame.cob_id == 0x583
}

proptest! {
    #[test]
    fn slow_sdo_delays_sdo_responses_only(delay in 1_u64..19) {
        let (good, slow) = (sent_by(&[]), sent_by(&[&format!("slow-sdo:{delay}")]));
        let replies: Vec<_> = good.iter().filter(is_reply).collect();
        let late: Vec<_> = slow.iter().filter(is_reply).collect();
        prop_assert_eq!(replies.len(), late.len());
        for ((at, frame), (later, same)) in replies.into_iter().zip(late) {
            prop_assert_eq!((*at + Duration::from_millis(delay), frame), (*later, same));
        }
        let others = |sent: &[(Instant, Frame)]| -> Vec<_> {
            sent.iter().filter(|frame| !is_reply(frame)).copied().collect()
        };
        prop_assert_eq!(others(&good), others(&slow));
    }
}

/// Checks that `undo` removes every difference to a conforming drive.
fn changes_nothing_else(quirk: &str, undo: impl Fn(&mut Vec<(Instant, Frame)>)) {
    let (mut good, mut bad) = (sent_by(&[]), sent_by(&[quirk]));
    assert!(good != bad, "{quirk} has an effect");
    undo(&mut good);
    undo(&mut bad);
    assert!(good == bad, "{quirk}");
}

#[test]
fn frame_quirks_change_their_frames_only() {
    let is_boot_up = |(_, frame): &(Instant, Frame)| frame.cob_id == 0x703 && frame.data() == [0];
    let beats = |(_, frame): &(Instant, Frame)| frame.cob_id == 0x703 && frame.data() != [0];
    changes_nothing_else("double-replies", |sent| sent.dedup());
    changes_nothing_else("no-boot-up", |sent| sent.retain(|frame| !is_boot_up(frame)));
    changes_nothing_else("heartbeat-liar", |sent| sent.retain(|frame| !beats(frame)));
    changes_nothing_else("emcy-storm", |sent| sent.retain(|(_, frame)| frame.cob_id != 0x083));
    changes_nothing_else("vague-aborts", |sent| {
        sent.retain(|(_, frame)| frame.data().first() != Some(&0x80));
    });
    changes_nothing_else("unsized-replies", |sent| {
        let is_upload = |frame: &Frame| frame.cob_id == 0x583 && frame.data()[0] >> 5 == 2;
        sent.retain(|(_, frame)| !is_upload(frame));
    });
}

#[test]
fn no_rtr_refuses_tpdo_cob_ids_without_bit_30() {
    let mut drive = drive(&["no-rtr"]);
    let cob_id = |number| Object::tpdo_communication(number, 1);
    let default = drive.dictionary().unsigned(cob_id(1));
    assert_eq!(default & 1 << 30, 1 << 30, "{default:08X}h");
    let raw = |raw: u32| raw.to_le_bytes();
    let received = [
        (ms(1), write(cob_id(1), &raw(0x8000_0183))),
        (ms(2), write(cob_id(1), &raw(0xC000_0183))),
        (ms(3), write(cob_id(1), &raw(0x0000_0183))),
        (ms(4), write(cob_id(1), &raw(0x4000_0183))),
        (ms(5), write(Object::tpdo_communication(1, 2), &[1])),
        (ms(6), write(Object::rpdo_communication(1, 1), &raw(0x8000_0203))),
    ];
    let sent = sent(&mut drive, &received, ms(7));
    let replies: Vec<_> = sent.iter().filter(is_reply).map(|(_, f)| f.data()[0]).collect();
    assert_eq!(replies, [0x80, 0x60, 0x80, 0x60, 0x60, 0x60]);
    let abort = sent.iter().find(is_reply).unwrap().1;
    assert_eq!(abort.data()[4..], [0x30, 0x00, 0x09, 0x06]);
}

#[test]
fn lost_sdo_reply_loses_one_upload_response_only() {
    let received = [
        (ms(1), read(Object::DEVICE_TYPE)),
        (ms(2), write(Object::MAX_TORQUE, &[1, 0])),
        (ms(3), read(Object::MAX_TORQUE)),
        (ms(4), read(Object::MAX_TORQUE)),
        (ms(5), Frame::new(0x000, [0x81, 3])),
        (ms(6), read(Object::DEVICE_TYPE)),
        (ms(7), read(Object::DEVICE_TYPE)),
    ];
    let sent = sent(&mut drive(&["lost-sdo-reply:2"]), &received, ms(8));
    let at: Vec<_> = sent.iter().filter(is_reply).map(|(at, _)| at.as_micros() / 1_000).collect();
    assert_eq!(at, [1, 2, 4, 6, 7], "a reset does not start the count again");
}

#[test]
fn slow_first_answer_is_slow_once_per_power_up() {
    let mut drive = drive(&["slow-first-answer:1000"]);
    let request = |at| (ms(at), read(Object::DEVICE_TYPE));
    let received = [request(10), request(500), request(1_100), request(1_200)];
    let at = |sent: Vec<(Instant, Frame)>| -> Vec<_> {
        sent.iter().filter(is_reply).map(|(at, _)| at.as_micros() / 1_000).collect()
    };
    assert_eq!(at(sent(&mut drive, &received, ms(1_300))), [1_010, 1_010, 1_100, 1_200]);
    drive.switch_off();
    drive.switch_on(ms(1_400));
    assert_eq!(at(sent(&mut drive, &[request(1_500)], ms(3_000))), [2_500]);
}

#[test]
fn heartbeat_liar_sends_every_100_ms() {
    let received = [(ms(10), write(Object::PRODUCER_HEARTBEAT, &[25, 0]))];
    let sent = sent(&mut drive(&["heartbeat-liar"]), &received, ms(1_000));
    let beats: Vec<_> = sent.iter().filter(|(_, frame)| frame.data() == [0x7F]).collect();
    assert_eq!(beats.len(), 10);
    assert!(beats.windows(2).all(|two| two[1].0.since(two[0].0) == Duration::from_millis(100)));
}

#[test]
fn unsized_replies_keep_their_values() {
    let received = [
        (ms(1), read(Object::MAX_TORQUE)),
        (ms(2), read(Object::PRODUCT_CODE)),
        (ms(3), read(Object::MODE_DISPLAY)),
        (ms(4), read(Object::DEVICE_NAME)),
    ];
    let sent = sent(&mut drive(&["unsized-replies"]), &received, ms(5));
    let replies: Vec<_> = sent.iter().filter(is_reply).map(|(_, frame)| frame.data()).collect();
    assert_eq!(replies[0], [0x42, 0x72, 0x60, 0, 0xB8, 0x0B, 0, 0]);
    assert_eq!(replies[1], [0x42, 0x18, 0x10, 2, 0x10, 0, 0x02, 0x04]);
    assert_eq!(replies[2], [0x42, 0x61, 0x60, 0, 0, 0, 0, 0]);
    assert_eq!(replies[3], [0x40, 0x08, 0x10, 0, 0, 0, 0, 0]);
}

#[test]
fn forgetful_confirms_writes_and_discards_them() {
    let mut drive = drive(&["forgetful:6072h"]);
    let received = [
        (ms(1), write(Object::MAX_TORQUE, &[1, 0])),
        (ms(2), Frame::new(0x603, [0x21, 0x72, 0x60, 0, 2, 0, 0, 0])),
        (ms(3), Frame::new(0x603, [0x0B, 1, 0, 0, 0, 0, 0, 0])),
        (ms(4), write(Object::MAX_MOTOR_SPEED, &[1, 0, 0, 0])),
    ];
    let sent = sent(&mut drive, &received, ms(5));
    let replies: Vec<_> = sent.iter().filter(is_reply).map(|(_, f)| f.data()[0]).collect();
    assert_eq!(replies, [0x60, 0x60, 0x20, 0x60]);
    assert_eq!(drive.dictionary().unsigned(Object::MAX_TORQUE), 3_000);
    assert_eq!(drive.dictionary().unsigned(Object::MAX_MOTOR_SPEED), 1, "other objects are stored");
}

#[test]
fn running_at_start_survives_boot_and_communication_reset() {
    let mut drive = drive(&["running-at-start:-250"]);
    sent(&mut drive, &[(ms(1), Frame::new(0, [0x82, 3]))], ms(2));
    assert_eq!((drive.state(), drive.demand()), (State::OperationEnabled, -250.0));
    sent(&mut drive, &[(ms(3), write(Object::CONTROLWORD, &[0, 0]))], ms(4));
    assert_eq!((drive.state(), drive.demand()), (State::SwitchOnDisabled, 0.0));
}

#[test]
fn late_boot_receives_nothing_before_its_boot_up() {
    let request = |at| (ms(at), read(Object::DEVICE_TYPE));
    let received = [
        request(10),
        request(99),
        request(101),
        (ms(200), Frame::new(0, [0x82, 3])),
        request(299),
        request(301),
    ];
    let sent = sent(&mut drive(&["late-boot:100"]), &received, ms(400));
    let at: Vec<_> =
        sent.iter().map(|(at, frame)| (at.as_micros() / 1_000, frame.cob_id)).collect();
    assert_eq!(at, [(100, 0x703), (101, 0x583), (300, 0x703), (301, 0x583)]);
}

/// Enables a drive with torque, an event timer of RPDO 1 and 6007h = 1, then sends nothing more. Returns its torque
/// after that, and whether it has sent an EMCY.
fn after_connection_loss(names: &[&str]) -> (f64, bool) {
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
    let received: Vec<_> = (1..).map(ms).zip(frames).collect();
    let sent = sent(&mut drive, &received, ms(100));
    let has_emcy = sent.iter().any(|(_, frame)| frame.cob_id == 0x083 && frame.data()[1] == 0x82);
    (drive.demand(), has_emcy)
}

#[test]
fn connection_loss_quirks_keep_the_torque() {
    assert_eq!(after_connection_loss(&[]), (0.0, true));
    assert_eq!(after_connection_loss(&["holds-torque"]), (200.0, true));
    assert_eq!(after_connection_loss(&["keeps-torque"]), (200.0, true));
    assert_eq!(after_connection_loss(&["no-rpdo-timer"]), (200.0, false));
}

#[test]
fn open_rpdo_lets_a_stray_frame_enable_the_drive() {
    let stray = |word: u8| Frame::new(0x403, [word, 0, 200, 0]);
    let frames = [
        write(Object::MODE_OF_OPERATION, &[10]),
        Frame::new(0x000, [1, 3]),
        stray(6),
        stray(7),
        stray(15),
    ];
    let received: Vec<_> = (1..).map(ms).zip(frames).collect();
    let mut drive = drive(&["open-rpdos"]);
    sent(&mut drive, &received, ms(10));
    assert_eq!((drive.state(), drive.demand()), (State::OperationEnabled, 200.0));
}

#[test]
fn lost_write_reply_loses_one_download_response() {
    let received = [
        (ms(1), write(Object::MAX_TORQUE, &[1, 0])),
        (ms(2), read(Object::MAX_TORQUE)),
        (ms(3), write(Object::MAX_TORQUE, &[2, 0])),
        (ms(4), read(Object::MAX_TORQUE)),
    ];
    let sent = sent(&mut drive(&["lost-write-reply:2"]), &received, ms(5));
    let replies: Vec<_> = sent.iter().filter(is_reply).collect();
    let at: Vec<_> = replies.iter().map(|(at, _)| at.as_micros() / 1_000).collect();
    assert_eq!(at, [1, 2, 4]);
    assert_eq!(replies[2].1.data()[4..6], [2, 0], "written all the same");
}

#[test]
fn mode_when_operational_is_refused_with_its_code_before() {
    let command = write(Object::MODE_OF_OPERATION, &[10]);
    let received = [(ms(1), command), (ms(2), Frame::new(0x000, [1, 3])), (ms(3), command)];
    let sent = sent(&mut drive(&["mode-when-operational"]), &received, ms(4));
    let replies: Vec<_> = sent.iter().filter(is_reply).map(|(_, frame)| frame.data()).collect();
    assert_eq!((replies[0][0], &replies[0][4..]), (0x80, &[0x22, 0, 0, 8][..]));
    assert_eq!(replies[1][0], 0x60);
}

#[test]
fn mode_when_enabled_shows_and_obeys_its_mode_only_then() {
    for (quirk, mode) in [("mode-when-enabled", 10), ("mode-when-enabled:8", 8)] {
        let mut drive = drive(&[quirk]);
        let word = |word: u8| write(Object::CONTROLWORD, &[word, 0]);
        let shown = |drive: &Drive| drive.dictionary().i8(Object::MODE_DISPLAY);
        let frames = [write(Object::MODE_OF_OPERATION, &[10]), word(6), word(7)];
        let received: Vec<_> = (1..).map(ms).zip(frames).collect();
        sent(&mut drive, &received, ms(10));
        assert_eq!((shown(&drive), drive.state()), (0, State::SwitchedOn), "{quirk}");
        sent(&mut drive, &[(ms(11), word(15))], ms(12));
        assert_eq!((shown(&drive), drive.state()), (mode, State::OperationEnabled), "{quirk}");
        sent(&mut drive, &[(ms(13), word(0))], ms(14));
        assert_eq!(shown(&drive), 0, "{quirk}");
    }
}

#[test]
fn two_reset_edges_leave_a_fault_at_the_second() {
    for (name, edges) in [(&[][..], 1), (&["two-reset-edges"][..], 2)] {
        let mut drive = drive(name);
        sent(&mut drive, &[], ms(1));
        drive.fail_with(error_codes::OVER_VOLTAGE);
        for edge in 1..=edges {
            assert_eq!(drive.state(), State::Fault, "{name:?} before edge {edge}");
            let at = 10 * edge;
            let words = [0x00, 0x80, 0x80].map(|word| write(Object::CONTROLWORD, &[word, 0]));
            let received: Vec<_> = (at..).map(ms).zip(words).collect();
            sent(&mut drive, &received, ms(at + 5));
        }
        assert_eq!(drive.state(), State::SwitchOnDisabled, "{name:?}");
    }
}
