//! CiA 402 application behind the communication: objects in, torque demand and status out.
//!
//! Combines dictionary, power state machine, modes, limits and stops; each of them decides in its own file. In cyclic
//! synchronous torque mode nothing happens between two set-points. In every other mode, and during a stop, the control
//! loops run every [`SERVO_PERIOD`]. `course` has the way from controlword to torque demand.

mod course;

use crate::actuator::ActuatorSettings;
use crate::drive::encoder::PositionCounter;
use crate::drive::limits::Limits;
use crate::drive::monitor::{FaultCause, Monitor};
use crate::drive::options::{Abort, Options};
use crate::drive::power::Power;
use crate::drive::servo::Servo;
use crate::drive::status::{self, Status};
use crate::drive::task::{self, Task};
use crate::drivetrain::MotorReading;
use crate::motion::{Feedback, Motion, Ramp, SERVO_PERIOD, TorqueDemand, Tuning};
use crate::quirks::AxisQuirks;
use canopen::abort::AbortCode;
use canopen::drive::State;
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;
use canopen_device::{Application, ConnectionLoss, Reset};
use units::time::Instant;

/// CiA 402 application of one drive.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    counter: PositionCounter,
    /// Rated torque of the motor, in N·m.
    rated_torque: f64,
    /// Encoder increments per motor revolution.
    increments: f64,
    power: Power,
    /// Active mode of operation (6061h).
    mode: i8,
    task: Task,
    /// Set in operation enabled, unless stopping.
    is_enabled: bool,
    tuning: Tuning,
    motion: Motion,
    options: Options,
    limits: Limits,
    monitor: Monitor,
    servo: Servo,
    feedback: Feedback,
    /// Torque demand to the current loop, after all limits.
    demand: TorqueDemand,
    /// Error code (603Fh).
    error: u16,
    /// Set if the drive has cyclic synchronous torque although 6502h does not list it.
    has_unlisted_torque_mode: bool,
    /// Controlwords have no effect.
    ignores_controlword: bool,
    quirks: AxisQuirks,
    /// Edges of bit 7 since the fault.
    reset_edges: u32,
}

impl Application for Axis {
    fn check_write(
        &mut self,
        dictionary: &Dictionary,
        object: Object,
        bytes: &[u8],
    ) -> Result<(), AbortCode> {
        let is_valid = match (object, bytes) {
            (Object::MODE_OF_OPERATION, &[mode]) => self.has_mode(dictionary, mode),
            _ => Options::accepts(object, bytes),
        };
        if is_valid { Ok(()) } else { Err(AbortCode::VALUE_INVALID) }
    }

    fn written(&mut self, dictionary: &mut Dictionary, object: Object) {
        match object {
            Object::CONTROLWORD => self.on_controlword(dictionary),
            Object::MODE_OF_OPERATION => self.follow_power(dictionary),
            Object::TARGET_TORQUE
            | Object::TORQUE_OFFSET
            | Object::TARGET_POSITION
            | Object::POSITION_OFFSET
            | Object::TARGET_VELOCITY
            | Object::VELOCITY_OFFSET => {
                if task::is_immediate_set_point(self.mode, object) {
                    self.step(0.0, dictionary);
                    self.show_status(dictionary);
                }
            }
            parameter => {
                self.read_parameters(dictionary);
                self.motion.on_written(parameter, dictionary);
                self.follow_power(dictionary);
            }
        }
    }

    fn on_connection_lost(&mut self, dictionary: &mut Dictionary, why: ConnectionLoss) -> [u8; 5] {
        self.error = why.error_code();
        match self.options.on_connection_loss() {
            Abort::Nothing => {}
            Abort::Fault => self.power.fail(self.options.fault_ramp()),
            Abort::DisableVoltage => self.power.disable_voltage(),
            Abort::QuickStop => self.power.quick_stop(&self.options),
        }
        self.follow_power(dictionary);
        let [t0, t1] = status::whole(self.demand.per_mille).to_le_bytes();
        let [s0, s1] = status::word(dictionary, Object::STATUSWORD).to_le_bytes();
        [t0, t1, s0, s1, 0]
    }

