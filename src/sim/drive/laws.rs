//! A drive on a wire: what a master sees of it, whatever happens.

use super::*;
use crate::canopen::abort::AbortCode;
use crate::canopen::drive::Controlword;
use crate::canopen::drive::Goal;
use crate::canopen::drive::PowerStage;
use crate::canopen::drive::Statusword;
use crate::canopen::eds::Eds;
use crate::canopen::layout;
use crate::canopen::master::Master;
use crate::canopen::master::event::Event;
use crate::canopen::object::Object;
use crate::canopen::pdo::Counts;
use crate::canopen::pdo::DriveSample;
use crate::canopen::pdo::PerMille;
use crate::canopen::plan::Identity;
use crate::canopen::plan::NodePlan;
use crate::canopen::plan::Watch;
use crate::canopen::sync::Sync;
use proptest::prelude::*;

const BUS: Channel = Channel(0);
const MS: Duration = Duration::from_millis(1);
const RPDO_TIMER_MS: u16 = 5;
const MASTER_LOST_MS: u16 = 22;

const ACTUATOR: ActuatorSettings = ActuatorSettings {
    counts_per_rev: 16_384.0,
    gear_ratio: -40.0,
    zero_counts: 1_200,
    rated_torque: 0.1765,
    torque_curve: [133.144, -0.393_453, 0.019_672_6],
    max_torque: 6.0,
};

fn node() -> NodeId {
    NodeId::new(3).unwrap()
}

fn drive() -> Drive {
    let eds = Eds::parse(include_bytes!("../../../eds/frhc_drive.eds")).unwrap();
    Drive::new(DriveSettings {
        channel: BUS,
        node: node(),
        dictionary: Dictionary::new(&eds, node()),
        actuator: ACTUATOR,
        latency: Duration::from_micros(60),
        tuning: Tuning::default(),
    })
}

fn plan() -> NodePlan {
    let identity = Identity { vendor: 0x0F8C, product: 0x0402_0010, revision: 0x0001_0000 };
    let pdos = layout::per_drive(node(), Some(RPDO_TIMER_MS));
    let watch = Watch {
        master: NodeId::new(127).unwrap(),
        master_lost_ms: MASTER_LOST_MS,
        heartbeat_ms: 25,
        node_lost_ms: 60,
    };
    NodePlan::drive("joint 3".into(), node(), identity, pdos, &watch, 1_000)
}

/// TPDO1 of the layout with one frame each way.
fn sample(data: &[u8]) -> Option<DriveSample> {
    let &[s0, s1, p0, p1, p2, p3, t0, t1] = data else { return None };
    Some(DriveSample {
        statusword: Statusword(u16::from_le_bytes([s0, s1])),
        position: Counts(i32::from_le_bytes([p0, p1, p2, p3])),
        torque: PerMille(i16::from_le_bytes([t0, t1])),
    })
}

/// A drive and the master's side of its wire.
struct Wire {
    drive: Drive,
    /// What its motor does, which makes the torque it is asked for.
    motor: Sensed,
    now: Instant,
    stage: PowerStage,
    sample: DriveSample,
    emergencies: Vec<Frame>,
}

impl Wire {
    fn new() -> Self {
        Self {
            drive: drive(),
            motor: Sensed { temperature: 25.0, ..Sensed::default() },
            now: Instant::ZERO,
            stage: PowerStage::default(),
            sample: DriveSample::default(),
            emergencies: Vec::new(),
        }
    }

    /// The real master boots it, and nothing is missing.
    fn booted() -> Self {
        let mut wire = Self::new();
        let mut master = Master::new(vec![(BUS, plan())]);
        for _ in 0..5_000 {
            let (mut sent, mut event) = (Vec::new(), None);
            while let Some(due) = master.deadline().filter(|due| *due <= wire.now) {
                event = master.on_time(wire.now.max(due), &mut sent).or(event);
            }
            let mut answers = Vec::new();
            wire.drive.on_time(wire.now, &mut answers);
            while !sent.is_empty() || !answers.is_empty() {
                for Telegram { channel, frame } in sent.drain(..) {
                    wire.drive.on_frame(wire.now, channel, &frame, &mut answers);
                }
                for answer in answers.drain(..) {
                    event = master.on_frame(wire.now, &answer, &mut sent).or(event);
                }
            }
            match event {
                Some(Event::Booted) => return wire,
                Some(Event::BootFailed(error)) => panic!("{error}"),
                _ => wire.now = wire.now + MS,
            }
        }
        panic!("neither booted nor failed");
    }

