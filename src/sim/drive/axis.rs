//! The drive behind its communication: what is written becomes torque, and what the motor does is told.
//!
//! The one place where dictionary, power stage, modes, limits and stops meet; each of them decides in a
//! file of its own. In cyclic torque mode nothing happens between two set-points; in every other one, and
//! while it stops, the loops run every [`SERVO_PERIOD`].

use crate::actuator::ActuatorSettings;
use crate::actuator::Encoder;
use crate::drive::limits::Limits;
use crate::drive::monitor::Cause;
use crate::drive::monitor::Monitor;
use crate::drive::options::Abort;
use crate::drive::options::Options;
use crate::drive::power::Power;
use crate::drive::servo::Servo;
use crate::drive::status;
use crate::drive::status::Status;
use crate::drive::stop::Stop;
use crate::drive::task;
use crate::drive::task::Task;
use crate::drivetrain::Sensed;
use crate::motion::Asked;
use crate::motion::Feedback;
use crate::motion::Motion;
use crate::motion::Ramp;
use crate::motion::SERVO_PERIOD;
use crate::motion::Tuning;
use canopen::abort::AbortCode;
use canopen::device::Application;
use canopen::device::ConnectionLoss;
use canopen::device::Reset;
use canopen::dictionary::Dictionary;
use canopen::drive::Controlword;
use canopen::drive::State;
use canopen::object::Object;
use units::time::Instant;

/// One axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    encoder: Encoder,
    /// Of the motor, in mN·m.
    rated_torque: u32,
    /// Of the encoder, per turn of the motor.
    increments: u32,
    power: Power,
    /// The mode in force (6061h).
    mode: i8,
    task: Task,
    /// In operation, and not about to leave it.
    is_enabled: bool,
    tuning: Tuning,
    motion: Motion,
    options: Options,
    limits: Limits,
    monitor: Monitor,
    servo: Servo,
    feedback: Feedback,
    /// Of the current loop, within every limit.
    asked: Asked,
    /// Last error.
    error: u16,
}

impl Application for Axis {
    fn check_write(
        &mut self,
        dictionary: &Dictionary,
        object: Object,
        bytes: &[u8],
    ) -> Result<(), AbortCode> {
        let is_known = match (object, bytes) {
            (Object::MODE_OF_OPERATION, &[mode]) => task::has_mode(dictionary, mode),
            _ => Options::may_be(object, bytes),
        };
        if is_known { Ok(()) } else { Err(AbortCode::VALUE_INVALID) }
    }

