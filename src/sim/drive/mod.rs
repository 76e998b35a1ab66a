//! A CiA 402 drive, with the dangerous defaults of real ones: out of the box it watches nobody and holds
//! its last torque for ever.
//!
//! The motor is no part of it: the plant says where the joint is and asks for its torque.
//!
//! | file        | what                                                              |
//! |-------------|-------------------------------------------------------------------|
//! | `axis`      | dictionary, power stage, modes and limits, put together           |
//! | `power`     | states and transitions                                            |
//! | `task`      | what is done with the motor in which state                        |
//! | `options`   | what the option codes mean                                        |
//! | `stop`      | a stop that takes its time                                        |
//! | `limits`    | the most torque, the highest speed                                |
//! | `monitor`   | temperature, voltage, speed: faults and warnings                  |
//! | `inputs`    | its terminals, and safe torque off                                |
//! | `servo`     | when its loops run                                                |
//! | `status`    | what it tells of itself                                           |

mod axis;
mod inputs;
#[cfg(test)]
mod laws;
mod limits;
mod monitor;
mod options;
mod power;
mod servo;
mod status;
mod stop;
mod task;

use std::time::Duration;

use crate::actuator::ActuatorSettings;
use crate::drive::axis::Axis;
use crate::drive::monitor::Monitor;
use crate::drivetrain::Sensed;
use crate::motion::Feedback;
use crate::motion::Tuning;
use crate::personality;
use crate::personality::Makeup;
use crate::personality::Personality;
use crate::personality::Wire;
use canopen::NmtCommand;
use canopen::NmtState;
use canopen::NodeId;
use canopen::device::Device;
use canopen::dictionary::Dictionary;
use canopen::drive::State;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::frame::Telegram;
use canopen::nmt::Order;
use canopen::station::Station;
use units::time::Instant;

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
    /// What its servo knows of what it moves.
    pub tuning: Tuning,
}

/// One drive.
#[derive(Clone, Debug)]
pub struct Drive {
    channel: Channel,
    is_on: bool,
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
        let DriveSettings { channel, node, dictionary, actuator, latency, tuning } = settings;
        let Makeup { dictionary, manners, habits, torque_at_start } =
            Makeup::of(personality, dictionary, node);
        let axis = Axis::new(&actuator, tuning);
        let mut device = Device::new(node, dictionary, axis, latency).behaving(manners);
        if let Some(torque) = torque_at_start {
            device.touch(|axis, dictionary| personality::begin(torque, axis, dictionary));
        }
        Self {
            channel,
            is_on: true,
            is_plugged: true,
            device,
            wire: Wire::new(habits),
            frames: Vec::with_capacity(FRAMES),
            said: Vec::with_capacity(FRAMES),
        }
    }

    /// Its bus.
    pub const fn channel(&self) -> Channel {
        self.channel
    }

    /// Where it is on its bus.
    pub const fn node(&self) -> NodeId {
        self.device.node()
    }

    /// Whether it may communicate.
    pub const fn nmt_state(&self) -> NmtState {
        self.device.state()
    }

    /// The state of its power stage.
    pub const fn state(&self) -> State {
        self.device.application().state()
    }

    /// The mode of operation in force (6061h), 0 for none.
    pub const fn mode(&self) -> i8 {
        self.device.application().mode()
    }

    /// What it asks of its motor, in ‰ of rated torque.
    pub const fn demand(&self) -> f64 {
        self.device.application().demand()
    }

    /// What it believes its motor does.
    pub const fn feedback(&self) -> &Feedback {
        self.device.application().feedback()
    }

    /// Of its winding, in °C.
    pub const fn temperature(&self) -> f64 {
        self.device.application().monitor().temperature
    }

    /// The code of the last error (603Fh), 0 for none since power-up or reset.
    pub const fn last_error(&self) -> u16 {
        self.device.application().last_error()
    }

    /// Its objects, as they are now.
    pub const fn dictionary(&self) -> &Dictionary {
        self.device.dictionary()
    }
}

/// What happens to it.
impl Drive {
    /// What its motor does now.
    pub fn sense(&mut self, sensed: &Sensed) {
        self.device.touch(|axis, dictionary| axis.sense(sensed, dictionary));
    }

    /// Something breaks in the drive that only its statusword tells of.
    pub fn fail(&mut self) {
        self.fail_with(0);
    }

    /// Something breaks in the drive, and an emergency tells of it with this error code; 0 for none.
    pub fn fail_with(&mut self, code: u16) {
        self.device.touch(|axis, dictionary| axis.fail(code, dictionary));
    }

    /// Something is wrong with it for a moment, and nothing follows but an emergency; `register` has the
    /// bits of its class (1001h).
    pub fn mention(&mut self, code: u16, register: u8) {
        self.device.mention(code, register);
    }

    /// Levels at its terminals (60FDh): bit 0 negative limit switch, 1 positive limit switch, 2 home switch,
    /// 16 to 31 the maker's own. Bit 3 is safe torque off and is not set by this.
    pub fn set_inputs(&mut self, levels: u32) {
        self.observe(|monitor| monitor.inputs.levels = levels);
    }

    /// Safe torque off is asked for, or no longer. It takes the torque at once and is a fault, which stays
    /// until it is reset.
    pub fn set_safe_torque_off(&mut self, is_torque_off: bool) {
        self.observe(|monitor| monitor.inputs.is_torque_off = is_torque_off);
    }

    /// The voltage of its DC link, in V: 48 when nothing is wrong, a fault below 36 and above 60.
    pub fn set_link_voltage(&mut self, volts: f64) {
        self.observe(|monitor| monitor.link_voltage = volts);
    }

    /// Takes it off its bus: it hears and says nothing any more, and does what it does without its master.
    pub const fn unplug(&mut self) {
        self.is_plugged = false;
    }

    /// Puts it back on its bus, as it is.
    pub const fn plug(&mut self) {
        self.is_plugged = true;
    }

    /// Takes its power: it has no torque, hears nothing and says nothing.
    pub fn switch_off(&mut self) {
        self.is_on = false;
        self.device.touch(Axis::switch_off);
    }

    /// Puts it back on its bus and switches it off and on, so that it boots up.
    pub fn switch_on(&mut self, now: Instant) {
        self.is_on = true;
        self.plug();
        let power_up = Order::to(self.node(), NmtCommand::ResetNode).frame();
        self.device.on_frame(now, &power_up, &mut self.frames);
    }

    fn observe(&mut self, changes: impl FnOnce(&mut Monitor)) {
        self.device.touch(|axis, dictionary| {
            let mut monitor = *axis.monitor();
            changes(&mut monitor);
            axis.observe(monitor, dictionary);
        });
    }

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
        if channel == self.channel && self.is_plugged && self.is_on && self.wire.hears(now) {
            self.device.on_frame(now, frame, &mut self.frames);
            self.send(now, out);
        }
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        if self.is_on {
            self.device.on_time(now, &mut self.frames);
            self.send(now, out);
        }
    }

    fn deadline(&self) -> Option<Instant> {
        let unsent = (!self.frames.is_empty()).then_some(Instant::ZERO);
        let own = self.device.deadline().into_iter().chain(self.wire.deadline());
        unsent.into_iter().chain(own).min().filter(|_| self.is_on)
    }
}