    /// Whether there is torque on the joint.
    fn pushes(&self) -> bool {
        self.drive.demand().abs() > 0.0
    }

    /// What the drive says to a frame.
    fn say(&mut self, frame: Frame) {
        let mut said = Vec::new();
        self.drive.on_frame(self.now, BUS, &frame, &mut said);
        self.hear(&said);
    }

    /// The motor makes the torque it is asked for.
    fn turn(&mut self) {
        self.motor.per_mille = self.drive.demand();
        self.drive.sense(&self.motor);
    }

    /// A millisecond passes.
    fn pass(&mut self) {
        self.now = self.now + MS;
        self.turn();
        let mut said = Vec::new();
        self.drive.on_time(self.now, &mut said);
        self.hear(&said);
    }

    fn hear(&mut self, said: &[Telegram]) {
        for Telegram { frame, .. } in said {
            match frame.cob_id {
                // Until it is mapped, only the statusword is in it.
                0x183 => {
                    self.sample = sample(frame.data()).unwrap_or(self.sample);
                }
                0x083 => self.emergencies.push(*frame),
                _ => {}
            }
        }
    }

    fn write(&mut self, object: Object, bytes: [u8; 2]) {
        let [low, high] = object.index.to_le_bytes();
        self.say(Frame::new(0x603, [0x2B, low, high, 0, bytes[0], bytes[1], 0, 0]));
        assert_eq!(self.drive.dictionary().get(object), Some(&bytes[..]));
    }

    /// A cycle of a millisecond: SYNC, its TPDO, the RPDO for the next one.
    fn cycle(&mut self, goal: Goal, torque: i16) {
        self.say(Sync::default().frame());
        self.pass();
        let controlword = self.stage.controlword(self.sample.statusword.state(), goal);
        let [c0, c1] = controlword.0.to_le_bytes();
        let [t0, t1] = torque.to_le_bytes();
        self.say(Frame::new(0x203, [c0, c1, t0, t1]));
    }

    /// Booted and enabled, with this target.
    fn pushing(torque: i16) -> Self {
        let mut wire = Self::booted();
        for _ in 0..10 {
            wire.cycle(Goal::OperationEnabled, torque);
        }
        assert_eq!(wire.drive.state(), State::OperationEnabled);
        wire
    }
}

#[test]
fn the_master_boots_it_and_a_target_gives_its_torque_one_sync_later() {
    let mut wire = Wire::booted();
    assert_eq!(wire.drive.state(), State::SwitchOnDisabled);
    for _ in 0..5 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    wire.cycle(Goal::OperationEnabled, 500);
    assert!(!wire.pushes(), "it is held until the next SYNC");
    wire.say(Sync::default().frame());
    assert!((wire.drive.demand() - 500.0).abs() < 1e-9);
    wire.pass();
    assert_eq!(wire.sample.torque, PerMille(0), "its motor has yet to make it");
    wire.cycle(Goal::OperationEnabled, 500);
    assert_eq!(wire.sample.torque, PerMille(500));
    for _ in 0..2 {
        wire.cycle(Goal::VoltageDisabled, 500);
    }
    assert_eq!((wire.drive.state(), wire.pushes()), (State::SwitchOnDisabled, false));
}

#[test]
fn a_drive_without_rpdo_takes_its_torque_off_within_its_timer() {
    let mut wire = Wire::pushing(500);
    for _ in 1..RPDO_TIMER_MS {
        wire.say(Sync::default().frame());
        wire.pass();
    }
    assert!(wire.pushes());
    wire.pass();
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    assert_eq!(wire.drive.last_error(), 0x8250);
    let fault = wire.drive.dictionary().get(Object::STATUSWORD).unwrap().to_vec();
    let told = Frame::new(0x83, [0x50, 0x82, 0x11, 0, 0, fault[0], fault[1], 0]);
    assert_eq!(wire.emergencies, [told], "its torque, which is gone, and its state");
}

