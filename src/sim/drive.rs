//! A CiA 402 drive in cyclic synchronous torque mode, with the dangerous defaults of real ones: out of
//! the box it watches nobody and holds its last torque for ever.
//!
//! The motor is no part of it: the plant says where the joint is and asks for its torque.

use std::time::Duration;

use crate::canopen::NodeId;
use crate::canopen::abort::AbortCode;
use crate::canopen::device::Application;
use crate::canopen::device::ConnectionLoss;
use crate::canopen::device::Device;
use crate::canopen::device::Reset;
use crate::canopen::dictionary::Dictionary;
use crate::canopen::drive::CYCLIC_SYNCHRONOUS_TORQUE;
use crate::canopen::drive::Controlword;
use crate::canopen::drive::State;
use crate::canopen::drive::Statusword;
use crate::canopen::frame::Channel;
use crate::canopen::frame::Frame;
use crate::canopen::frame::Telegram;
use crate::canopen::object::Object;
use crate::canopen::station::Station;
use crate::sim::actuator::ActuatorSettings;
use crate::sim::actuator::Encoder;
use crate::sim::drivetrain::Sensed;
use crate::sim::personality;
use crate::sim::personality::Makeup;
use crate::sim::personality::Personality;
use crate::sim::personality::Wire;
use crate::sim::power::Power;
use crate::time::Instant;

/// What one drive is made of.
#[derive(Clone, Debug)]
pub struct DriveSettings {
    /// Its bus.
    pub channel: Channel,
    /// Where it is on it.
    pub node: NodeId,
    /// Its objects, with their defaults.
    pub dictionary: Dictionary,
    /// Its motor, gear and encoder.
    pub actuator: ActuatorSettings,
    /// How long after the SYNC its TPDOs are sent.
    pub latency: Duration,
}

/// One drive.
#[derive(Clone, Debug)]
pub struct Drive {
    channel: Channel,
    is_plugged: bool,
    device: Device<Axis>,
    wire: Wire,
    /// What the device has said, and what of it has reached the bus; kept, so that nothing is allocated.
    frames: Vec<Frame>,
    said: Vec<Frame>,
}

impl Drive {
    /// A drive that is switched on.
    pub fn new(settings: DriveSettings) -> Self {
        Self::with(settings, &Personality::default())
    }

    /// The same, with a personality.
    pub fn with(settings: DriveSettings, personality: &Personality) -> Self {
        let DriveSettings { channel, node, dictionary, actuator, latency } = settings;
        let Makeup { dictionary, manners, habits, torque_at_start } =
            Makeup::of(personality, dictionary, node);
        let axis = Axis {
            encoder: Encoder::new(&actuator),
            rated_torque: actuator.rated_millis(),
            power: Power::default(),
            error: 0,
            position: actuator.zero_counts,
            velocity: 0,
            target: 0,
        };
        let mut device = Device::new(node, dictionary, axis, latency).behaving(manners);
        if let Some(torque) = torque_at_start {
            device.touch(|axis, dictionary| personality::begin(torque, axis, dictionary));
        }
        Self {
            channel,
            is_plugged: true,
            device,
            wire: Wire::new(habits),
            frames: Vec::with_capacity(FRAMES),
            said: Vec::with_capacity(FRAMES),
        }
    }

    /// Where it is on its bus.
    pub const fn node(&self) -> NodeId {
        self.device.node()
    }

    /// What its motor does now.
    pub fn sense(&mut self, sensed: &Sensed) {
        self.device.touch(|axis, dictionary| {
            axis.position = axis.encoder.counts(sensed.position);
            axis.velocity = axis.encoder.rate(sensed.velocity);
            axis.show_motion(dictionary);
        });
    }

    /// What it asks of its motor, in ‰ of rated torque.
    pub fn demand(&self) -> f64 {
        f64::from(self.device.application().target)
    }

    /// The state of its power stage.
    pub const fn state(&self) -> State {
        self.device.application().power.state()
    }

    /// The code of the last error (603Fh), 0 for none since power-up or reset.
    pub const fn last_error(&self) -> u16 {
        self.device.application().error
    }

    /// Something breaks in the drive that only its statusword tells of.
    pub fn fail(&mut self) {
        self.fail_with(0);
    }

    /// Something breaks in the drive, and an emergency tells of it with this error code; 0 for none.
    pub fn fail_with(&mut self, code: u16) {
        self.device.touch(|axis, dictionary| {
            axis.error = code;
            axis.power.fail();
            axis.refresh(dictionary);
        });
    }

    /// Takes it off its bus: it hears and says nothing any more.
    pub const fn unplug(&mut self) {
        self.is_plugged = false;
    }

    /// Its objects, as they are now.
    pub const fn dictionary(&self) -> &Dictionary {
        self.device.dictionary()
    }
}

