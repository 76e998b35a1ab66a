//! What holds of faults, whatever the devices are.

use std::time::Duration;

use proptest::prelude::*;

use crate::drivetrain::Sensed;
use crate::fault::Breakable;
use crate::fault::Devices;
use crate::fault::Faults;
use crate::fault::Way;
use crate::scenario::Scenario;
use crate::scenario::fault::Link;
use crate::scenario::fault::Service;
use canopen::error_codes;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::frame::Telegram;
use canopen::station::Station;
use units::numbering::Joint;
use units::numbering::NodeIndex;
use units::time::Instant;

/// The first SYNC.
const ZERO: Instant = Instant::from_micros(5_000);

/// Says what it is given, and keeps what it hears.
#[derive(Debug)]
struct Talker {
    channel: Channel,
    number: u16,
    says: Vec<Frame>,
    mentioned: Vec<(u16, u8)>,
    heard: Vec<(Instant, Frame)>,
    is_on: bool,
    boots: u32,
    torque: bool,
}

impl Station for Talker {
    fn on_frame(&mut self, now: Instant, _: Channel, frame: &Frame, _: &mut Vec<Telegram>) {
        self.heard.push((now, *frame));
    }

    fn on_time(&mut self, _: Instant, out: &mut Vec<Telegram>) {
        let channel = self.channel;
        out.extend(self.says.drain(..).map(|frame| Telegram { channel, frame }));
    }

    fn deadline(&self) -> Option<Instant> {
        None
    }
}

impl Breakable for Talker {
    fn report_transient_error(&mut self, code: u16, register: u8) {
        self.mentioned.push((code, register));
    }

    fn channel(&self) -> Channel {
        self.channel
    }

    fn cob_id(&self, way: Way, service: Service) -> Option<u16> {
        match (way, service) {
            (Way::Said, Service::Tpdo(1)) => Some(0x180 + self.number),
            (Way::Said, Service::Emergency) => Some(0x080 + self.number),
            (Way::Heard, Service::Rpdo(1)) => Some(0x200 + self.number),
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
        self.torque = !is_on;
    }
}

/// Seven of them, and what breaks.
struct Room {
    faults: Faults,
    talkers: [Talker; 7],
    now: Instant,
}

impl Room {
    /// The even places on bus 0, the odd ones on bus 1; the script has begun.
    fn of(faults: &str, seed: u64) -> Self {
        let script = Scenario::parse(&format!("seconds = 10\n{faults}")).unwrap();
        let talker = |place: usize| Talker {
            channel: Channel(u8::try_from(place % 2).unwrap()),
            number: u16::try_from(place + 1).unwrap(),
            says: Vec::new(),
            mentioned: Vec::new(),
            heard: Vec::new(),
            is_on: true,
            boots: 0,
            torque: true,
        };
        let talkers = std::array::from_fn(talker);
        let mut faults = Faults::new(script.faults(), seed);
        assert_eq!(faults.deadline(), None, "nothing begins before the first SYNC");
        faults.begin(ZERO);
        Self { faults, talkers, now: ZERO }
    }

    /// Time passes until `ms` after the first SYNC; what comes late, and when.
    fn pass(&mut self, ms: f64) -> Vec<(Instant, Telegram)> {
        let until = ZERO + Duration::from_secs_f64(ms * 1e-3);
        let mut came = Vec::new();
        while let Some(due) = self.faults.deadline().filter(|due| *due <= until) {
            self.now = self.now.max(due);
            let mut out = Vec::new();
            let [a, b, c, d, e, f, g] = &mut self.talkers;
            let mut devices: Devices<'_> = [a, b, c, d, e, f, g];
            self.faults.turn(self.now, &mut devices, &mut out);
            came.extend(out.into_iter().map(|telegram| (self.now, telegram)));
        }
        self.now = until;
        came
    }

    /// What comes of what the device at `place` says now.
    fn says(&mut self, place: usize, frame: Frame) -> Vec<Frame> {
        let mut out = Vec::new();
        self.talkers[place].says.push(frame);
        self.faults.wake(self.now, NodeIndex(place), &mut self.talkers[place], &mut out);
        out.into_iter().map(|telegram| telegram.frame).collect()
    }