#[test]
fn a_drive_that_nobody_told_to_watch_holds_its_torque_for_ever() {
    let mut wire = Wire::new();
    wire.pass();
    wire.say(Frame::new(0, [1, 3]));
    wire.say(Frame::new(0x603, [0x2F, 0x60, 0x60, 0, 10, 0, 0, 0]));
    for word in [0x06, 0x07, 0x0F] {
        wire.write(Object::CONTROLWORD, [word, 0]);
    }
    wire.write(Object::TARGET_TORQUE, 500_i16.to_le_bytes());
    wire.say(Frame::new(0x77F, [5]));
    for _ in 0..10_000 {
        wire.pass();
    }
    assert!(wire.pushes());
    assert_eq!(wire.emergencies, []);
}

#[test]
fn a_lost_master_is_answered_as_6007h_says() {
    const SLOW_DOWN_AND_STAY: u8 = 5;
    for (option, state, is_on) in [
        (0, State::OperationEnabled, true),
        (1, State::Fault, false),
        (2, State::SwitchOnDisabled, false),
        (3, State::QuickStopActive, false),
    ] {
        let mut wire = Wire::pushing(500);
        wire.write(Object::ABORT_CONNECTION, [option, 0]);
        wire.write(Object::QUICK_STOP_OPTION, [SLOW_DOWN_AND_STAY, 0]);
        for _ in 0..100 {
            wire.motor.position = 0.1;
            wire.pass();
        }
        assert_eq!(wire.drive.state(), state, "6007h = {option}");
        assert_eq!(wire.pushes(), is_on, "6007h = {option}");
    }
}

#[test]
fn a_fault_is_reset_by_an_edge_and_the_bus_told_so() {
    let mut wire = Wire::pushing(500);
    wire.drive.fail_with(0x2310);
    wire.cycle(Goal::OperationEnabled, 0);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    for _ in 0..5 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::Fault, "nobody has asked for a reset");
    wire.stage.reset_fault();
    for _ in 0..8 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    let codes: Vec<_> = wire.emergencies.iter().map(|frame| frame.data()[..2].to_vec()).collect();
    assert_eq!(codes, [[0x10, 0x23], [0, 0]]);
}

#[test]
fn no_torque_without_the_mode_nor_above_the_limit() {
    let mut wire = Wire::pushing(500);
    wire.write(Object::MAX_TORQUE, 100_u16.to_le_bytes());
    assert_eq!(wire.drive.dictionary().i16(Object::TORQUE_DEMAND), 100);
    for _ in 0..3 {
        wire.cycle(Goal::OperationEnabled, -500);
    }
    assert_eq!(wire.sample.torque, PerMille(-100));
    assert!(wire.sample.statusword.has(Statusword::INTERNAL_LIMIT));
    wire.say(Frame::new(0x603, [0x2F, 0x60, 0x60, 0, 0, 0, 0, 0]));
    assert_eq!(wire.drive.dictionary().i8(Object::MODE_DISPLAY), 0);
    assert!(!wire.pushes());
}

#[test]
fn a_mode_it_does_not_have_is_refused() {
    let mut wire = Wire::new();
    wire.pass();
    let mut said = Vec::new();
    let request = Frame::new(0x603, [0x2F, 0x60, 0x60, 0, 7, 0, 0, 0]);
    wire.drive.on_frame(wire.now, BUS, &request, &mut said);
    let [low, .., high] = AbortCode::VALUE_INVALID.0.to_le_bytes();
    let data = said[0].frame.data().to_vec();
    assert_eq!((data[0], data[4], data[7]), (0x80, low, high));
}

#[test]
fn its_tpdo_says_where_the_joint_was_at_the_sync() {
    let mut wire = Wire::pushing(0);
    wire.motor.position = 0.5;
    wire.turn();
    wire.say(Sync::default().frame());
    wire.motor.position = 0.7;
    wire.pass();
    let turns = 0.5 / std::f64::consts::TAU * -40.0 * 16_384.0;
    let counts = f64::from(wire.sample.position.0 - 1_200);
    assert!((counts - turns).abs() <= 0.5);
}

