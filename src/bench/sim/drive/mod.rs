//! CiA 402 drive with the unsafe defaults of real ones: no heartbeat consumer, and the last torque is held when the
//! master is lost.
//!
//! The motor is not part of it: the plant supplies the joint position and reads the torque demand.
//!
//! | file        | what                                                              |
//! |-------------|-------------------------------------------------------------------|
//! | `axis`      | the CiA 402 application: power stage, modes and limits            |
//! | `power`     | power drive system states and transitions                         |
//! | `task`      | motor task (off, follow, stop) of each state                      |
//! | `options`   | option codes                                                      |
//! | `stop`      | a stop on a ramp                                                  |
//! | `limits`    | torque and speed limits                                           |
//! | `nameplate` | values stored at delivery                                         |
//! | `monitor`   | temperature, voltage, speed: faults and warnings                  |
//! | `inputs`    | digital inputs, safe torque off                                   |
//! | `servo`     | timing of the control loops                                       |
//! | `encoder`   | encoder kind, position counter                                    |
//! | `status`    | actual values and statusword                                      |

mod axis;
mod encoder;
mod inputs;
mod limits;
mod monitor;
mod nameplate;
mod options;
mod power;
mod servo;
mod status;
mod stop;
mod task;
#[cfg(test)]
mod tests;

pub use encoder::EncoderKind;

use std::time::Duration;

use crate::actuator::ActuatorSettings;
use crate::drive::axis::Axis;
use crate::drive::encoder::PositionCounter;
use crate::drive::monitor::Monitor;
use crate::drivetrain::MotorReading;
use crate::motion::{Feedback, Tuning, encoder_counts};
use crate::quirks::{QuirkEffects, Quirks, TorqueFilter, TransmitPath, start_running};
use canopen::drive::State;
use canopen::frame::{Channel, Frame, Telegram};
use canopen::nmt::Order;
use canopen::object::Object;
use canopen::{NmtCommand, NmtState, NodeId};
use canopen_device::Device;
use canopen_device::dictionary::Dictionary;
use canopen_device::station::{Station, earlier};
use units::time::Instant;

/// Place on the bus, dictionary, motor and tuning of a drive.
#[derive(Clone, Debug)]
pub struct DriveSettings {
    /// CAN bus.
    pub channel: Channel,
    pub node: NodeId,
    /// Object dictionary with default values.
    pub dictionary: Dictionary,
    /// Motor, gear and encoder.
    pub actuator: ActuatorSettings,
    /// Position at power-up.
    pub encoder: EncoderKind,
    /// Set for a prismatic joint.
    pub is_prismatic: bool,
    /// Time from a SYNC to the TPDOs sampled at it.
    pub latency: Duration,
    /// Servo tuning: inertia and friction of the load.
    pub tuning: Tuning,
}

/// Deviations of a delivered drive from the defaults of its data sheet and motor.
#[derive(Clone, Debug, Default)]
pub struct Delivery {
    /// Values that the maker's tool has stored.
    pub stored: Vec<(Object, u32)>,
    /// Set if the drive has cyclic synchronous torque although 6502h does not list it.
    pub has_unlisted_torque_mode: bool,
}

/// Simulated CiA 402 drive.
#[derive(Clone, Debug)]
pub struct Drive {
    channel: Channel,
    is_on: bool,
    is_plugged: bool,
    device: Device<Axis>,
    transmit_path: TransmitPath,
    /// Filter of the torque actual value (6077h); `None` without one.
    torque_filter: Option<TorqueFilter>,
    /// Buffer of frames from the device, so that a cycle does not allocate.
    frames: Vec<Frame>,
    /// Buffer of frames from the transmit path.
    sent: Vec<Frame>,
}

impl Drive {
    /// Creates a drive at power-up.
    pub fn new(settings: DriveSettings) -> Self {
        Self::with(settings, &Quirks::default())
    }

    /// Creates a drive with `quirks` at power-up.
    pub fn with(settings: DriveSettings, quirks: &Quirks) -> Self {
        Self::delivered(settings, &Delivery::default(), quirks)
    }

    /// Creates a drive with the settings of its `delivery`, and with `quirks` at power-up.
    pub fn delivered(settings: DriveSettings, delivery: &Delivery, quirks: &Quirks) -> Self {
        let DriveSettings { channel, node, mut dictionary, mut actuator, .. } = settings;
        let DriveSettings { encoder, is_prismatic, latency, tuning, .. } = settings;
        nameplate::store(&actuator, &mut dictionary);
        for (object, value) in &delivery.stored {
            dictionary.set_default_number(*object, *value);
        }
        // The encoder is mounted so that 6064h is right at joint position zero; quirks come later.
        let ActuatorSettings { counts_per_rev, zero_counts, .. } = actuator;
        actuator.zero_counts = encoder_counts(&dictionary, counts_per_rev, zero_counts);
        let effects = QuirkEffects::new(quirks, dictionary, node);
        let QuirkEffects { dictionary, misbehaviour, frames, .. } = effects;
        let QuirkEffects { torque_at_start, torque_filter, .. } = effects;
        let counter = PositionCounter::new(encoder, &actuator, is_prismatic, &effects.encoder);
        let axis = Axis::new(&actuator, counter, tuning)
            .with_quirks(effects.axis)
            .with_unlisted_torque_mode(delivery.has_unlisted_torque_mode);
        let mut device =
            Device::new(node, dictionary, axis, latency).with_misbehaviour(misbehaviour);
        if let Some(torque) = torque_at_start {
            device.touch(|axis, dictionary| start_running(torque, axis, dictionary));
        }
        Self {
            channel,
            is_on: true,
            is_plugged: true,
            device,
            transmit_path: TransmitPath::new(frames),
            torque_filter,
            frames: Vec::with_capacity(FRAMES),
            sent: Vec::with_capacity(FRAMES),
        }
    }