    /// What the device at `place` hears of a frame on its bus.
    fn hears(&mut self, place: usize, frame: Frame) -> Vec<Frame> {
        let talker = &mut self.talkers[place];
        let telegram = Telegram { channel: talker.channel, frame };
        talker.heard.clear();
        self.faults.hear(self.now, NodeIndex(place), talker, telegram, &mut Vec::new());
        talker.heard.iter().map(|(_, frame)| *frame).collect()
    }

    /// Whether the device at `place` hears and is heard.
    fn is_on_bus(&mut self, place: usize) -> bool {
        let frame = Frame::new(0x123, [1]);
        let heard = self.hears(place, frame) == [frame];
        assert_eq!(self.says(place, frame) == [frame], heard);
        heard
    }
}

fn fault(keys: &str) -> String {
    format!("[[fault]]\nat_s = 1\n{}\n", keys.replace(", ", "\n"))
}

/// So many frames of a few identifiers, each with a number of its own.
fn frames(identifiers: &[u16]) -> Vec<Frame> {
    let numbered = (0_u16..).zip(identifiers);
    numbered.map(|(number, cob_id)| Frame::new(*cob_id, number.to_le_bytes())).collect()
}

fn identifiers() -> impl Strategy<Value = Vec<u16>> {
    prop::collection::vec(prop::sample::select(vec![0x183, 0x283, 0x703]), 1..60)
}

proptest! {
    #[test]
    fn lost_are_exactly_those_selected(ids in identifiers(), count in 1_usize..20) {
        let drop = format!("kind = \"drop\", joint = 3, frame = \"tpdo1\", count = {count}");
        let mut room = Room::of(&fault(&drop), 1);
        room.pass(1_000.0);
        let mut struck = 0;
        for frame in frames(&ids) {
            struck += usize::from(frame.cob_id == 0x183);
            let is_lost = frame.cob_id == 0x183 && struck <= count;
            let comes = if is_lost { vec![] } else { vec![frame] };
            prop_assert_eq!(room.says(2, frame), comes);
            prop_assert_eq!(room.says(3, frame), vec![frame], "another device");
            prop_assert_eq!(room.hears(2, frame), vec![frame], "the other way");
        }
    }

    #[test]
    fn what_is_late_keeps_its_order_unless_told_otherwise(
        ids in identifiers(), by in 0.1..9.0_f64, share in 0.0..1.0_f64, reorder in any::<bool>(),
    ) {
        let delay = format!(
            "kind = \"delay\", joint = 3, delay_ms = {by}, share = {share}, reorder = {reorder}"
        );
        let mut room = Room::of(&fault(&delay), 7);
        room.pass(1_000.0);
        let frames = frames(&ids);
        let mut came = Vec::new();
        for (number, frame) in (1..).zip(&frames) {
            came.extend(room.says(2, *frame).into_iter().map(|frame| (room.now, frame)));
            let late = room.pass(1_000.0 + f64::from(number));
            came.extend(late.iter().map(|(at, telegram)| (*at, telegram.frame)));
        }
        came.extend(room.pass(2_000.0).iter().map(|(at, telegram)| (*at, telegram.frame)));
        prop_assert_eq!(came.len(), frames.len(), "none is lost");
        for (number, frame) in (0_u32..).zip(&frames) {
            let (at, _) = came.iter().find(|(_, came)| came == frame).unwrap();
            let said = ZERO + Duration::from_millis(u64::from(1_000 + number));
            prop_assert!(at.since(said) <= Duration::from_secs_f64(by * 1e-3));
        }
        let of = |cob_id: u16, frames: &mut dyn Iterator<Item = Frame>| -> Vec<Frame> {
            frames.filter(|frame| frame.cob_id == cob_id).collect()
        };
        for cob_id in [0x183, 0x283, 0x703] {
            let (said, came) =
                (of(cob_id, &mut frames.iter().copied()), of(cob_id, &mut came.iter().map(|c| c.1)));
            prop_assert!(reorder || said == came, "{:?} became {:?}", said, came);
        }
    }

    #[test]
    fn bits_turned_over_twice_are_as_before(data in any::<[u8; 8]>(), xor in any::<u64>()) {
        let corrupt = format!("kind = \"corrupt\", joint = 3, xor = \"{xor:016X}\"");
        let mut once = Room::of(&fault(&corrupt), 1);
        once.pass(1_000.0);
        let mut twice = Room::of(&fault(&corrupt).repeat(2), 1);
        twice.pass(1_000.0);
        let frame = Frame::new(0x183, data);
        let turned = u64::from_be_bytes(data) ^ xor;
        prop_assert_eq!(once.says(2, frame), vec![Frame::new(0x183, turned.to_be_bytes())]);
        prop_assert_eq!(twice.says(2, frame), vec![frame]);
        let question = Frame::remote(0x183, 1);
        prop_assert_eq!(once.says(2, question), vec![question], "it has no data");
    }
}

#[test]
fn after_its_time_all_is_as_before() {
    let frame = Frame::new(0x183, [1, 2, 3, 4]);
    let sensed = Sensed { position: 0.3, velocity: 0.2, per_mille: 100.0, temperature: 25.0 };
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
        let mut room = Room::of(&fault(&format!("{keys}, for_s = 1")), 1);
        let state = |room: &mut Room| {
            room.faults.sensed(Joint::of::<3>(), Sensed { position: -1.0, ..sensed });
            (
                (
                    room.says(2, frame),
                    room.hears(2, frame),
                    room.faults.sensed(Joint::of::<3>(), sensed),
                ),
                (room.faults.inputs(0b10), room.faults.link(), room.talkers[2].torque),
            )
        };
        let as_before = ((vec![frame], vec![frame], sensed), (0b10, Link::Up, true));
        assert_eq!(state(&mut room), as_before, "{keys}");
        room.pass(1_000.0);
        assert_ne!(state(&mut room), as_before, "{keys}");
        room.pass(2_010.0);
        assert_eq!(state(&mut room), as_before, "{keys}");
        assert_eq!(room.faults.deadline(), None, "{keys}");
        let told: Vec<_> = std::iter::from_fn(|| room.faults.notice()).collect();
        let told: Vec<_> = told.iter().map(|told| (told.at.as_millis(), told.is_over)).collect();
        assert_eq!(told, [(1_000, false), (2_000, true)], "{keys}");
    }
}