#[test]
fn a_reset_node_is_as_after_power_up_but_for_where_its_joint_is() {
    let mut wire = Wire::pushing(500);
    wire.motor.position = 0.5;
    wire.turn();
    let position = wire.drive.dictionary().get(Object::POSITION_ACTUAL).map(<[u8]>::to_vec);
    wire.say(Frame::new(0, [0x81, 3]));
    assert_eq!((wire.drive.state(), wire.pushes()), (State::NotReadyToSwitchOn, false));
    wire.pass();
    assert_eq!((wire.drive.state(), wire.pushes()), (State::SwitchOnDisabled, false));
    let after = wire.drive.dictionary().get(Object::POSITION_ACTUAL).map(<[u8]>::to_vec);
    assert_eq!(after, position);
    assert_eq!(wire.drive.dictionary().unsigned(Object::RATED_TORQUE), 177);
    assert_eq!(wire.drive.last_error(), 0);
}

#[test]
fn what_is_unplugged_neither_hears_nor_speaks() {
    let mut wire = Wire::pushing(500);
    wire.drive.unplug();
    wire.sample = DriveSample::default();
    for _ in 0..10 {
        wire.cycle(Goal::VoltageDisabled, 0);
    }
    assert_eq!((wire.sample, wire.emergencies.len()), (DriveSample::default(), 0));
}

/// The statusword, as its object holds it.
fn statusword(wire: &Wire) -> Statusword {
    Statusword(wire.drive.dictionary().i16(Object::STATUSWORD).cast_unsigned())
}

/// The codes of the emergencies, and their error registers.
fn told(wire: &Wire) -> Vec<(u16, u8)> {
    let bytes = wire.emergencies.iter().map(|frame| frame.data().to_vec());
    bytes.map(|data| (u16::from_le_bytes([data[0], data[1]]), data[2])).collect()
}

/// How many ms it stays in `state`, up to 10 s, while its RPDO timer is fed and the controlword is `word`.
fn stays(wire: &mut Wire, state: State, word: Controlword) -> usize {
    let lasts = (0..10_000).take_while(|_| {
        let [c0, c1] = word.0.to_le_bytes();
        wire.say(Frame::new(0x77F, [5]));
        wire.say(Frame::new(0x203, [c0, c1, 0xF4, 1]));
        wire.say(Sync::default().frame());
        wire.pass();
        wire.drive.state() == state
    });
    lasts.count()
}

/// 6087h is 10,000 ‰/s by default: 500 ‰ are gone in 50 ms.
const SLOPE_MS: std::ops::RangeInclusive<usize> = 48..=52;

#[test]
fn a_torque_is_slowed_down_before_operation_is_left_where_the_option_codes_say_so() {
    const SLOW_DOWN: [u8; 2] = [1, 0];
    for (object, word, during, end) in [
        (
            Object::SHUTDOWN_OPTION,
            Controlword::SHUTDOWN,
            State::OperationEnabled,
            State::ReadyToSwitchOn,
        ),
        (
            Object::DISABLE_OPERATION_OPTION,
            Controlword::SWITCH_ON,
            State::OperationEnabled,
            State::SwitchedOn,
        ),
        (
            Object::QUICK_STOP_OPTION,
            Controlword::QUICK_STOP,
            State::QuickStopActive,
            State::SwitchOnDisabled,
        ),
    ] {
        let mut wire = Wire::pushing(500);
        wire.write(object, SLOW_DOWN);
        let lasts = stays(&mut wire, during, word);
        assert!(SLOPE_MS.contains(&lasts), "{object}: {lasts} ms");
        assert_eq!((wire.drive.state(), wire.pushes()), (end, false), "{object}");
        let mut wire = Wire::pushing(500);
        assert!(stays(&mut wire, during, word) <= 1, "the master has set {object} to 0");
        assert_eq!((wire.drive.state(), wire.pushes()), (end, false), "{object}");
    }
}

#[test]
fn a_fault_reaction_is_told_when_it_begins_and_is_a_fault_when_it_ends() {
    let mut wire = Wire::pushing(500);
    wire.write(Object::FAULT_REACTION, [1, 0]);
    wire.drive.fail_with(0x2310);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::FaultReactionActive, true));
    let lasts = stays(&mut wire, State::FaultReactionActive, Controlword::ENABLE_OPERATION);
    assert!(SLOPE_MS.contains(&lasts), "{lasts} ms");
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    assert_eq!(told(&wire), [(0x2310, 0x03)]);
}