    fn on_reset(&mut self, dictionary: &mut Dictionary, reset: Reset) {
        if reset == Reset::Node {
            self.power = Power::default();
            self.error = 0;
            self.counter.power_up();
            self.read_counter();
            self.motion = Motion::new(self.tuning, self.increments, dictionary)
                .with_moving_homing(self.quirks.homing_moves);
            self.show_motor(dictionary);
            status::show_monitor(&self.monitor, dictionary);
        }
        self.read_parameters(dictionary);
        self.follow_power(dictionary);
    }

    fn on_time(&mut self, now: Instant, dictionary: &mut Dictionary) {
        if self.power.state() == State::NotReadyToSwitchOn {
            self.power.initialise();
            self.check_monitor();
        }
        if self.task.needs_servo(self.mode) {
            for _ in 0..self.servo.periods(now) {
                self.step(SERVO_PERIOD, dictionary);
            }
        }
        self.follow_power(dictionary);
    }

    fn deadline(&self) -> Option<Instant> {
        let is_starting = self.power.state() == State::NotReadyToSwitchOn;
        let servo = self.task.needs_servo(self.mode).then(|| self.servo.deadline());
        if is_starting { Some(Instant::ZERO) } else { servo }
    }

    fn error_code(&self) -> u16 {
        match self.power.state() {
            State::FaultReactionActive | State::Fault => self.error,
            State::NotReadyToSwitchOn
            | State::SwitchOnDisabled
            | State::ReadyToSwitchOn
            | State::SwitchedOn
            | State::OperationEnabled
            | State::QuickStopActive => 0,
        }
    }
}

impl Axis {
    /// Creates the axis of a motor, gear and encoder, at rest.
    pub(super) fn new(
        actuator: &ActuatorSettings,
        counter: PositionCounter,
        tuning: Tuning,
    ) -> Self {
        Self {
            counter,
            rated_torque: actuator.rated_torque,
            increments: actuator.counts_per_rev,
            power: Power::default(),
            mode: task::NO_MODE,
            task: Task::Release,
            is_enabled: false,
            tuning,
            motion: Motion::default(),
            options: Options::default(),
            limits: Limits::default(),
            monitor: Monitor::default(),
            servo: Servo::default(),
            feedback: Feedback::default(),
            demand: TorqueDemand::default(),
            error: 0,
            has_unlisted_torque_mode: false,
            ignores_controlword: false,
            quirks: AxisQuirks::default(),
            reset_edges: 0,
        }
    }

    /// Adds cyclic synchronous torque independently of 6502h.
    #[must_use]
    pub(super) const fn with_unlisted_torque_mode(self, has_unlisted_torque_mode: bool) -> Self {
        Self { has_unlisted_torque_mode, ..self }
    }

    /// Adds deviations of state machine and mode.
    #[must_use]
    pub(super) const fn with_quirks(self, quirks: AxisQuirks) -> Self {
        Self { quirks, ..self }
    }

    /// Returns the state of the power drive system.
    pub(super) const fn state(&self) -> State {
        self.power.state()
    }

    /// Returns the active mode of operation.
    pub(super) const fn mode(&self) -> i8 {
        self.mode
    }

    /// Returns the error code, 0 for none since power-up or reset.
    pub(super) const fn last_error(&self) -> u16 {
        self.error
    }

    /// Returns the torque demand to the current loop, in ‰ of rated torque.
    pub(super) const fn demand(&self) -> f64 {
        self.demand.per_mille
    }

    /// Returns the feedback of motor and encoder.
    pub(super) const fn feedback(&self) -> &Feedback {
        &self.feedback
    }

    /// Returns the rated torque of the motor, in N·m.
    pub(super) const fn rated_torque(&self) -> f64 {
        self.rated_torque
    }

    /// Returns the monitored quantities.
    pub(super) const fn monitor(&self) -> &Monitor {
        &self.monitor
    }

    /// Writes the torque offset (60B2h), in ‰ of rated torque.
    pub(super) fn set_torque_offset(&mut self, per_mille: i16, dictionary: &mut Dictionary) {
        if dictionary.set(Object::TORQUE_OFFSET, &per_mille.to_le_bytes()) {
            self.written(dictionary, Object::TORQUE_OFFSET);
        }
    }