#[test]
fn a_frozen_frame_says_for_ever_what_the_first_one_said() {
    let mut room = Room::of(&fault("kind = \"freeze\", joint = \"all\""), 1);
    room.pass(1_000.0);
    let [first, second] = [1, 2].map(|number| Frame::new(0x183, [number]));
    let other = Frame::new(0x283, [9]);
    for place in [2, 4] {
        assert_eq!(room.says(place, first), [first]);
        assert_eq!(room.says(place, other), [other]);
        assert_eq!(room.says(place, second), [first]);
    }
}

#[test]
fn a_cut_wire_takes_along_all_behind_it_on_its_bus() {
    let mut room = Room::of(&fault("kind = \"wire_cut\", joint = 3, for_s = 1"), 1);
    room.pass(1_500.0);
    let on_bus = [0, 1, 2, 3, 4, 5, 6].map(|place| room.is_on_bus(place));
    assert_eq!(on_bus, [true, true, false, true, false, true, false]);
    assert!(room.talkers.iter().all(|talker| talker.is_on), "they have their supply");
    assert_eq!(room.pass(2_000.0), []);
    assert!((0..7).all(|place| room.is_on_bus(place)));
}

#[test]
fn who_has_its_plug_back_boots_up_but_not_before_the_last_fault_is_over() {
    let two = fault("kind = \"unplug\", joint = 3, for_s = 1")
        + &fault("kind = \"unplug\", joint = \"all\", for_s = 2");
    let mut room = Room::of(&two, 1);
    room.pass(1_500.0);
    assert!((0..6).all(|place| !room.talkers[place].is_on && !room.is_on_bus(place)));
    assert!(room.is_on_bus(6), "the switch box is no drive");
    room.pass(2_500.0);
    assert!(!room.talkers[2].is_on);
    room.pass(3_000.0);
    assert!(room.talkers[..6].iter().all(|talker| talker.is_on && talker.boots == 1));
}