impl Drive {
    fn send(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        let channel = self.channel;
        self.wire.carry(now, &self.device, self.frames.drain(..), &mut self.said);
        let said = self.said.drain(..).filter(|_| self.is_plugged);
        out.extend(said.map(|frame| Telegram { channel, frame }));
    }
}

/// Room for what a device says at once.
const FRAMES: usize = 8;

impl Station for Drive {
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        if channel == self.channel && self.is_plugged && self.wire.hears(now) {
            self.device.on_frame(now, frame, &mut self.frames);
            self.send(now, out);
        }
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        self.device.on_time(now, &mut self.frames);
        self.send(now, out);
    }

    fn deadline(&self) -> Option<Instant> {
        self.device.deadline().into_iter().chain(self.wire.deadline()).min()
    }
}

/// The drive proper, behind its communication.
#[derive(Clone, Debug)]
struct Axis {
    encoder: Encoder,
    /// Of the motor, in mN·m.
    rated_torque: u32,
    power: Power,
    /// Last error.
    error: u16,
    /// In counts.
    position: i32,
    /// In counts/s.
    velocity: i32,
    /// What the power stage gives, in per mille of rated torque.
    target: i16,
}

impl Application for Axis {
    fn may_write(
        &mut self,
        dictionary: &Dictionary,
        object: Object,
        bytes: &[u8],
    ) -> Result<(), AbortCode> {
        let is_known = match (object, bytes) {
            (Object::MODE_OF_OPERATION, &[mode]) => has_mode(dictionary, mode),
            (Object::ABORT_CONNECTION, &[low, high]) => {
                matches!(i16::from_le_bytes([low, high]), 0..=3)
            }
            (Object::QUICK_STOP_OPTION, &[low, high]) => {
                matches!(i16::from_le_bytes([low, high]), 0..=8)
            }
            (Object::SHUTDOWN_OPTION | Object::DISABLE_OPERATION_OPTION, &[low, high]) => {
                matches!(i16::from_le_bytes([low, high]), 0..=1)
            }
            (Object::HALT_OPTION | Object::FAULT_REACTION, &[low, high]) => {
                matches!(i16::from_le_bytes([low, high]), 0..=4)
            }
            _ => true,
        };
        if is_known { Ok(()) } else { Err(AbortCode::VALUE_INVALID) }
    }

    fn written(&mut self, dictionary: &mut Dictionary, object: Object) {
        if object == Object::CONTROLWORD {
            let word = Controlword(word(dictionary, Object::CONTROLWORD));
            self.power.obey(word, dictionary.i16(Object::QUICK_STOP_OPTION));
            // 605Dh 0: a halt is a loss of power.
            let is_enabled = self.power.state() == State::OperationEnabled;
            if is_enabled && self.power.is_halted() && dictionary.i16(Object::HALT_OPTION) == 0 {
                self.power.disable_voltage();
            }
        }
        self.refresh(dictionary);
    }

    fn on_connection_lost(&mut self, dictionary: &mut Dictionary, why: ConnectionLoss) -> [u8; 5] {
        self.error = why.error_code();
        match dictionary.i16(Object::ABORT_CONNECTION) {
            1 => self.power.fail(),
            2 => self.power.disable_voltage(),
            3 => self.power.quick_stop(dictionary.i16(Object::QUICK_STOP_OPTION)),
            _ => {}
        }
        self.refresh(dictionary);
        let [t0, t1] = self.target.to_le_bytes();
        let [s0, s1] = word(dictionary, Object::STATUSWORD).to_le_bytes();
        [t0, t1, s0, s1, 0]
    }

    fn on_reset(&mut self, dictionary: &mut Dictionary, reset: Reset) {
        if reset == Reset::Node {
            self.power = Power::default();
            self.error = 0;
            dictionary.set(Object::RATED_TORQUE, &self.rated_torque.to_le_bytes());
            self.show_motion(dictionary);
        }
        self.refresh(dictionary);
    }

    fn error_code(&self) -> u16 {
        if self.power.state() == State::Fault { self.error } else { 0 }
    }
}

impl Axis {
    /// The torque, and all objects that tell of the drive, follow from its state and its targets.
    fn refresh(&mut self, dictionary: &mut Dictionary) {
        let mode = dictionary.i8(Object::MODE_OF_OPERATION);
        let follows = self.power.state() == State::OperationEnabled
            && mode == CYCLIC_SYNCHRONOUS_TORQUE
            && !self.power.is_halted();
        let wanted = if follows { dictionary.i16(Object::TARGET_TORQUE) } else { 0 };
        let max = word(dictionary, Object::MAX_TORQUE);
        let max = i16::try_from(max).unwrap_or(i16::MAX);
        let target = wanted.clamp(-max, max);
        self.target = target;
        let mut statusword = self.power.statusword().0 | Statusword::REMOTE;
        if follows {
            statusword |= Statusword::TARGET_FOLLOWED;
        }
        if target != wanted {
            statusword |= Statusword::INTERNAL_LIMIT;
        }
        dictionary.set(Object::STATUSWORD, &statusword.to_le_bytes());
        dictionary.set(Object::MODE_DISPLAY, &mode.to_le_bytes());
        dictionary.set(Object::TORQUE_ACTUAL, &target.to_le_bytes());
        dictionary.set(Object::ERROR_CODE, &self.error.to_le_bytes());
    }