#[test]
fn a_halted_drive_stays_enabled_without_torque_and_goes_on_when_it_may() {
    const HALT: Controlword = Controlword(Controlword::ENABLE_OPERATION.0 | 1 << 8);
    let mut wire = Wire::pushing(500);
    let mut halted = 0;
    while wire.pushes() {
        stays(&mut wire, State::Fault, HALT);
        halted += 1;
    }
    assert!(SLOPE_MS.contains(&halted), "{halted} ms");
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    stays(&mut wire, State::Fault, HALT);
    assert!(!wire.pushes(), "its target is still 500");
    stays(&mut wire, State::Fault, Controlword::ENABLE_OPERATION);
    stays(&mut wire, State::Fault, Controlword::ENABLE_OPERATION);
    assert!(wire.pushes());
}

#[test]
fn safe_torque_off_takes_the_torque_at_once_and_holds_its_fault() {
    let mut wire = Wire::pushing(500);
    wire.write(Object::FAULT_REACTION, [1, 0]);
    wire.drive.set_safe_torque_off(true);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    assert!(!statusword(&wire).has(Statusword::VOLTAGE_ENABLED));
    assert_eq!(wire.drive.dictionary().unsigned(Object::DRIVE_INPUTS), 1 << 3);
    wire.stage.reset_fault();
    for _ in 0..8 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::Fault, "its cause is still there");
    wire.drive.set_safe_torque_off(false);
    for _ in 0..8 {
        wire.cycle(Goal::VoltageDisabled, 0);
    }
    assert_eq!(wire.drive.state(), State::Fault, "nobody has asked for a reset since");
    wire.stage.reset_fault();
    for _ in 0..8 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    assert!(statusword(&wire).has(Statusword::VOLTAGE_ENABLED));
    assert_eq!(told(&wire), [(0x8A88, 0x21), (0, 0)]);
}

#[test]
fn safe_torque_off_is_there_after_power_up() {
    let mut wire = Wire::new();
    wire.drive.set_safe_torque_off(true);
    assert_eq!(wire.drive.state(), State::NotReadyToSwitchOn);
    wire.pass();
    assert_eq!((wire.drive.state(), wire.drive.last_error()), (State::Fault, 0x8A88));
}

#[test]
fn a_hot_winding_warns_and_then_is_a_fault_until_it_has_cooled() {
    let mut wire = Wire::pushing(500);
    wire.motor.temperature = 112.34;
    wire.cycle(Goal::OperationEnabled, 500);
    assert!(statusword(&wire).has(Statusword::WARNING) && wire.pushes());
    assert_eq!(wire.drive.dictionary().i16(Object::WINDING_TEMPERATURE), 1_123);
    wire.motor.temperature = 121.0;
    wire.cycle(Goal::OperationEnabled, 500);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    assert_eq!(told(&wire), [(0x4310, 0x09)]);
    for (temperature, state) in [(121.0, State::Fault), (25.0, State::OperationEnabled)] {
        wire.motor.temperature = temperature;
        wire.stage.reset_fault();
        for _ in 0..8 {
            wire.cycle(Goal::OperationEnabled, 0);
        }
        assert_eq!(wire.drive.state(), state, "{temperature} °C");
    }
}

#[test]
fn a_motor_that_runs_away_trips_and_one_that_is_turned_by_hand_does_not() {
    let too_fast = 1.2 * 6_000.0 / 60.0 * std::f64::consts::TAU / 40.0;
    let mut wire = Wire::booted();
    wire.motor.velocity = too_fast;
    wire.cycle(Goal::VoltageDisabled, 0);
    assert_eq!(wire.drive.state(), State::SwitchOnDisabled);
    let mut wire = Wire::pushing(500);
    wire.motor.velocity = too_fast / 1.2;
    wire.cycle(Goal::OperationEnabled, 500);
    assert!(wire.pushes());
    wire.motor.velocity = -too_fast;
    wire.cycle(Goal::OperationEnabled, 500);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    assert_eq!(told(&wire), [(0x7310, 0x21)]);
}

#[test]
fn a_link_without_voltage_gives_no_torque_whatever_the_fault_reaction() {
    let mut wire = Wire::pushing(500);
    wire.write(Object::FAULT_REACTION, [1, 0]);
    wire.drive.set_link_voltage(20.0);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    assert_eq!(wire.drive.dictionary().unsigned(Object::LINK_VOLTAGE), 20_000);
    wire.pass();
    assert_eq!(told(&wire), [(0x3220, 0x05)]);
}

