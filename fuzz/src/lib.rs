//! Fuzz targets: for any bytes there is no panic, no unbounded response and no endless loop.
//!
//! Each function takes one input and asserts its properties. cargo-fuzz searches for violations; `tests/any_bytes.rs`
//! includes this file and runs arbitrary inputs in `cargo test`.

use std::path::Path;
use std::sync::LazyLock;
use std::time::Duration;

use calibration::torque_data::TorqueData;
use canopen::NodeId;
use canopen::eds::Eds;
use canopen::frame::{COB_ID_MAX, Channel, Frame, Telegram};
use canopen::master::Master;
use canopen::object::Object;
use canopen::plan::NodePlan;
use canopen::sdo::{Block, MAX_BYTES, SdoOptions, Transfer};
use canopen_device::dictionary::Dictionary;
use canopen_device::station::Station;
use canopen_tools::candump::Line;
use config::Config;
use sim::drive::Drive;
use sim::scenario::Scenario;
use testbench::world;
use units::time::Instant;

/// Maximum frames caused by one received frame or one deadline: a block of SDO segments to each node.
const MOST_ANSWERS: usize = 8 * 128;

/// Maximum deadlines due at one time.
const MOST_TURNS: usize = 100;

/// Runs drives and their master together, with frames of the input from an unknown station.
pub fn frames(bytes: &[u8]) {
    let is_drive = |(_, plan): &(Channel, NodePlan)| plan.mode.is_some();
    let mut master = Master::new(CONFIG.node_plans().into_iter().filter(is_drive).collect());
    let mut drives = DRIVES.clone();
    let mut now = Instant::ZERO;
    for step in steps(bytes) {
        now = now + step.after;
        let mut out = vec![Telegram { channel: Channel(0), frame: step.frame }];
        drives.iter_mut().for_each(|drive| drive.on_time(now, &mut out));
        let mut turns = 0;
        while master.deadline().is_some_and(|due| due <= now) {
            master.on_time(now, &mut out);
            turns += 1;
            assert!(turns <= MOST_TURNS, "the master's deadline does not move");
        }
        assert!(out.len() <= MOST_ANSWERS, "too much was due");
        exchange(now, &mut master, &mut drives, out);
    }
}

/// Exchanges frames between both sides for some rounds.
fn exchange(now: Instant, master: &mut Master, drives: &mut [Drive], mut sent: Vec<Telegram>) {
    for _ in 0..4 {
        let mut answers = Vec::new();
        for telegram in &sent {
            let before = answers.len();
            for drive in &mut *drives {
                drive.on_frame(now, telegram.channel, &telegram.frame, &mut answers);
            }
            master.on_frame(now, telegram, &mut answers);
            assert!(answers.len() - before <= MOST_ANSWERS, "{} led to too much", telegram.frame);
        }
        sent = answers;
    }
}

/// Runs an SDO client against a server that answers with the input.
pub fn sdo_client(bytes: &[u8]) {
    let Some((&[kind, size], replies)) = bytes.split_first_chunk() else { return };
    let mut out = Vec::new();
    let mut now = Instant::ZERO;
    let timeout = Duration::from_millis(100);
    let block = Block::new(size % 127 + 1).unwrap();
    let options = match kind >> 1 & 3 {
        0 => SdoOptions::segmented(timeout),
        1 => SdoOptions::best(timeout, block),
        _ => SdoOptions::block(timeout, block),
    };
    let mut transfer = if kind & 1 == 0 {
        Transfer::read_with(options, node(), Object::DEVICE_NAME, now, &mut out)
    } else {
        let value = vec![0x5A; 8 * usize::from(size)];
        Transfer::write_with(options, node(), Object::DEVICE_NAME, value, now, &mut out).unwrap()
    };
    for step in steps(replies) {
        now = now + step.after;
        out.clear();
        let reply = addressed(&step.frame, 0x580);
        let outcome = transfer.on_frame(now, &reply, &mut out);
        let outcome = outcome.or_else(|| transfer.on_time(now, &mut out));
        assert!(out.len() <= MOST_ANSWERS, "{reply} led to {} requests", out.len());
        assert!(out.iter().all(|frame| frame.cob_id == 0x601 && frame.data().len() == 8));
        if let Some(outcome) = outcome {
            assert!(outcome.is_err() || outcome.unwrap().bytes().len() <= MAX_BYTES);
            assert_eq!(transfer.deadline(), None, "it is over");
            return;
        }
        assert!(transfer.deadline().is_some(), "it waits for something");
    }
}