    /// Returns the CAN bus.
    pub const fn channel(&self) -> Channel {
        self.channel
    }

    /// Returns the node-id.
    pub const fn node(&self) -> NodeId {
        self.device.node()
    }

    /// Returns the state of the NMT slave (CiA 301, 7.3.2.2).
    pub const fn nmt_state(&self) -> NmtState {
        self.device.state()
    }

    /// Returns the state of the power drive system.
    pub const fn state(&self) -> State {
        self.device.application().state()
    }

    /// Returns the active mode of operation (6061h), 0 for none.
    pub const fn mode(&self) -> i8 {
        self.device.application().mode()
    }

    /// Returns the torque demand, in ‰ of rated torque.
    pub const fn demand(&self) -> f64 {
        self.device.application().demand()
    }

    /// Returns the true rated torque of the motor, in N·m, which 6076h may misstate.
    pub const fn rated_torque(&self) -> f64 {
        self.device.application().rated_torque()
    }

    /// Returns the feedback of motor and encoder.
    pub const fn feedback(&self) -> &Feedback {
        self.device.application().feedback()
    }

    /// Returns the winding temperature, in °C.
    pub const fn temperature(&self) -> f64 {
        self.device.application().monitor().temperature
    }

    /// Returns the error code (603Fh), 0 for none since power-up or reset.
    pub const fn last_error(&self) -> u16 {
        self.device.application().last_error()
    }

    /// Returns the object dictionary.
    pub const fn dictionary(&self) -> &Dictionary {
        self.device.dictionary()
    }
}

/// Inputs from plant and faults.
impl Drive {
    /// Updates the motor and encoder values, with the torque as this drive reports it at `now`.
    pub fn sense_at(&mut self, now: Instant, sensed: &MotorReading) {
        let filter = self.torque_filter.as_mut();
        let per_mille =
            filter.map_or(sensed.per_mille, |filter| filter.step(now, sensed.per_mille));
        self.sense(&MotorReading { per_mille, ..*sensed });
    }

    /// Updates the motor and encoder values.
    pub fn sense(&mut self, sensed: &MotorReading) {
        self.device.touch(|axis, dictionary| axis.sense(sensed, dictionary));
    }

    /// Puts the drive in Fault without an EMCY.
    pub fn fail(&mut self) {
        self.fail_with(0);
    }

    /// Puts the drive in Fault and sends an EMCY with this error code, unless it is 0.
    pub fn fail_with(&mut self, code: u16) {
        self.device.touch(|axis, dictionary| axis.fail(code, dictionary));
    }

    /// Sends an EMCY for a transient condition, without another reaction. `register` has its bits of 1001h.
    pub fn report_transient_error(&mut self, code: u16, register: u8) {
        self.device.report_transient_error(code, register);
    }

    /// Sets the digital inputs (60FDh): bit 0 negative limit switch, 1 positive limit switch, 2 home switch,
    /// 16 to 31 manufacturer-specific. Bit 3 (safe torque off) is not changed.
    pub fn set_inputs(&mut self, levels: u32) {
        self.observe(|monitor| monitor.inputs.levels = levels);
    }

    /// Requests or releases safe torque off, which removes the torque immediately and latches a fault until a fault reset.
    pub fn set_safe_torque_off(&mut self, is_torque_off: bool) {
        self.observe(|monitor| monitor.inputs.is_torque_off = is_torque_off);
    }

    /// Sets whether controlwords are accepted but ignored.
    pub fn set_ignores_controlword(&mut self, ignores: bool) {
        self.device.touch(|axis, dictionary| axis.set_ignores_controlword(ignores, dictionary));
    }

    /// Writes the torque offset (60B2h) at the drive's service port, in ‰ of rated torque. Has no effect without the
    /// object.
    pub fn set_torque_offset(&mut self, per_mille: i16) {
        self.device.touch(|axis, dictionary| axis.set_torque_offset(per_mille, dictionary));
    }

    /// Sets the DC link voltage, in V: nominal 48, fault below 36 and above 60.
    pub fn set_link_voltage(&mut self, volts: f64) {
        self.observe(|monitor| monitor.link_voltage = volts);
    }

    /// Disconnects the drive from its bus. It keeps its power.
    pub const fn unplug(&mut self) {
        self.is_plugged = false;
    }

    /// Connects the drive to its bus again.
    pub const fn plug(&mut self) {
        self.is_plugged = true;
    }

    /// Removes the power: no torque, no communication.
    pub fn switch_off(&mut self) {
        self.is_on = false;
        self.device.touch(Axis::switch_off);
    }

    /// Connects the drive and cycles its power: it boots.
    pub fn switch_on(&mut self, now: Instant) {
        self.is_on = true;
        self.plug();
        self.transmit_path.power_up();
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
        if self.frames.is_empty() && self.transmit_path.is_transparent() {
            return;
        }
        let channel = self.channel;
        self.transmit_path.forward(now, &self.device, self.frames.drain(..), &mut self.sent);
        let sent = self.sent.drain(..).filter(|_| self.is_plugged);
        out.extend(sent.map(|frame| Telegram { channel, frame }));
    }
}

/// Capacity of the frame buffers.
const FRAMES: usize = 8;

impl Station for Drive {
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        if channel == self.channel
            && self.is_plugged
            && self.is_on
            && self.transmit_path.is_receiving(now)
        {
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
        if !self.is_on {
            return None;
        }
        let unsent = (!self.frames.is_empty()).then_some(Instant::ZERO);
        earlier(unsent, earlier(self.device.deadline(), self.transmit_path.deadline()))
    }
}
