//! Tests of a complete device by its frames: a drive's dictionary, and an application that records its calls.

mod error_control;
mod errors;
mod identity;
mod kept;
mod pdos;
mod process;
mod refusals;
mod stored;

use std::sync::LazyLock;
use std::time::Duration;

use canopen_rs::NmtCommand;
use proptest::prelude::*;

use super::*;
use crate::dictionary::Entry;
use crate::parameter::Place;
use canopen::abort::AbortCode;
use canopen::eds::Eds;
use canopen::layout::Direction;
use canopen::nmt::Order;
use canopen::object::Object;
use canopen::sdo::{Outcome, SdoError, Transfer};
use canopen::sync::Sync;

/// Application that records its calls.
#[derive(Clone, Debug, Default)]
struct Recorder {
    lost: Vec<ConnectionLoss>,
    resets: Vec<Reset>,
    written: Vec<Object>,
    code: u16,
}

impl Application for Recorder {
    fn written(&mut self, _dictionary: &mut Dictionary, object: Object) {
        self.written.push(object);
    }

    fn on_connection_lost(&mut self, _dictionary: &mut Dictionary, why: ConnectionLoss) -> [u8; 5] {
        self.lost.push(why);
        [1, 2, 3, 4, 5]
    }

    fn on_reset(&mut self, _dictionary: &mut Dictionary, reset: Reset) {
        self.resets.push(reset);
    }

    fn error_code(&self) -> u16 {
        self.code
    }
}

const NODE: u8 = 5;
const RPDO: u16 = 0x205;
const TPDO: u16 = 0x185;
const OFF: u32 = 1 << 31;
const MASTER_FOR_20_MS: u32 = 0x007F_0014;

fn at(millis: u64) -> Instant {
    Instant::from_micros(millis * 1_000)
}

/// Device under test, and its time.
struct Fixture {
    device: Device<Recorder>,
    now: Instant,
}

impl Fixture {
    /// Device after boot-up.
    fn new() -> Self {
        static EDS: LazyLock<Eds> =
            LazyLock::new(|| Eds::parse(include_bytes!("../../../eds/frhc_drive.eds")).unwrap());
        Self::from_eds(&EDS)
    }

    /// Device of another EDS, after boot-up.
    fn described(text: &str) -> Self {
        Self::from_eds(&Eds::parse(text.as_bytes()).unwrap())
    }

    fn from_eds(eds: &Eds) -> Self {
        let node = NodeId::new(NODE).unwrap();
        let dictionary = Dictionary::new(eds, node);
        let device = Device::new(node, dictionary, Recorder::default(), Duration::ZERO);
        let mut fixture = Self { device, now: at(0) };
        assert_eq!(fixture.wait_until(0), [Frame::new(0x705, [0])], "boot-up");
        fixture
    }

    /// Device after boot-up with every PDO disabled.
    fn silent() -> Self {
        let mut fixture = Self::new();
        for direction in [Direction::Receive, Direction::Transmit] {
            let places: Vec<_> = Place::all(fixture.device.dictionary(), direction).collect();
            for place in places {
                fixture.write(place.communication(1), &OFF.to_le_bytes()).unwrap();
            }
        }
        fixture
    }

    /// Frames sent in reply to a frame.
    fn deliver(&mut self, frame: Frame) -> Vec<Frame> {
        let mut out = Vec::new();
        self.device.on_frame(self.now, &frame, &mut out);
        out
    }

    /// Returns the frames sent until `millis`, without received frames.
    fn wait_until(&mut self, millis: u64) -> Vec<Frame> {
        let mut out = Vec::new();
        while let Some(due) = self.device.deadline().filter(|due| *due <= at(millis)) {
            self.now = self.now.max(due);
            self.device.on_time(self.now, &mut out);
        }
        self.now = at(millis);
        out
    }

    fn order(&mut self, command: NmtCommand) -> Vec<Frame> {
        self.deliver(Order::to(NodeId::new(NODE).unwrap(), command).frame())
    }

    fn sync(&mut self) -> Vec<Frame> {
        self.deliver(Sync::default().frame())
    }

