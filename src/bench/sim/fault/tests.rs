//! Laws of faults that hold for any device.

use std::time::Duration;

use proptest::prelude::*;

use crate::drivetrain::MotorReading;
use crate::fault::{Breakable, Devices, Direction, Faults};
use crate::scenario::Scenario;
use canopen::error_codes;
use canopen::frame::{Channel, Frame, Telegram};
use canopen_device::station::Station;
use faults::{LinkFault, Service};
use units::numbering::{Joint, NodeIndex};
use units::time::Instant;

/// Joint of the device at place 2.
const ELBOW: Joint = Joint::of::<3>();

/// First SYNC.
const ZERO: Instant = Instant::from_micros(5_000);

/// Device that sends given frames and records received ones.
#[derive(Debug)]
struct FakeDevice {
    channel: Channel,
    number: u16,
    to_send: Vec<Frame>,
    emergencies: Vec<(u16, u8)>,
    received: Vec<(Instant, Frame)>,
    is_on: bool,
    boots: u32,
    has_torque: bool,
}

impl Station for FakeDevice {
    fn on_frame(&mut self, now: Instant, _: Channel, frame: &Frame, _: &mut Vec<Telegram>) {
        self.received.push((now, *frame));
    }

    fn on_time(&mut self, _: Instant, out: &mut Vec<Telegram>) {
        let channel = self.channel;
        out.extend(self.to_send.drain(..).map(|frame| Telegram { channel, frame }));
    }

    fn deadline(&self) -> Option<Instant> {
        None
    }
}

impl Breakable for FakeDevice {
    fn send_emergency(&mut self, code: u16, register: u8) {
        self.emergencies.push((code, register));
    }

    fn channel(&self) -> Channel {
        self.channel
    }

    fn cob_id(&self, direction: Direction, service: Service) -> Option<u16> {
        match (direction, service) {
            (Direction::FromDevice, Service::Tpdo(1)) => Some(0x180 + self.number),
            (Direction::FromDevice, Service::Emergency) => Some(0x080 + self.number),
            (Direction::ToDevice, Service::Rpdo(1)) => Some(0x200 + self.number),
            _ => None,
        }
    }

    fn switch_off(&mut self) {
        self.is_on = false;
    }

    fn switch_on(&mut self, _: Instant) {
        self.is_on = true;
        self.boots += 1;
    }

    fn set_safe_torque_off(&mut self, is_on: bool) {
        self.has_torque = !is_on;
    }
}

/// Seven devices and their faults.
struct Network {
    faults: Faults,
    devices: [FakeDevice; 7],
    now: Instant,
}

impl Network {
    /// Creates devices at even places on bus 0 and at odd ones on bus 1, with a started script.
    fn with(faults: &str, seed: u64) -> Self {
        let script = Scenario::parse(&format!("seconds = 10\n{faults}")).unwrap();
        let device = |place: usize| FakeDevice {
            channel: Channel(u8::try_from(place % 2).unwrap()),
            number: u16::try_from(place + 1).unwrap(),
            to_send: Vec::new(),
            emergencies: Vec::new(),
            received: Vec::new(),
            is_on: true,
            boots: 0,
            has_torque: true,
        };
        let devices = std::array::from_fn(device);
        let mut faults = Faults::new(script.faults(), seed);
        assert_eq!(faults.deadline(), None, "nothing begins before the first SYNC");
        faults.begin(ZERO);
        Self { faults, devices, now: ZERO }
    }