    /// Updates the motor and encoder values.
    pub(super) fn sense(&mut self, sensed: &MotorReading, dictionary: &mut Dictionary) {
        let is_initialising = self.power.state() == State::NotReadyToSwitchOn;
        self.counter.sense(sensed.position, is_initialising);
        self.read_counter();
        self.feedback.velocity = self.counter.rate(sensed.velocity);
        self.feedback.per_mille = sensed.per_mille;
        self.show_motor(dictionary);
        let is_too_fast = self.limits.is_too_fast(self.feedback.velocity);
        let temperature = sensed.temperature;
        self.observe(Monitor { temperature, is_too_fast, ..self.monitor }, dictionary);
    }

    /// Updates the monitored quantities, and faults if one is out of its limits.
    pub(super) fn observe(&mut self, monitor: Monitor, dictionary: &mut Dictionary) {
        if self.monitor == monitor && monitor.cause().is_none() {
            return;
        }
        let before = (self.monitor.has_warning(), self.monitor.has_voltage());
        self.monitor = monitor;
        status::show_monitor(&self.monitor, dictionary);
        let has_changed = before != (self.monitor.has_warning(), self.monitor.has_voltage());
        if has_changed || self.monitor.cause().is_some() {
            self.check_monitor();
            self.follow_power(dictionary);
        }
    }

    /// Enters the fault reaction of 605Eh with this error code.
    pub(super) fn fail(&mut self, code: u16, dictionary: &mut Dictionary) {
        let [class, _] = code.to_be_bytes();
        if class == SENSOR_ERROR {
            self.motion.forget_homing();
        }
        self.enter_fault(code, self.options.fault_ramp());
        self.follow_power(dictionary);
    }

    /// Removes the power: all states are lost.
    pub(super) fn switch_off(&mut self, dictionary: &mut Dictionary) {
        self.power = Power::default();
        self.follow_power(dictionary);
    }

    fn enter_fault(&mut self, code: u16, ramp: Option<Ramp>) {
        self.error = code;
        self.power.fail(ramp);
    }

    /// Enters Fault once for a monitored cause. Without torque, overspeed is not a fault.
    fn check_monitor(&mut self) {
        let Some(cause) = self.monitor.cause() else { return };
        let is_handled = match self.power.state() {
            State::NotReadyToSwitchOn | State::Fault => true,
            State::FaultReactionActive => !cause.is_torque_gone(),
            State::SwitchOnDisabled | State::ReadyToSwitchOn | State::SwitchedOn => {
                cause == FaultCause::OverSpeed
            }
            State::OperationEnabled | State::QuickStopActive => false,
        };
        if !is_handled {
            let ramp = self.options.fault_ramp().filter(|_| !cause.is_torque_gone());
            self.enter_fault(cause.error_code(), ramp);
        }
    }

    fn read_parameters(&mut self, dictionary: &Dictionary) {
        self.options = Options::from_dictionary(dictionary);
        self.limits = Limits::from_dictionary(dictionary, self.increments);
    }

    /// Sets whether controlwords are ignored. Afterwards the newest one takes effect.
    pub(super) fn set_ignores_controlword(&mut self, ignores: bool, dictionary: &mut Dictionary) {
        self.ignores_controlword = ignores;
        self.on_controlword(dictionary);
    }

    fn read_counter(&mut self) {
        self.feedback.position = self.counter.counts();
        self.feedback.index = self.counter.index();
    }

    fn show_status(&self, dictionary: &mut Dictionary) {
        let state = self.power.statusword();
        let referenced = self.quirks.referenced_bit.filter(|_| self.motion.is_homed());
        let manufacturer = referenced.map_or(0, |bit| 1 << bit);
        let status = Status {
            statusword: status::statusword(state, &self.monitor, &self.demand, manufacturer),
            mode: self.mode,
            torque_demand: self.demand.per_mille,
            error: self.error,
        };
        status.show(dictionary);
    }

    fn show_motor(&mut self, dictionary: &mut Dictionary) {
        let position = self.motion.position(&self.feedback);
        let velocity = self.motion.velocity(&self.feedback);
        status::show_motor(position, velocity, &self.feedback, dictionary);
    }
}

/// High byte of the error codes of sensors (CiA 402), the position feedback among them.
const SENSOR_ERROR: u8 = 0x73;
