//! Path from a controlword to the torque demand: state, task, mode, and one step of the control loops.

use crate::drive::axis::Axis;
use crate::drive::status;
use crate::drive::stop::Stop;
use crate::drive::task::{self, Task};
use crate::motion::TorqueDemand;
use canopen::drive::{Controlword, State};
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;

impl Axis {
    /// Applies the controlword. A repeated one has no effect and costs no time.
    pub(super) fn on_controlword(&mut self, dictionary: &mut Dictionary) {
        if self.ignores_controlword {
            return;
        }
        let word = Controlword(status::word(dictionary, Object::CONTROLWORD));
        let before = (self.power.state(), self.power.controlword());
        let may_reset = self.monitor.cause().is_none() && !self.ignores_reset(word);
        self.power.on_controlword(word, &self.options, may_reset);
        if before != (self.power.state(), word) {
            self.update_task(dictionary);
            if self.is_enabled {
                self.motion.on_controlword(word, &self.feedback, dictionary);
            }
            self.follow_power(dictionary);
        }
    }

    /// Counts edges of bit 7 in a fault; returns whether this word must be ignored.
    fn ignores_reset(&mut self, word: Controlword) -> bool {
        let bit = Controlword::FAULT_RESET.0;
        let is_edge = word.0 & bit != 0 && self.power.controlword().0 & bit == 0;
        if self.power.state() != State::Fault {
            self.reset_edges = 0;
        } else if is_edge {
            self.reset_edges = self.reset_edges.saturating_add(1);
        }
        self.quirks.ignores_first_reset && self.reset_edges == 1
    }

    /// Updates task, torque and status after a change of state or limit.
    pub(super) fn follow_power(&mut self, dictionary: &mut Dictionary) {
        self.update_task(dictionary);
        if matches!(self.task, Task::Operate) && self.task.needs_servo(self.mode) {
            // Its loops already take a step of zero time for a new set-point.
            self.set_demand(self.demand);
        } else {
            self.step(0.0, dictionary);
        }
        self.show_status(dictionary);
    }

    /// Sets task and mode to those of the state.
    fn update_task(&mut self, dictionary: &Dictionary) {
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
        if !self.task.needs_servo(self.mode) {
            self.servo.stop();
        }
    }

    /// Returns whether the drive has a mode: one of 6502h, or an unlisted one.
    pub(super) fn has_mode(&self, dictionary: &Dictionary, mode: u8) -> bool {
        let is_unlisted = self.has_unlisted_torque_mode && task::is_cyclic_torque(mode);
        is_unlisted || task::has_mode(dictionary, mode)
    }

    fn next_task(&self) -> Task {
        self.task.next(&self.power, self.mode)
    }

    /// Takes the requested mode (6060h) unless a stop is in progress; returns whether it changed.
    fn adopt_mode(&mut self, dictionary: &Dictionary) -> bool {
        let requested = dictionary.i8(Object::MODE_OF_OPERATION);
        let is_enabled = self.power.state() == State::OperationEnabled;
        let mode = match self.quirks.mode_when_enabled {
            Some(mode) if is_enabled => mode,
            Some(_) => task::NO_MODE,
            None => requested,
        };
        let is_known = mode == task::NO_MODE || self.has_mode(dictionary, mode.cast_unsigned());
        let is_new = mode != self.mode && self.task.allows_mode_change() && is_known;
        if is_new {
            self.mode = mode;
        }
        is_new
    }

    /// Advances the task by `dt` s; zero when only a command has changed.
    pub(super) fn step(&mut self, dt: f64, dictionary: &mut Dictionary) {
        let demand = match self.task {
            Task::Release => TorqueDemand::default(),
            Task::Operate => self.motion.step(dt, &self.feedback, dictionary),
            Task::Stop(stop) => self.stop(dt, stop, dictionary),
            Task::Hold => self.motion.hold(dt, &self.feedback, dictionary),
        };
        if demand.error != 0 {
            self.enter_fault(demand.error, self.options.fault_ramp());
            self.update_task(dictionary);
        }
        self.set_demand(if self.power.has_torque() { demand } else { TorqueDemand::default() });
    }

    /// Advances a stop by `dt` s; completes the state transition when it is over.
    fn stop(&mut self, dt: f64, mut stop: Stop, dictionary: &mut Dictionary) -> TorqueDemand {
        let demand = stop.step(dt, &mut self.motion, &self.feedback, dictionary);
        self.task = match demand {
            Some(_) => Task::Stop(stop),
            None if stop.has_timed_out() => Task::Release,
            None => Task::Hold,
        };
        if demand.is_none() {
            self.power.on_stopped();
            self.update_task(dictionary);
        }
        demand.unwrap_or_default()
    }

    /// Passes the demand to the current loop, within the limits.
    fn set_demand(&mut self, demand: TorqueDemand) {
        let per_mille = self.limits.clamp(demand.per_mille);
        let is_limited = demand.is_limited || (per_mille - demand.per_mille).abs() > 0.0;
        self.demand = TorqueDemand { per_mille, is_limited, ..demand };
    }
}