    /// Lets time pass until `ms` after the first SYNC; returns the delayed frames with their times.
    fn run_until(&mut self, ms: f64) -> Vec<(Instant, Telegram)> {
        let until = ZERO + Duration::from_secs_f64(ms * 1e-3);
        let mut came = Vec::new();
        while let Some(due) = self.faults.deadline().filter(|due| *due <= until) {
            self.now = self.now.max(due);
            let mut out = Vec::new();
            let [a, b, c, d, e, f, g] = &mut self.devices;
            let mut devices: Devices<'_> =
                [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f), Some(g)];
            self.faults.on_time(self.now, &mut devices, &mut out);
            came.extend(out.into_iter().map(|telegram| (self.now, telegram)));
        }
        self.now = until;
        came
    }

    /// Sends a frame from the device at `place`; returns the frames on its bus.
    fn sent(&mut self, place: usize, frame: Frame) -> Vec<Frame> {
        let mut out = Vec::new();
        self.devices[place].to_send.push(frame);
        self.faults.wake(self.now, NodeIndex(place), &mut self.devices[place], &mut out);
        out.into_iter().map(|telegram| telegram.frame).collect()
    }

    /// Sends a frame on the bus of the device at `place`; returns the frames that it receives.
    fn received(&mut self, place: usize, frame: Frame) -> Vec<Frame> {
        let device = &mut self.devices[place];
        let telegram = Telegram { channel: device.channel, frame };
        device.received.clear();
        self.faults.deliver(self.now, NodeIndex(place), device, telegram, &mut Vec::new());
        device.received.iter().map(|(_, frame)| *frame).collect()
    }

    /// Returns whether frames pass to and from the device at `place`.
    fn is_on_bus(&mut self, place: usize) -> bool {
        let frame = Frame::new(0x123, [1]);
        let receives = self.received(place, frame) == [frame];
        assert_eq!(self.sent(place, frame) == [frame], receives);
        receives
    }
}

fn fault(keys: &str) -> String {
    format!("[[fault]]\nat_s = 1\n{}\n", keys.replace(", ", "\n"))
}

/// Frames with these COB-IDs, numbered in their data.
fn frames(identifiers: &[u16]) -> Vec<Frame> {
    let numbered = (0_u16..).zip(identifiers);
    numbered.map(|(number, cob_id)| Frame::new(*cob_id, number.to_le_bytes())).collect()
}

fn identifiers() -> impl Strategy<Value = Vec<u16>> {
    prop::collection::vec(prop::sample::select(vec![0x183, 0x283, 0x703]), 1..60)
}

proptest! {
    #[test]
    fn selected_frames_alone_are_dropped(ids in identifiers(), count in 1_usize..20) {
        let drop = format!("kind = \"drop\", joint = 3, frame = \"tpdo1\", count = {count}");
        let mut network = Network::with(&fault(&drop), 1);
        network.run_until(1_000.0);
        let mut struck = 0;
        for frame in frames(&ids) {
            struck += usize::from(frame.cob_id == 0x183);
            let is_lost = frame.cob_id == 0x183 && struck <= count;
            let comes = if is_lost { vec![] } else { vec![frame] };
            prop_assert_eq!(network.sent(2, frame), comes);
            prop_assert_eq!(network.sent(3, frame), vec![frame], "another device");
            prop_assert_eq!(network.received(2, frame), vec![frame], "the other way");
        }
    }

    #[test]
    fn delayed_frames_keep_their_order_unless_reordered(
        ids in identifiers(), by in 0.1..9.0_f64, share in 0.0..1.0_f64, reorder in any::<bool>(),
    ) {
        let delay = format!(
            "kind = \"delay\", joint = 3, delay_ms = {by}, share = {share}, reorder = {reorder}"
        );
        let mut network = Network::with(&fault(&delay), 7);
        network.run_until(1_000.0);
        let frames = frames(&ids);
        let mut came = Vec::new();
        for (number, frame) in (1..).zip(&frames) {
            came.extend(network.sent(2, *frame).into_iter().map(|frame| (network.now, frame)));
            let late = network.run_until(1_000.0 + f64::from(number));
            came.extend(late.iter().map(|(at, telegram)| (*at, telegram.frame)));
        }
        came.extend(network.run_until(2_000.0).iter().map(|(at, telegram)| (*at, telegram.frame)));
        prop_assert_eq!(came.len(), frames.len(), "no frame is lost");
        for (number, frame) in (0_u32..).zip(&frames) {
            let (at, _) = came.iter().find(|(_, came)| came == frame).unwrap();
            let sent = ZERO + Duration::from_millis(u64::from(1_000 + number));
            prop_assert!(at.since(sent) <= Duration::from_secs_f64(by * 1e-3));
        }
        let of = |cob_id: u16, frames: &mut dyn Iterator<Item = Frame>| -> Vec<Frame> {
            frames.filter(|frame| frame.cob_id == cob_id).collect()
        };
        for cob_id in [0x183, 0x283, 0x703] {
            let (sent, came) =
                (of(cob_id, &mut frames.iter().copied()), of(cob_id, &mut came.iter().map(|c| c.1)));
            prop_assert!(reorder || sent == came, "{:?} became {:?}", sent, came);
        }
    }

    #[test]
    fn bits_inverted_twice_are_unchanged(data in any::<[u8; 8]>(), xor in any::<u64>()) {
        let corrupt = format!("kind = \"corrupt\", joint = 3, xor = \"{xor:016X}\"");
        let mut once = Network::with(&fault(&corrupt), 1);
        once.run_until(1_000.0);
        let mut twice = Network::with(&fault(&corrupt).repeat(2), 1);
        twice.run_until(1_000.0);
        let frame = Frame::new(0x183, data);
        let turned = u64::from_be_bytes(data) ^ xor;
        prop_assert_eq!(once.sent(2, frame), vec![Frame::new(0x183, turned.to_be_bytes())]);
        prop_assert_eq!(twice.sent(2, frame), vec![frame]);
        let question = Frame::remote(0x183, 1);
        prop_assert_eq!(once.sent(2, question), vec![question], "it has no data");
    }
}