#[test]
fn who_is_back_from_bus_off_tells_so() {
    let mut room = Room::of(&fault("kind = \"bus_off\", joint = 4, for_s = 0.5"), 1);
    room.pass(1_499.0);
    assert_eq!(room.talkers[3].mentioned, []);
    room.pass(1_500.0);
    assert_eq!(room.talkers[3].mentioned, [(error_codes::RECOVERED_FROM_BUS_OFF, 0x11)]);
}

#[test]
fn an_emergency_is_told_by_its_device() {
    let warning = fault("kind = \"emergency\", code = 0xFF10, register = 8, joint = 1");
    let mut room = Room::of(&warning, 1);
    room.pass(1_000.0);
    assert_eq!(room.talkers[0].mentioned, [(0xFF10, 8)]);
}

#[test]
fn the_words_of_one_come_again_under_the_name_of_another() {
    let mut room = Room::of(&fault("kind = \"impersonate\", joint = 4, by = 3"), 1);
    room.pass(1_000.0);
    assert_eq!(
        room.says(2, Frame::new(0x183, [7])),
        [Frame::new(0x183, [7]), Frame::new(0x184, [7])]
    );
    assert_eq!(room.says(2, Frame::new(0x283, [7])), [Frame::new(0x283, [7])]);
    assert_eq!(room.says(3, Frame::new(0x184, [8])), [Frame::new(0x184, [8])]);
}

#[test]
fn a_stranger_says_its_frame_at_its_times_and_no_longer() {
    let stranger = "cob_id = 0x203, payload = \"0F00\", bus = 1, every_ms = 2.5, for_s = 0.01";
    let mut room = Room::of(&fault(&format!("kind = \"foreign_frame\", {stranger}")), 1);
    let said = room.pass(5_000.0);
    let times: Vec<_> = said.iter().map(|(at, _)| at.since(ZERO).as_micros()).collect();
    assert_eq!(times, [1_000_000, 1_002_500, 1_005_000, 1_007_500]);
    let telegram = Telegram { channel: Channel(1), frame: Frame::new(0x203, [0x0F, 0]) };
    assert!(said.iter().all(|(_, told)| *told == telegram));
    let mut room = Room::of(&fault("kind = \"foreign_nmt\", command = \"stop\", node_id = 3"), 1);
    let said: Vec<_> = room.pass(5_000.0).into_iter().map(|(_, told)| told.frame).collect();
    assert_eq!(said, [Frame::new(0, [2, 3])]);
}

#[test]
fn the_chances_of_a_fault_are_its_own() {
    let some = fault("kind = \"drop\", joint = 3, share = 0.4");
    let lost = |script: &str, seed| -> Vec<usize> {
        let mut room = Room::of(script, seed);
        room.pass(1_500.0);
        let frame = Frame::new(0x183, [0]);
        for _ in 0..10 {
            room.says(0, frame);
            room.faults.inputs(0);
        }
        (0..200).filter(|_| room.says(2, frame).is_empty()).collect()
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
    let mut room = Room::of(&script, 1);
    let frame = Frame::new(0x183, [1]);
    for (millis, lost) in [(1_000.0, [true, false]), (2_000.0, [true, false])] {
        room.pass(millis);
        assert_eq!(room.faults.running.len(), 1, "{millis} ms");
        assert_eq!(lost.map(|_| room.says(2, frame).is_empty()), lost, "{millis} ms");
    }
    let lasting = fault(&format!("{}, for_s = 2", one(3))) + &fault(&one(4));
    let mut room = Room::of(&lasting, 1);
    room.pass(1_000.0);
    room.says(2, frame);
    room.pass(3_000.0);
    let ended = std::iter::from_fn(|| room.faults.notice()).filter(|notice| notice.is_over);
    assert_eq!(ended.count(), 1, "a fault with a duration still reports its end");
}

#[test]
fn without_faults_nothing_is_due_and_no_room_is_taken() {
    let mut room = Room::of("", 1);
    assert_eq!(room.pass(9_000.0), []);
    assert!(room.is_on_bus(2));
    let Faults { running, notices, said, passed, .. } = &room.faults;
    let rooms = [running.capacity(), notices.capacity(), said.capacity(), passed.capacity()];
    assert_eq!(rooms, [0; 4]);
}