    /// Runs a transfer of the master's SDO client to its end.
    fn carry(&mut self, mut transfer: Transfer, mut requests: Vec<Frame>) -> Outcome {
        loop {
            let replies: Vec<_> =
                requests.drain(..).flat_map(|frame| self.deliver(frame)).collect();
            assert!(!replies.is_empty(), "no reply");
            for reply in replies {
                if let Some(outcome) = transfer.on_frame(self.now, &reply, &mut requests) {
                    return outcome;
                }
            }
        }
    }

    fn read(&mut self, object: Object) -> Result<Vec<u8>, AbortCode> {
        let (node, timeout, mut out) = (NodeId::new(NODE).unwrap(), WAIT, Vec::new());
        let transfer = Transfer::read(node, object, timeout, self.now, &mut out);
        self.carry(transfer, out).map(|content| content.bytes().to_vec()).map_err(refusal)
    }

    fn write(&mut self, object: Object, bytes: &[u8]) -> Result<(), AbortCode> {
        let (node, bytes, mut out) = (NodeId::new(NODE).unwrap(), bytes.to_vec(), Vec::new());
        let transfer = Transfer::write(node, object, bytes, WAIT, self.now, &mut out).unwrap();
        self.carry(transfer, out).map(|_| ()).map_err(refusal)
    }

    /// Maps the PDO of `place` again: disable, clear, fill, count, transmission type, enable.
    fn map(&mut self, place: Place, entries: &[u32], transmission: u8) -> Result<(), AbortCode> {
        let cob_id = match place.direction {
            Direction::Receive => u32::from(RPDO),
            Direction::Transmit => u32::from(TPDO),
        };
        self.write(place.communication(1), &(OFF | cob_id).to_le_bytes())?;
        self.write(place.mapping(0), &[0])?;
        for (sub, entry) in (1..).zip(entries) {
            self.write(place.mapping(sub), &entry.to_le_bytes())?;
        }
        self.write(place.mapping(0), &[u8::try_from(entries.len()).unwrap()])?;
        self.write(place.communication(2), &[transmission])?;
        self.write(place.communication(1), &cob_id.to_le_bytes())
    }

    /// Operational device with the target torque alone in RPDO1, of this transmission type.
    fn with_target(transmission: u8) -> Self {
        let mut fixture = Self::silent();
        fixture.map(RPDO1, &[TARGET], transmission).unwrap();
        fixture.order(NmtCommand::StartRemoteNode);
        fixture
    }

    fn target(&self) -> i16 {
        self.device.dictionary().i16(Object::TARGET_TORQUE)
    }
}

const WAIT: Duration = Duration::from_millis(100);
const RPDO1: Place = Place { direction: Direction::Receive, number: 1 };
const TPDO1: Place = Place { direction: Direction::Transmit, number: 1 };
const TARGET: u32 = 0x6071_0010;
const DUMMY_16: u32 = 0x0003_0010;
const POSITION: u32 = 0x6064_0020;
const EVERY_SYNC: u8 = 1;
const AT_ONCE: u8 = 255;

fn refusal(error: SdoError) -> AbortCode {
    let SdoError::AbortedByServer(code) = error else { panic!("not refused but {error}") };
    code
}

fn emergency(code: u16, register: u8, manufacturer: [u8; 5]) -> Frame {
    let [c0, c1] = code.to_le_bytes();
    let [a, b, c, d, e] = manufacturer;
    Frame::new(0x85, [c0, c1, register, a, b, c, d, e])
}

