//! A simulated CiA 402 drive in cyclic synchronous torque mode, on the bus and on a joint.
//!
//! On the bus it is a [`Device`] with the dictionary of its EDS; on the joint it exerts what its target
//! torque gives through its torque curve. It powers up as real drives do at their worst: no heartbeat
//! watched, no reaction to a lost master, and the last torque held for ever.

use std::time::Duration;

use crate::canopen::NodeId;
use crate::canopen::device::Application;
use crate::canopen::device::Device;
use crate::canopen::dictionary::Dictionary;
use crate::canopen::drive::CYCLIC_SYNCHRONOUS_TORQUE;
use crate::canopen::drive::State;
use crate::canopen::frame::Channel;
use crate::canopen::frame::Frame;
use crate::canopen::frame::Telegram;
use crate::canopen::object::Object;
use crate::canopen::station::Station;
use crate::sim::actuator::Actuator;
use crate::sim::actuator::ActuatorSettings;
use crate::sim::power::Power;
use crate::sim::power::Stop;
use crate::time::Instant;

/// What a drive is.
#[derive(Clone, Debug)]
pub struct DriveSettings {
    /// Its bus.
    pub channel: Channel,
    /// Its node-id.
    pub node: NodeId,
    /// Its objects.
    pub dictionary: Dictionary,
    /// Its motor, gear and encoder.
    pub actuator: ActuatorSettings,
    /// From SYNC to its TPDO.
    pub latency: Duration,
}

/// A drive on a joint.
#[derive(Clone, Debug)]
pub struct Drive {
    channel: Channel,
    is_plugged: bool,
    device: Device<Servo>,
    out: Vec<Frame>,
}

impl Drive {
    /// A drive that boots at the first opportunity.
    pub fn new(settings: DriveSettings) -> Self {
        let DriveSettings { channel, node, dictionary, actuator, latency } = settings;
        let servo = Servo::new(Actuator::new(actuator));
        Self {
            channel,
            is_plugged: true,
            device: Device::new(node, dictionary, latency, servo),
            out: Vec::with_capacity(8),
        }
    }

    /// Where its joint is and how fast it moves, in rad and rad/s. The encoder counts it; what is
    /// counted at a SYNC is what the SYNC's TPDO tells.
    pub fn set_motion(&mut self, position: f64, velocity: f64) {
        self.device.touch(|servo| servo.motion = (position, velocity));
    }

    /// The torque on the joint, now, in N·m.
    pub fn torque(&self) -> f64 {
        self.device.application().torque
    }

    /// Its node-id.
    pub const fn node(&self) -> NodeId {
        self.device.node()
    }

    /// The state of its power stage.
    pub const fn state(&self) -> State {
        self.device.application().power.state()
    }

    /// The error it last told of (1003h:1); zero if none.
    pub fn last_error(&self) -> u32 {
        self.device.dictionary().unsigned(Object { sub: 1, ..Object::ERROR_HISTORY })
    }

    /// A fault inside the drive, such as its motor's wire off.
    pub fn fail(&mut self) {
        self.device.touch(|servo| servo.power.fail());
    }

    /// Takes it off its bus: it hears and says nothing any more.
    pub const fn unplug(&mut self) {
        self.is_plugged = false;
    }

    fn send(&mut self, out: &mut Vec<Telegram>) {
        if !self.is_plugged {
            self.out.clear();
        }
        let channel = self.channel;
        out.extend(self.out.drain(..).map(|frame| Telegram { channel, frame }));
    }
}

impl Station for Drive {
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        if channel == self.channel && self.is_plugged {
            self.device.on_frame(now, frame, &mut self.out);
            self.send(out);
        }
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        self.device.on_time(now, &mut self.out);
        self.send(out);
    }

    fn deadline(&self) -> Option<Instant> {
        self.device.deadline()
    }
}

/// What the drive does with its objects.
#[derive(Clone, Debug)]
struct Servo {
    actuator: Actuator,
    power: Power,
    motion: (f64, f64),
    torque: f64,
}

impl Servo {
    const fn new(actuator: Actuator) -> Self {
        let power = Power::new();
        Self { actuator, power, motion: (0.0, 0.0), torque: 0.0 }
    }
}

impl Application for Servo {
    fn refresh(&mut self, dictionary: &mut Dictionary) {
        let [c0, c1, ..] = dictionary.unsigned(Object::CONTROLWORD).to_le_bytes();
        self.power.command(u16::from_le_bytes([c0, c1]), quick_stop(dictionary));
        self.show(dictionary);
    }

    fn connection_lost(&mut self, dictionary: &mut Dictionary) -> [u8; 5] {
        match dictionary.i16(Object::ABORT_CONNECTION) {
            1 => self.power.fail(),
            2 => self.power.disable_voltage(),
            3 => self.power.quick_stop(quick_stop(dictionary)),
            _ => {}
        }
        self.show(dictionary);
        let [t0, t1] = dictionary.i16(Object::TORQUE_ACTUAL).to_le_bytes();
        let [s0, s1] = self.power.statusword().to_le_bytes();
        [t0, t1, s0, s1, 0]
    }

    fn has_fault(&self) -> bool {
        self.power.state() == State::Fault
    }

    fn reset(&mut self, dictionary: &mut Dictionary) {
        self.power = Power::new();
        dictionary.set(Object::RATED_TORQUE, &self.actuator.rated_torque().to_le_bytes());
        self.show(dictionary);
    }
}

impl Servo {
    /// Exerts the torque that is asked for and allowed, and shows state and measurements.
    fn show(&mut self, dictionary: &mut Dictionary) {
        let mode = dictionary.i8(Object::MODE_OF_OPERATION);
        let acts = self.power.is_enabled() && mode == CYCLIC_SYNCHRONOUS_TORQUE;
        let most = i16::try_from(dictionary.unsigned(Object::MAX_TORQUE)).unwrap_or(i16::MAX);
        let target = dictionary.i16(Object::TARGET_TORQUE).clamp(-most, most);
        let per_mille = if acts { target } else { 0 };
        self.torque = self.actuator.exert(per_mille);

        let (position, velocity) = self.motion;
        let error = if self.has_fault() { 0x8100_u16 } else { 0 };
        dictionary.set(Object::STATUSWORD, &self.power.statusword().to_le_bytes());
        dictionary.set(Object::ERROR_CODE, &error.to_le_bytes());
        dictionary.set(Object::MODE_DISPLAY, &mode.to_le_bytes());
        dictionary.set(Object::POSITION_ACTUAL, &self.actuator.counts(position).to_le_bytes());
        dictionary.set(Object::VELOCITY_ACTUAL, &self.actuator.count_rate(velocity).to_le_bytes());
        dictionary.set(Object::TORQUE_ACTUAL, &per_mille.to_le_bytes());
    }
}

/// What 605Ah asks for: codes 5 and above stay in `Quick stop active`.
fn quick_stop(dictionary: &Dictionary) -> Stop {
    if dictionary.i16(Object::QUICK_STOP_OPTION) >= 5 { Stop::Stay } else { Stop::Disable }
}