#[test]
fn a_mode_comes_into_force_at_once_but_not_while_the_drive_stops() {
    let mut wire = Wire::pushing(500);
    assert_eq!(wire.drive.mode(), 10);
    wire.write(Object::QUICK_STOP_OPTION, [5, 0]);
    wire.write(Object::CONTROLWORD, [2, 0]);
    let set = |wire: &mut Wire, mode| {
        wire.say(Frame::new(0x603, [0x2F, 0x60, 0x60, 0, mode, 0, 0, 0]));
        wire.drive.dictionary().i8(Object::MODE_DISPLAY)
    };
    assert_eq!(set(&mut wire, 4), 10);
    wire.write(Object::CONTROLWORD, [0x0F, 0]);
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    assert_eq!(wire.drive.dictionary().i8(Object::MODE_DISPLAY), 4);
    assert_eq!(set(&mut wire, 10), 10);
}

#[test]
fn what_is_switched_on_again_boots_up_and_knows_nothing() {
    let mut wire = Wire::pushing(500);
    wire.drive.unplug();
    wire.pass();
    wire.drive.switch_on(wire.now);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::NotReadyToSwitchOn, false));
    let mut said = Vec::new();
    wire.drive.on_time(wire.now, &mut said);
    assert!(said.iter().any(|telegram| telegram.frame == Frame::new(0x703, [0])), "its boot-up");
    assert_eq!(wire.drive.state(), State::SwitchOnDisabled);
    assert_eq!(wire.drive.dictionary().i16(Object::ABORT_CONNECTION), 0);
}

#[test]
fn its_terminals_are_in_60fdh() {
    let mut wire = Wire::new();
    wire.drive.set_inputs(0x0002_0005);
    assert_eq!(wire.drive.dictionary().unsigned(Object::DRIVE_INPUTS), 0x0002_0005);
    wire.pass();
    wire.say(Frame::new(0, [0x81, 3]));
    assert_eq!(wire.drive.dictionary().unsigned(Object::DRIVE_INPUTS), 0x0002_0005);
}

/// What may happen to a drive.
#[derive(Clone, Copy, Debug)]
enum Happening {
    Word(u16),
    Target(i16),
    Mode(u8),
    Set(Object, i16),
    Pass(u8),
    Fail(u16),
    TorqueOff(bool),
    Voltage(f64),
    Motor(f64, f64),
    Loss,
    Reset,
}

fn happening() -> impl Strategy<Value = Happening> {
    let words = [0x00, 0x02, 0x06, 0x07, 0x0F, 0x0F, 0x0F, 0x1F, 0x80, 0x10F];
    let ways = [
        (Object::ABORT_CONNECTION, 3),
        (Object::QUICK_STOP_OPTION, 8),
        (Object::SHUTDOWN_OPTION, 1),
        (Object::DISABLE_OPERATION_OPTION, 1),
        (Object::HALT_OPTION, 4),
        (Object::FAULT_REACTION, 4),
        (Object::MAX_TORQUE, 3_000),
        (Object::MAX_CURRENT, 3_000),
        (Object::POSITIVE_TORQUE_LIMIT, 3_000),
        (Object::NEGATIVE_TORQUE_LIMIT, 3_000),
    ];
    let set =
        (prop::sample::select(ways.to_vec()), 0..=1_000_i32).prop_map(|((object, most), part)| {
            let value = i16::try_from(most * part / 1_000).unwrap();
            Happening::Set(object, value)
        });
    prop_oneof![
        8 => prop::sample::select(words.to_vec()).prop_map(Happening::Word),
        1 => any::<u16>().prop_map(Happening::Word),
        3 => (-3_000..=3_000_i16).prop_map(Happening::Target),
        1 => prop::sample::select(vec![0, 1, 3, 4, 6, 8, 9, 10, 10, 10]).prop_map(Happening::Mode),
        3 => set,
        4 => (0..60_u8).prop_map(Happening::Pass),
        1 => any::<u16>().prop_map(Happening::Fail),
        1 => any::<bool>().prop_map(Happening::TorqueOff),
        1 => (20.0..70.0_f64).prop_map(Happening::Voltage),
        1 => (-25.0..25.0_f64, 0.0..130.0_f64).prop_map(|(velocity, heat)| Happening::Motor(velocity, heat)),
        1 => Just(Happening::Loss),
        1 => Just(Happening::Reset),
    ]
}