#[test]
fn wrong_accesses_have_the_right_abort_codes() {
    let mut fixture = Fixture::new();
    let no_such_sub = Object { sub: 9, ..Object::VENDOR_ID };
    let no_such_index = Object { index: 0x5FFF, sub: 0 };
    assert_eq!(fixture.read(no_such_index), Err(AbortCode::NO_OBJECT));
    assert_eq!(fixture.read(no_such_sub), Err(AbortCode::NO_SUB_INDEX));
    let writes: [(Object, &[u8], AbortCode); 12] = [
        (no_such_index, &[0], AbortCode::NO_OBJECT),
        (no_such_sub, &[0], AbortCode::NO_SUB_INDEX),
        (Object::STATUSWORD, &[0, 0], AbortCode::READ_ONLY),
        (Object::DEVICE_NAME, b"another name", AbortCode::READ_ONLY),
        (Object::CONTROLWORD, &[0], AbortCode::LENGTH_TOO_LOW),
        (Object::CONTROLWORD, &[0, 0, 0], AbortCode::LENGTH_TOO_HIGH),
        (Object::CONTROLWORD, &[0; 9], AbortCode::LENGTH_TOO_HIGH),
        (Object::TARGET_TORQUE, &[0xB9, 0x0B], AbortCode::VALUE_TOO_HIGH),
        (Object::TARGET_TORQUE, &[0x47, 0xF4], AbortCode::VALUE_TOO_LOW),
        (Object::ERROR_HISTORY, &[1], AbortCode::VALUE_INVALID),
        (Object::CONSUMER_HEARTBEAT, &[20, 0, 127, 1], AbortCode::VALUE_INVALID),
        (Object::EMCY_COB_ID, &[0x83, 6, 0, 0], AbortCode::DEVICE_STATE),
    ];
    for (object, bytes, code) in writes {
        assert_eq!(fixture.write(object, bytes), Err(code), "{object} {bytes:X?}");
    }
}

#[test]
fn device_name_is_read_in_segments() {
    let mut fixture = Fixture::new();
    let name = fixture.device.dictionary().get(Object::DEVICE_NAME).unwrap().to_vec();
    assert!(name.len() > 7, "more than a segment");
    assert_eq!(fixture.read(Object::DEVICE_NAME), Ok(name));
}

#[test]
fn stopped_node_sends_its_heartbeat_only() {
    let mut fixture = Fixture::with_target(EVERY_SYNC);
    fixture.order(NmtCommand::StopRemoteNode);
    assert_eq!(fixture.device.application().lost, [ConnectionLoss::Stopped]);
    assert_eq!(fixture.deliver(Frame::new(0x605, [0x40, 0, 0x10, 0, 0, 0, 0, 0])), []);
    assert_eq!(fixture.sync(), []);
    fixture.device.touch(|application, _| application.code = 0x2310);
    assert_eq!(fixture.wait_until(100), []);
}

#[test]
fn communication_reset_restores_defaults() {
    let changes: [(Object, &[u8]); 4] = [
        (Object::PRODUCER_HEARTBEAT, &[25, 0]),
        (Object::CONSUMER_HEARTBEAT, &[20, 0, 127, 0]),
        (Object::ABORT_CONNECTION, &[1, 0]),
        (Object::MAX_TORQUE, &[1, 0]),
    ];
    for (command, reset, kept) in [
        (NmtCommand::ResetCommunication, Reset::Communication, 2),
        (NmtCommand::ResetNode, Reset::Node, 0),
    ] {
        let mut fixture = Fixture::new();
        let before = fixture.device.dictionary().clone();
        fixture.map(RPDO1, &[TARGET], AT_ONCE).unwrap();
        for (object, bytes) in changes {
            fixture.write(object, bytes).unwrap();
        }
        fixture.deliver(Frame::new(0x77F, [5]));
        assert_eq!(fixture.order(command), [Frame::new(0x705, [0])]);
        assert_eq!(fixture.device.state(), NmtState::PreOperational);
        assert_eq!(fixture.wait_until(1_000), [], "no heartbeat, and no consumer");
        assert_eq!(fixture.device.application().resets, [Reset::Node, reset]);
        let now = fixture.device.dictionary();
        let differs = |(object, _): &&(Object, &[u8])| now.get(*object) != before.get(*object);
        assert_eq!(changes.iter().filter(differs).count(), kept, "{command:?}");
        assert_eq!(now.get(RPDO1.mapping(1)), before.get(RPDO1.mapping(1)));
    }
}