#[test]
fn ended_fault_leaves_no_trace() {
    let frame = Frame::new(0x183, [1, 2, 3, 4]);
    let sensed = MotorReading { position: 0.3, velocity: 0.2, per_mille: 100.0, temperature: 25.0 };
    for keys in [
        "kind = \"unplug\", joint = 3",
        "kind = \"wire_cut\", joint = 3",
        "kind = \"bus_off\", joint = 3",
        "kind = \"drop\", joint = 3",
        "kind = \"duplicate\", joint = 3",
        "kind = \"delay\", delay_ms = 2, joint = 3",
        "kind = \"corrupt\", xor = \"01\", joint = 3",
        "kind = \"resize\", bytes = 1, joint = 3",
        "kind = \"impersonate\", by = 3, joint = 5",
        "kind = \"sto\", joint = \"all\"",
        "kind = \"encoder_jump\", by_rad = 0.1, joint = 3",
        "kind = \"encoder_frozen\", joint = 3",
        "kind = \"torque_actual_scale\", scale = 0.5, joint = 3",
        "kind = \"switch_stuck\", switch = \"deadman_a\", level = \"high\"",
        "kind = \"link_loss\"",
        "kind = \"link_frozen\"",
    ] {
        let mut network = Network::with(&fault(&format!("{keys}, for_s = 1")), 1);
        let state = |network: &mut Network| {
            network.faults.sensed(ELBOW, MotorReading { position: -1.0, ..sensed });
            (
                (
                    network.sent(2, frame),
                    network.received(2, frame),
                    network.faults.sensed(ELBOW, sensed),
                ),
                (network.faults.inputs(0b10), network.faults.link(), network.devices[2].has_torque),
            )
        };
        let as_before = ((vec![frame], vec![frame], sensed), (0b10, None::<LinkFault>, true));
        assert_eq!(state(&mut network), as_before, "{keys}");
        network.run_until(1_000.0);
        assert_ne!(state(&mut network), as_before, "{keys}");
        network.run_until(2_010.0);
        assert_eq!(state(&mut network), as_before, "{keys}");
        assert_eq!(network.faults.deadline(), None, "{keys}");
        let notices = std::iter::from_fn(|| network.faults.next_notice());
        let notices: Vec<_> = notices.map(|one| (one.at.as_millis(), one.is_over)).collect();
        assert_eq!(notices, [(1_000, false), (2_000, true)], "{keys}");
    }
}