impl Wire {
    /// Out of the box and operational, in cyclic torque mode.
    fn started() -> Self {
        let mut wire = Self::new();
        wire.pass();
        wire.start();
        wire
    }

    fn start(&mut self) {
        self.say(Frame::new(0, [1, 3]));
        self.happen(Happening::Mode(10));
    }

    fn download(&mut self, object: Object, bytes: &[u8]) {
        let [low, high] = object.index.to_le_bytes();
        let [b0, b1] = [bytes[0], bytes.get(1).copied().unwrap_or(0)];
        let command = if bytes.len() == 1 { 0x2F } else { 0x2B };
        self.say(Frame::new(0x603, [command, low, high, object.sub, b0, b1, 0, 0]));
    }

    fn happen(&mut self, happening: Happening) {
        match happening {
            Happening::Word(word) => self.download(Object::CONTROLWORD, &word.to_le_bytes()),
            Happening::Target(target) => {
                self.download(Object::TARGET_TORQUE, &target.to_le_bytes())
            }
            Happening::Mode(mode) => self.download(Object::MODE_OF_OPERATION, &[mode]),
            Happening::Set(object, value) => self.download(object, &value.to_le_bytes()),
            Happening::Pass(ms) => (0..ms).for_each(|_| self.pass()),
            Happening::Fail(code) => self.drive.fail_with(code),
            Happening::TorqueOff(is_off) => self.drive.set_safe_torque_off(is_off),
            Happening::Voltage(volts) => self.drive.set_link_voltage(volts),
            Happening::Motor(velocity, temperature) => {
                self.motor = Sensed { velocity, temperature, ..self.motor };
                self.turn();
            }
            // To be stopped in operation is to lose the master.
            Happening::Loss => {
                self.say(Frame::new(0, [2, 3]));
                self.say(Frame::new(0, [1, 3]));
            }
            Happening::Reset => {
                self.say(Frame::new(0, [0x81, 3]));
                self.start();
            }
        }
    }
}

proptest! {
    #[test]
    fn whatever_happens_torque_is_within_its_limits_and_only_where_there_may_be_some(
        happenings in proptest::collection::vec(happening(), 1..120),
    ) {
        let mut wire = Wire::started();
        for happening in happenings {
            wire.happen(happening);
            let (state, demand) = (wire.drive.state(), wire.drive.demand());
            prop_assert_eq!(statusword(&wire).state(), Some(state), "{:?}", happening);
            let may_push = matches!(
                state,
                State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive
            );
            prop_assert!(may_push || demand.abs() <= 0.0, "{demand} ‰ in {state}");
            let limit = |object| f64::from(wire.drive.dictionary().unsigned(object));
            let both = limit(Object::MAX_TORQUE).min(limit(Object::MAX_CURRENT));
            prop_assert!(demand <= both.min(limit(Object::POSITIVE_TORQUE_LIMIT)), "{:?}", happening);
            prop_assert!(-demand <= both.min(limit(Object::NEGATIVE_TORQUE_LIMIT)), "{:?}", happening);
        }
    }

    #[test]
    fn every_stop_is_over_in_bounded_time(
        happenings in proptest::collection::vec(happening(), 1..60),
        last in prop::sample::select(vec![
            Happening::Word(0x02), Happening::Word(0x06), Happening::Word(0x07), Happening::Word(0x10F),
            Happening::Fail(0x2310),
        ]),
    ) {
        let mut wire = Wire::started();
        happenings.into_iter().for_each(|happening| wire.happen(happening));
        // The slowest there is.
        wire.say(Frame::new(0x603, [0x23, 0x87, 0x60, 0, 1, 0, 0, 0]));
        wire.happen(last);
        for _ in 0..21 {
            wire.happen(Happening::Pass(100));
        }
        prop_assert!(!wire.pushes(), "{:?}", wire.drive.state());
        prop_assert!(wire.drive.state() != State::FaultReactionActive);
    }
}
