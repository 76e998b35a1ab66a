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
use crate::sim::actuator::TorqueCurve;
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
    frames: Vec<Frame>,
}

impl Drive {
    /// A drive that is switched on.
    pub fn new(settings: DriveSettings) -> Self {
        let DriveSettings { channel, node, dictionary, actuator, latency } = settings;
        let axis = Axis {
            encoder: Encoder::new(&actuator),
            curve: TorqueCurve::new(&actuator),
            rated_torque: actuator.rated_millis(),
            power: Power::default(),
            error: 0,
            position: actuator.zero_counts,
            velocity: 0,
            target: 0,
            torque: 0.0,
        };
        let device = Device::new(node, dictionary, axis, latency);
        Self { channel, is_plugged: true, device, frames: Vec::with_capacity(FRAMES) }
    }

    /// Where it is on its bus.
    pub const fn node(&self) -> NodeId {
        self.device.node()
    }

    /// The joint is at `position` in rad and moves with `velocity` in rad/s.
    pub fn set_motion(&mut self, position: f64, velocity: f64) {
        self.device.touch(|axis, dictionary| {
            axis.position = axis.encoder.counts(position);
            axis.velocity = axis.encoder.rate(velocity);
            axis.show_motion(dictionary);
        });
    }

    /// The torque on the joint, in N·m.
    pub const fn torque(&self) -> f64 {
        self.device.application().torque
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
    fn send(&mut self, out: &mut Vec<Telegram>) {
        let channel = self.channel;
        let said = self.frames.drain(..).filter(|_| self.is_plugged);
        out.extend(said.map(|frame| Telegram { channel, frame }));
    }
}

/// Room for what a device says at once.
const FRAMES: usize = 8;

impl Station for Drive {
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        if channel == self.channel && self.is_plugged {
            self.device.on_frame(now, frame, &mut self.frames);
            self.send(out);
        }
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        self.device.on_time(now, &mut self.frames);
        self.send(out);
    }

    fn deadline(&self) -> Option<Instant> {
        self.device.deadline()
    }
}

/// The drive proper, behind its communication.
#[derive(Clone, Debug)]
struct Axis {
    encoder: Encoder,
    curve: TorqueCurve,
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
    /// What the joint gets of it, in N·m.
    torque: f64,
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
        if target != self.target {
            self.target = target;
            self.torque = self.curve.torque(f64::from(target));
        }
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