#[test]
fn frozen_frame_repeats_the_first_data() {
    let mut network = Network::with(&fault("kind = \"freeze\", joint = \"all\""), 1);
    network.run_until(1_000.0);
    let [first, second] = [1, 2].map(|number| Frame::new(0x183, [number]));
    let other = Frame::new(0x283, [9]);
    for place in [2, 4] {
        assert_eq!(network.sent(place, first), [first]);
        assert_eq!(network.sent(place, other), [other]);
        assert_eq!(network.sent(place, second), [first]);
    }
}

#[test]
fn cut_wire_disconnects_all_behind_it_on_its_bus() {
    let mut network = Network::with(&fault("kind = \"wire_cut\", joint = 3, for_s = 1"), 1);
    network.run_until(1_500.0);
    let on_bus = [0, 1, 2, 3, 4, 5, 6].map(|place| network.is_on_bus(place));
    assert_eq!(on_bus, [true, true, false, true, false, true, false]);
    assert!(network.devices.iter().all(|device| device.is_on), "they have their supply");
    assert_eq!(network.run_until(2_000.0), []);
    assert!((0..7).all(|place| network.is_on_bus(place)));
}

#[test]
fn device_plugged_in_boots_after_the_last_fault_has_ended() {
    let two = fault("kind = \"unplug\", joint = 3, for_s = 1")
        + &fault("kind = \"unplug\", joint = \"all\", for_s = 2");
    let mut network = Network::with(&two, 1);
    network.run_until(1_500.0);
    assert!((0..6).all(|place| !network.devices[place].is_on && !network.is_on_bus(place)));
    assert!(network.is_on_bus(6), "the switch box is no drive");
    network.run_until(2_500.0);
    assert!(!network.devices[2].is_on);
    network.run_until(3_000.0);
    assert!(network.devices[..6].iter().all(|device| device.is_on && device.boots == 1));
}

#[test]
fn device_back_from_bus_off_reports_8140h() {
    let mut network = Network::with(&fault("kind = \"bus_off\", joint = 4, for_s = 0.5"), 1);
    network.run_until(1_499.0);
    assert_eq!(network.devices[3].emergencies, []);
    network.run_until(1_500.0);
    assert_eq!(network.devices[3].emergencies, [(error_codes::RECOVERED_FROM_BUS_OFF, 0x11)]);
}

#[test]
fn emergency_is_sent_by_its_device() {
    let warning = fault("kind = \"emergency\", code = 0xFF10, register = 8, joint = 1");
    let mut network = Network::with(&warning, 1);
    network.run_until(1_000.0);
    assert_eq!(network.devices[0].emergencies, [(0xFF10, 8)]);
}

#[test]
fn fault_of_one_device_spares_the_frames_of_the_others() {
    for keys in ["kind = 'drop'\njoint = 3", "kind = 'unplug'\njoint = 3"] {
        let mut network = Network::with(&fault(keys), 1);
        network.run_until(1_000.0);
        for place in 0..7 {
            let frame = Frame::new(0x123, [1]);
            let passed = if place == 2 { vec![] } else { vec![frame] };
            assert_eq!(network.sent(place, frame), passed, "{keys}, from {place}");
            assert_eq!(network.received(place, frame), passed, "{keys}, to {place}");
        }
    }
}

#[test]
fn imitated_data_is_sent_under_the_other_cob_id() {
    let mut network = Network::with(&fault("kind = \"impersonate\", joint = 4, by = 3"), 1);
    network.run_until(1_000.0);
    assert_eq!(
        network.sent(2, Frame::new(0x183, [7])),
        [Frame::new(0x183, [7]), Frame::new(0x184, [7])]
    );
    assert_eq!(network.sent(2, Frame::new(0x283, [7])), [Frame::new(0x283, [7])]);
    assert_eq!(network.sent(3, Frame::new(0x184, [8])), [Frame::new(0x184, [8])]);
}