    fn written(&mut self, dictionary: &mut Dictionary, object: Object) {
        match object {
            Object::CONTROLWORD => self.obey(dictionary),
            Object::MODE_OF_OPERATION => self.follow_power(dictionary),
            Object::TARGET_TORQUE
            | Object::TORQUE_OFFSET
            | Object::TARGET_POSITION
            | Object::POSITION_OFFSET
            | Object::TARGET_VELOCITY
            | Object::VELOCITY_OFFSET => {
                if task::takes_at_once(self.mode, object) {
                    self.perform(0.0, dictionary);
                    self.tell(dictionary);
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
        match self.options.on_lost_master() {
            Abort::Nothing => {}
            Abort::Fault => self.power.fail(self.options.fault_ramp()),
            Abort::DisableVoltage => self.power.disable_voltage(),
            Abort::QuickStop => self.power.quick_stop(&self.options),
        }
        self.follow_power(dictionary);
        let [t0, t1] = status::whole(self.asked.per_mille).to_le_bytes();
        let [s0, s1] = status::word(dictionary, Object::STATUSWORD).to_le_bytes();
        [t0, t1, s0, s1, 0]
    }

    fn on_reset(&mut self, dictionary: &mut Dictionary, reset: Reset) {
        if reset == Reset::Node {
            self.power = Power::default();
            self.error = 0;
            dictionary.set(Object::RATED_TORQUE, &self.rated_torque.to_le_bytes());
            dictionary.set(Object::ENCODER_INCREMENTS, &self.increments.to_le_bytes());
            self.motion = Motion::new(self.tuning, dictionary);
            self.show_motor(dictionary);
            status::show_monitor(&self.monitor, dictionary);
        }
        self.read_parameters(dictionary);
        self.follow_power(dictionary);
    }

    fn on_time(&mut self, now: Instant, dictionary: &mut Dictionary) {
        if self.power.state() == State::NotReadyToSwitchOn {
            self.power.initialise();
            self.watch();
        }
        if self.task.is_servoed(self.mode) {
            for _ in 0..self.servo.periods(now) {
                self.perform(SERVO_PERIOD, dictionary);
            }
        }
        self.follow_power(dictionary);
    }

    fn deadline(&self) -> Option<Instant> {
        let is_new = self.power.state() == State::NotReadyToSwitchOn;
        let servo = self.task.is_servoed(self.mode).then(|| self.servo.deadline());
        if is_new { Some(Instant::ZERO) } else { servo }
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
    /// That of a motor behind its gear, at rest.
    pub(super) fn new(actuator: &ActuatorSettings, tuning: Tuning) -> Self {
        Self {
            encoder: Encoder::new(actuator),
            rated_torque: actuator.rated_millis(),
            increments: status::natural(actuator.counts_per_rev),
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
            feedback: Feedback { position: actuator.zero_counts, ..Feedback::default() },
            asked: Asked::default(),
            error: 0,
        }
    }

    /// The state of its power stage.
    pub(super) const fn state(&self) -> State {
        self.power.state()
    }

    /// The mode in force.
    pub(super) const fn mode(&self) -> i8 {
        self.mode
    }

    /// The last error, 0 for none since power-up or reset.
    pub(super) const fn last_error(&self) -> u16 {
        self.error
    }

    /// What is asked of the current loop, in ‰ of rated torque.
    pub(super) const fn demand(&self) -> f64 {
        self.asked.per_mille
    }

    /// What the motor does, as the drive believes.
    pub(super) const fn feedback(&self) -> &Feedback {
        &self.feedback
    }

    /// What it sees of itself.
    pub(super) const fn monitor(&self) -> &Monitor {
        &self.monitor
    }

    /// What its motor does now.
    pub(super) fn sense(&mut self, sensed: &Sensed, dictionary: &mut Dictionary) {
        self.feedback = Feedback {
            position: self.encoder.counts(sensed.position),
            velocity: f64::from(self.encoder.rate(sensed.velocity)),
            per_mille: sensed.per_mille,
        };
        self.show_motor(dictionary);
        let is_too_fast = self.limits.is_too_fast(self.feedback.velocity);
        let temperature = sensed.temperature;
        self.observe(Monitor { temperature, is_too_fast, ..self.monitor }, dictionary);
    }

    /// What it sees of itself now.
    pub(super) fn observe(&mut self, monitor: Monitor, dictionary: &mut Dictionary) {
        if self.monitor == monitor && monitor.cause().is_none() {
            return;
        }
        let told = (self.monitor.has_warning(), self.monitor.has_voltage());
        self.monitor = monitor;
        status::show_monitor(&self.monitor, dictionary);
        let is_news = told != (self.monitor.has_warning(), self.monitor.has_voltage());
        if is_news || self.monitor.cause().is_some() {
            self.watch();
            self.follow_power(dictionary);
        }
    }

    /// Something is wrong, with this error code, and the motor is stopped as 605Eh says.
    pub(super) fn fail(&mut self, code: u16, dictionary: &mut Dictionary) {
        self.give_up(code, self.options.fault_ramp());
        self.follow_power(dictionary);
    }

    /// Its power is gone, and all that it knew.
    pub(super) fn switch_off(&mut self, dictionary: &mut Dictionary) {
        self.power = Power::default();
        self.follow_power(dictionary);
    }

    fn give_up(&mut self, code: u16, ramp: Option<Ramp>) {
        self.error = code;
        self.power.fail(ramp);
    }

    /// Gives up if it must, once. It is no matter how fast a motor turns that has no torque.
    fn watch(&mut self) {
        let Some(cause) = self.monitor.cause() else { return };
        let has_given_up = match self.power.state() {
            State::NotReadyToSwitchOn | State::Fault => true,
            State::FaultReactionActive => !cause.is_torque_gone(),
            State::SwitchOnDisabled | State::ReadyToSwitchOn | State::SwitchedOn => {
                cause == Cause::OverSpeed
            }
            State::OperationEnabled | State::QuickStopActive => false,
        };
        if !has_given_up {
            let ramp = self.options.fault_ramp().filter(|_| !cause.is_torque_gone());
            self.give_up(cause.error_code(), ramp);
        }
    }

    fn read_parameters(&mut self, dictionary: &Dictionary) {
        self.options = Options::of(dictionary);
        self.limits = Limits::of(dictionary);
    }

    /// Obeys the controlword. One that says the same again changes nothing, and costs nothing.
    fn obey(&mut self, dictionary: &mut Dictionary) {
        let word = Controlword(status::word(dictionary, Object::CONTROLWORD));
        let before = (self.power.state(), self.power.controlword());
        self.power.obey(word, &self.options, self.monitor.cause().is_none());
        if before != (self.power.state(), word) {
            self.settle(dictionary);
            if self.is_enabled {
                self.motion.on_controlword(word, &self.feedback, dictionary);
            }
            self.follow_power(dictionary);
        }
    }

    /// All that follows from another state of the power stage, or another limit.
    fn follow_power(&mut self, dictionary: &mut Dictionary) {
        self.settle(dictionary);
        if matches!(self.task, Task::Operate) && self.task.is_servoed(self.mode) {
            // Its loops take a step without time for a set-point that has come.
            self.give(self.asked);
        } else {
            self.perform(0.0, dictionary);
        }
        self.tell(dictionary);
    }

    /// Task and mode become those of the state.
    fn settle(&mut self, dictionary: &Dictionary) {
        self.task = self.next_task();
        let has_new_mode = self.adopt_mode(dictionary);
        if has_new_mode {
            self.task = self.next_task();
        }
        let is_operating = self.power.state() == State::OperationEnabled;
        let is_enabled = is_operating && self.power.ramp().is_none();
        if is_enabled && (has_new_mode || !self.is_enabled) {
            self.motion.begin(self.mode, &self.feedback, dictionary);
        }
        self.is_enabled = is_enabled;
        if !self.task.is_servoed(self.mode) {
            self.servo.stop();
        }
    }

    fn next_task(&self) -> Task {
        self.task.next(&self.power, self.mode)
    }

    /// Takes the mode that is asked for (6060h), unless a stop is under way; whether it is another one.
    fn adopt_mode(&mut self, dictionary: &Dictionary) -> bool {
        let mode = dictionary.i8(Object::MODE_OF_OPERATION);
        let is_new = mode != self.mode
            && self.task.may_change_mode()
            && task::has_mode(dictionary, mode.cast_unsigned());
        if is_new {
            self.mode = mode;
        }
        is_new
    }

    /// `dt` s have passed in its task; zero when only what is commanded has changed.
    fn perform(&mut self, dt: f64, dictionary: &mut Dictionary) {
        let asked = match self.task {
            Task::Release => Asked::default(),
            Task::Operate => self.motion.step(dt, &self.feedback, dictionary),
            Task::Stop(stop) => self.stop(dt, stop, dictionary),
            Task::Hold => self.motion.hold(dt, &self.feedback, dictionary),
        };
        if asked.error != 0 {
            self.give_up(asked.error, self.options.fault_ramp());
            self.settle(dictionary);
        }
        self.give(if self.power.may_push() { asked } else { Asked::default() });
    }

    /// `dt` s have passed in a stop, which may be over by then, and the state it belongs to.
    fn stop(&mut self, dt: f64, mut stop: Stop, dictionary: &mut Dictionary) -> Asked {
        let asked = stop.step(dt, &mut self.motion, &self.feedback, dictionary);
        self.task = match asked {
            Some(_) => Task::Stop(stop),
            None if stop.is_given_up() => Task::Release,
            None => Task::Hold,
        };
        if asked.is_none() {
            self.power.on_stopped();
            self.settle(dictionary);
        }
        asked.unwrap_or_default()
    }

    /// The current loop is asked for it, within the limits.
    fn give(&mut self, asked: Asked) {
        let per_mille = self.limits.clamp(asked.per_mille);
        let is_limited = asked.is_limited || (per_mille - asked.per_mille).abs() > 0.0;
        self.asked = Asked { per_mille, is_limited, ..asked };
    }

    fn tell(&self, dictionary: &mut Dictionary) {
        let state = self.power.statusword();
        let status = Status {
            statusword: status::statusword(state, &self.monitor, &self.asked),
            mode: self.mode,
            torque_demand: self.asked.per_mille,
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