    fn show_motion(&self, dictionary: &mut Dictionary) {
        dictionary.set(Object::POSITION_ACTUAL, &self.position.to_le_bytes());
        dictionary.set(Object::VELOCITY_ACTUAL, &self.velocity.to_le_bytes());
    }
}

/// Whether the drive has a mode of operation (6502h, mode 1 at bit 0); mode 0 is none, and any has it.
fn has_mode(dictionary: &Dictionary, mode: u8) -> bool {
    let modes = u64::from(dictionary.unsigned(Object::SUPPORTED_MODES)) << 1 | 1;
    modes.checked_shr(u32::from(mode)).is_some_and(|modes| modes & 1 == 1)
}

/// An object of 16 bits; zero if it is not there.
fn word(dictionary: &Dictionary, object: Object) -> u16 {
    let [low, high, ..] = dictionary.unsigned(object).to_le_bytes();
    u16::from_le_bytes([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::drive::Goal;
    use crate::canopen::drive::PowerStage;
    use crate::canopen::eds::Eds;
    use crate::canopen::layout;
    use crate::canopen::master::Master;
    use crate::canopen::master::event::Event;
    use crate::canopen::pdo::Counts;
    use crate::canopen::pdo::DriveSample;
    use crate::canopen::pdo::PerMille;
    use crate::canopen::plan::Identity;
    use crate::canopen::plan::NodePlan;
    use crate::canopen::plan::Watch;
    use crate::canopen::sync::Sync;

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

    fn at(position: f64) -> Sensed {
        Sensed { position, ..Sensed::default() }
    }

    fn drive() -> Drive {
        let eds = Eds::parse(include_bytes!("../../eds/frhc_drive.eds")).unwrap();
        Drive::new(DriveSettings {
            channel: BUS,
            node: node(),
            dictionary: Dictionary::new(&eds, node()),
            actuator: ACTUATOR,
            latency: Duration::from_micros(60),
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
        now: Instant,
        stage: PowerStage,
        sample: DriveSample,
        emergencies: Vec<Frame>,
    }

    impl Wire {
        fn new() -> Self {
            Self {
                drive: drive(),
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

        /// A millisecond passes.
        fn pass(&mut self) {
            self.now = self.now + MS;
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
                wire.pass();
                wire.drive.sense(&at(0.1));
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
        let codes: Vec<_> =
            wire.emergencies.iter().map(|frame| frame.data()[..2].to_vec()).collect();
        assert_eq!(codes, [[0x10, 0x23], [0, 0]]);
    }

    #[test]
    fn no_torque_without_the_mode_nor_above_the_limit() {
        let mut wire = Wire::pushing(500);
        wire.write(Object::MAX_TORQUE, 100_u16.to_le_bytes());
        assert_eq!(wire.drive.dictionary().i16(Object::TORQUE_ACTUAL), 100);
        wire.cycle(Goal::OperationEnabled, -500);
        wire.cycle(Goal::OperationEnabled, -500);
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
        let request = Frame::new(0x603, [0x2F, 0x60, 0x60, 0, 8, 0, 0, 0]);
        wire.drive.on_frame(wire.now, BUS, &request, &mut said);
        let [low, .., high] = AbortCode::VALUE_INVALID.0.to_le_bytes();
        let data = said[0].frame.data().to_vec();
        assert_eq!((data[0], data[4], data[7]), (0x80, low, high));
    }

    #[test]
    fn its_tpdo_says_where_the_joint_was_at_the_sync() {
        let mut wire = Wire::pushing(0);
        wire.drive.sense(&at(0.5));
        wire.say(Sync::default().frame());
        wire.drive.sense(&at(0.7));
        wire.pass();
        let turns = 0.5 / std::f64::consts::TAU * -40.0 * 16_384.0;
        let counts = f64::from(wire.sample.position.0 - 1_200);
        assert!((counts - turns).abs() <= 0.5);
    }

    #[test]
    fn a_reset_node_is_as_after_power_up_but_for_where_its_joint_is() {
        let mut wire = Wire::pushing(500);
        wire.drive.sense(&at(0.5));
        let position = wire.drive.dictionary().get(Object::POSITION_ACTUAL).map(<[u8]>::to_vec);
        wire.say(Frame::new(0, [0x81, 3]));
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
}