#[test]
fn application_error_is_reported_cleared_and_recorded() {
    let mut fixture = Fixture::new();
    let have = |fixture: &mut Fixture, code| {
        fixture.device.touch(|application, _| application.code = code);
        fixture.wait_until(1)
    };
    assert_eq!(have(&mut fixture, 0x2310), [emergency(0x2310, 0x03, [0; 5])]);
    assert_eq!(have(&mut fixture, 0x2310), []);
    assert_eq!(fixture.read(Object::ERROR_REGISTER), Ok(vec![0x03]));
    assert_eq!(have(&mut fixture, 0), [emergency(0, 0, [0; 5])]);
    assert_eq!(have(&mut fixture, 0x4310), [emergency(0x4310, 0x09, [0; 5])]);
    let newest = Object { sub: 1, ..Object::ERROR_HISTORY };
    let before = Object { sub: 2, ..Object::ERROR_HISTORY };
    assert_eq!(fixture.read(Object::ERROR_HISTORY), Ok(vec![2]));
    assert_eq!(fixture.read(newest), Ok(vec![0x10, 0x43, 0, 0]));
    assert_eq!(fixture.read(before), Ok(vec![0x10, 0x23, 0, 0]));
    fixture.write(Object::ERROR_HISTORY, &[0]).unwrap();
    assert_eq!(fixture.read(Object::ERROR_HISTORY), Ok(vec![0]));
    assert_eq!(fixture.read(newest), Err(AbortCode::NO_DATA), "no error recorded");
}

#[test]
fn full_history_drops_the_oldest_error() {
    let mut fixture = Fixture::new();
    for number in 1..=20_u16 {
        fixture.device.touch(|application, _| application.code = 0x2300 + number);
        fixture.wait_until(u64::from(number));
    }
    assert_eq!(fixture.read(Object::ERROR_HISTORY), Ok(vec![8]));
    for (sub, number) in (1..=8).zip((13..=20).rev()) {
        let place = Object { sub, ..Object::ERROR_HISTORY };
        assert_eq!(fixture.read(place), Ok(vec![number, 0x23, 0, 0]));
    }
}

#[test]
fn emergency_uses_its_moved_cob_id() {
    let mut fixture = Fixture::new();
    fixture.write(Object::EMCY_COB_ID, &(OFF | 0x685).to_le_bytes()).unwrap();
    fixture.device.touch(|application, _| application.code = 0x2310);
    assert_eq!(fixture.wait_until(1), [], "off");
    fixture.write(Object::EMCY_COB_ID, &0x685_u32.to_le_bytes()).unwrap();
    fixture.device.touch(|application, _| application.code = 0);
    assert_eq!(fixture.wait_until(2).first().map(|frame| frame.cob_id), Some(0x685));
}

proptest! {
    #[test]
    fn any_frames_never_panic_and_get_bounded_replies(
        steps in proptest::collection::vec(
            (
                0_u64..30_000,
                prop::sample::select(vec![0x000_u16, 0x080, 0x205, 0x305, 0x605, 0x605, 0x605, 0x77F, 0x123]),
                proptest::collection::vec(any::<u8>(), 0..9),
                prop::sample::select(vec![0x1003_u16, 0x1005, 0x1014, 0x1016, 0x1017, 0x1029, 0x1400, 0x1600, 0x1800, 0x1A00, 0x6040]),
                any::<bool>(),
            ),
            0..200,
        ),
    ) {
        let mut fixture = Fixture::new();
        fixture.order(NmtCommand::StartRemoteNode);
        for (step, cob_id, mut data, index, shaped) in steps {
            fixture.now = fixture.now + Duration::from_micros(step);
            if let ([command, low, high, sub, ..], true) = (&mut data[..], shaped) {
                *command = [0x23, 0x2B, 0x2F, 0x40, 0x21, 0x00, 0x60, 0x01][usize::from(*command & 7)];
                [*low, *high] = index.to_le_bytes();
                *sub &= 7;
            }
            let mut out = Vec::new();
            fixture.device.on_time(fixture.now, &mut out);
            fixture.device.on_frame(fixture.now, &Frame::from_slice(cob_id, &data).unwrap(), &mut out);
            prop_assert!(out.len() <= 16, "{out:?}");
            fixture.device.on_time(fixture.now, &mut out);
            let due = fixture.device.deadline();
            prop_assert!(due.is_none_or(|due| due > fixture.now), "on_time leaves nothing due");
        }
    }
}