/// Runs a drive with an SDO client that sends the input.
pub fn sdo_server(bytes: &[u8]) {
    let mut drive = DRIVES.first().unwrap().clone();
    let mut now = Instant::ZERO;
    drive.on_time(now, &mut Vec::new());
    for step in steps(bytes) {
        now = now + step.after;
        let mut out = Vec::new();
        drive.on_frame(now, Channel(0), &addressed(&step.frame, 0x600), &mut out);
        let replies = out.iter().filter(|telegram| telegram.frame.cob_id == 0x581);
        assert!(replies.clone().count() <= 128, "{} led to too much", step.frame);
        assert!(replies.clone().all(|telegram| telegram.frame.data().len() == 8));
        drive.on_time(now, &mut out);
    }
}

/// Parses an EDS and creates its dictionary.
pub fn eds(bytes: &[u8]) {
    let Ok(eds) = Eds::parse(bytes) else { return };
    let dictionary = Dictionary::new(&eds, node());
    for described in eds.objects() {
        assert!(eds.object(described.object).is_some());
        assert!(dictionary.entry(described.object).is_some(), "{}", described.object);
    }
}

/// Parses log lines: a parsed line survives display and parse.
pub fn candump(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    for line in text.lines() {
        let Ok(read) = Line::parse(line) else { continue };
        let written = read.to_string();
        assert_eq!(Line::parse(&written).as_ref(), Ok(&read), "{line:?} was written {written:?}");
        if let Some((cob_id, data)) = read.canopen() {
            assert!(data.len() <= 8);
            assert_eq!(Frame::from_slice(cob_id, data).is_some(), cob_id <= COB_ID_MAX);
        }
    }
}

/// Parses a configuration: a refusal has a reason.
pub fn config(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    if let Err(invalid) = Config::parse(Path::new("config/any.toml"), &text) {
        assert!(!invalid.0.is_empty(), "refused without a reason");
    }
    if let Err(error) = Scenario::parse(&text) {
        assert!(!error.to_string().is_empty());
    }
}

/// Parses measured torques: a refusal has a reason.
pub fn torque_data(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    if let Err(invalid) = TorqueData::parse(Path::new("any.csv"), &text) {
        assert!(!invalid.0.is_empty(), "refused without a reason");
    }
}

/// Time step, then a frame.
struct Step {
    after: Duration,
    frame: Frame,
}

/// Splits the input into steps: half milliseconds, identifier, length, data. Identifiers are mostly those of a small
/// network, so that they have an effect.
fn steps(bytes: &[u8]) -> impl Iterator<Item = Step> + '_ {
    bytes.chunks(12).filter_map(|chunk| {
        let (&[after, service, node, length], data) = chunk.split_first_chunk()?;
        let cob_id = match SERVICES.get(usize::from(service)) {
            Some(service) => service + u16::from(node % 18),
            None => u16::from_le_bytes([service, node]) & COB_ID_MAX,
        };
        let data = data.get(..usize::from(length % 9)).unwrap_or(data);
        let after = Duration::from_micros(500) * u32::from(after);
        Some(Step { after, frame: Frame::from_slice(cob_id, data)? })
    })
}

/// Identifiers of the predefined connection set.
const SERVICES: [u16; 16] = [
    0x000, 0x080, 0x100, 0x180, 0x200, 0x280, 0x300, 0x380, 0x400, 0x480, 0x500, 0x580, 0x600,
    0x700, 0x7E4, 0x7E5,
];

/// Returns the frame with the identifier of the transfer's node.
fn addressed(frame: &Frame, service: u16) -> Frame {
    Frame::from_slice(service + 1, frame.data()).unwrap()
}

fn node() -> NodeId {
    NodeId::new(1).unwrap()
}

/// Returns the plan of six drives and a switch box on one bus.
static CONFIG: LazyLock<Config> = LazyLock::new(|| {
    let file = Path::new("config/kraft_like_500hz.toml");
    Config::parse(file, include_str!("../../config/kraft_like_500hz.toml")).unwrap()
});

/// Returns these drives at power-up.
static DRIVES: LazyLock<Vec<Drive>> = LazyLock::new(|| {
    let free = include_str!("../../config/scenarios/free.toml");
    world::build(&CONFIG, Scenario::parse(free).unwrap(), 1).drives().to_vec()
});