#[test]
fn foreign_frame_is_sent_at_its_period_until_its_end() {
    let foreign = "cob_id = 0x203, payload = \"0F00\", bus = 1, every_ms = 2.5, for_s = 0.01";
    let mut network = Network::with(&fault(&format!("kind = \"foreign_frame\", {foreign}")), 1);
    let sent = network.run_until(5_000.0);
    let times: Vec<_> = sent.iter().map(|(at, _)| at.since(ZERO).as_micros()).collect();
    assert_eq!(times, [1_000_000, 1_002_500, 1_005_000, 1_007_500]);
    let telegram = Telegram { channel: Channel(1), frame: Frame::new(0x203, [0x0F, 0]) };
    assert!(sent.iter().all(|(_, one)| *one == telegram));
    let mut network =
        Network::with(&fault("kind = \"foreign_nmt\", command = \"stop\", node_id = 3"), 1);
    let sent: Vec<_> = network.run_until(5_000.0).into_iter().map(|(_, one)| one.frame).collect();
    assert_eq!(sent, [Frame::new(0, [2, 3])]);
}

#[test]
fn random_sequence_of_a_fault_is_its_own() {
    let some = fault("kind = \"drop\", joint = 3, share = 0.4");
    let lost = |script: &str, seed| -> Vec<usize> {
        let mut network = Network::with(script, seed);
        network.run_until(1_500.0);
        let frame = Frame::new(0x183, [0]);
        for _ in 0..10 {
            network.sent(0, frame);
            network.faults.inputs(0);
        }
        (0..200).filter(|_| network.sent(2, frame).is_empty()).collect()
    };
    let alone = lost(&some, 1);
    assert!((50..110).contains(&alone.len()), "{} of 200", alone.len());
    assert_eq!(lost(&some, 1), alone);
    assert_ne!(lost(&some, 2), alone);
    let others = fault("kind = \"drop\", joint = 1, share = 0.5")
        + &fault("kind = \"switch_bounce\", switch = \"reference\"");
    assert_eq!(lost(&(some + &others), 1), alone);
}

#[test]
fn spent_fault_is_removed_when_the_next_one_starts() {
    let one = |joint| format!("kind = \"drop\", joint = {joint}, frame = \"tpdo1\", count = 1");
    let script = fault(&one(3)) + &fault(&one(3)).replace("at_s = 1", "at_s = 2");
    let mut network = Network::with(&script, 1);
    let frame = Frame::new(0x183, [1]);
    for (millis, lost) in [(1_000.0, [true, false]), (2_000.0, [true, false])] {
        network.run_until(millis);
        assert_eq!(network.faults.running.len(), 1, "{millis} ms");
        assert_eq!(lost.map(|_| network.sent(2, frame).is_empty()), lost, "{millis} ms");
    }
    let lasting = fault(&format!("{}, for_s = 2", one(3))) + &fault(&one(4));
    let mut network = Network::with(&lasting, 1);
    network.run_until(1_000.0);
    network.sent(2, frame);
    network.run_until(3_000.0);
    let ended = std::iter::from_fn(|| network.faults.next_notice()).filter(|notice| notice.is_over);
    assert_eq!(ended.count(), 1, "a fault with a duration still reports its end");
}

#[test]
fn without_faults_nothing_is_due_or_allocated() {
    let mut network = Network::with("", 1);
    assert_eq!(network.run_until(9_000.0), []);
    assert!(network.is_on_bus(2));
    let Faults { running, notices, sent, passed, .. } = &network.faults;
    let capacities = [running.capacity(), notices.capacity(), sent.capacity(), passed.capacity()];
    assert_eq!(capacities, [0; 4]);
}
