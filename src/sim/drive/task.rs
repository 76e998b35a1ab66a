//! What a drive does with its motor, given the state of its power stage.

use crate::canopen::drive::CYCLIC_SYNCHRONOUS_TORQUE;
use crate::canopen::drive::State;
use crate::sim::drive::options::Options;
use crate::sim::drive::power::Power;
use crate::sim::drive::stop;
use crate::sim::drive::stop::Stop;
use crate::sim::motion::Ramp;

/// What is done with the motor.
#[derive(Clone, Copy, Debug)]
pub(super) enum Task {
    /// It has no torque.
    Release,
    /// It follows the mode in force.
    Operate,
    /// It is brought to a standstill.
    Stop(Stop),
    /// It stands still, and is brought to a standstill again should it be moved.
    Rest(Stop),
}

impl Task {
    /// What is to be done now that this has been done: a stop that has begun goes on, and is not made twice.
    pub(super) fn next(self, power: &Power, mode: i8, options: &Options) -> Self {
        if !power.may_push() {
            return Self::Release;
        }
        let halt = power.is_halted().then(|| options.halt_ramp());
        match (power.ramp(), power.state(), self) {
            (Some(ramp), _, Self::Stop(stop)) if stop.ramp() == ramp => self,
            (Some(ramp), ..) => Self::Stop(Stop::new(ramp)),
            (None, State::QuickStopActive, Self::Rest(_)) => self,
            (None, State::QuickStopActive, _) => Self::Rest(Stop::new(Ramp::QuickStop)),
            (None, ..) if mode == stop::NO_MODE => Self::Release,
            (None, _, Self::Stop(_) | Self::Rest(_)) if halt.is_some() => self,
            (None, ..) => halt.map_or(Self::Operate, |ramp| Self::Stop(Stop::new(ramp))),
        }
    }

    /// Whether another mode may come into force: not while it stops.
    pub(super) const fn may_change_mode(&self) -> bool {
        match self {
            Self::Release | Self::Operate => true,
            Self::Stop(_) | Self::Rest(_) => false,
        }
    }

    /// Whether loops have to run for it, in `mode`.
    pub(super) const fn is_servoed(&self, mode: i8) -> bool {
        match self {
            Self::Release => false,
            Self::Operate => mode != CYCLIC_SYNCHRONOUS_TORQUE,
            Self::Stop(_) => true,
            Self::Rest(_) => stop::is_held(mode),
        }
    }
}
