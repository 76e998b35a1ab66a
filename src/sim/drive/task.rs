//! What a drive does with its motor, given the state of its power stage.

use crate::drive::power::Power;
use crate::drive::stop::Stop;
use canopen::dictionary::Dictionary;
use canopen::drive::CYCLIC_SYNCHRONOUS_TORQUE;
use canopen::drive::State;
use canopen::object::Object;

/// What is done with the motor.
#[derive(Clone, Copy, Debug)]
pub(super) enum Task {
    /// It has no torque.
    Release,
    /// It follows the mode in force.
    Operate,
    /// It is brought to a standstill.
    Stop(Stop),
    /// It is kept at a standstill.
    Hold,
}

impl Task {
    /// What is to be done in `mode` now that this has been done. A stop that goes on over into another one
    /// does not begin again.
    pub(super) fn next(self, power: &Power, mode: i8) -> Self {
        match (power.state(), power.ramp(), self) {
            (
                State::NotReadyToSwitchOn
                | State::SwitchOnDisabled
                | State::ReadyToSwitchOn
                | State::SwitchedOn
                | State::Fault,
                ..,
            ) => Self::Release,
            (_, Some(ramp), Self::Stop(stop)) => Self::Stop(stop.on(ramp)),
            (_, Some(ramp), Self::Release | Self::Operate | Self::Hold) => {
                Self::Stop(Stop::new(ramp))
            }
            (State::QuickStopActive | State::FaultReactionActive, None, task) => task,
            (State::OperationEnabled, None, _) if mode == NO_MODE => Self::Release,
            (State::OperationEnabled, None, _) => Self::Operate,
        }
    }

    /// Whether another mode may come into force: not while it stops.
    pub(super) const fn may_change_mode(&self) -> bool {
        match self {
            Self::Release | Self::Operate => true,
            Self::Stop(_) | Self::Hold => false,
        }
    }

    /// Whether loops have to run for it, in `mode`.
    pub(super) const fn is_servoed(&self, mode: i8) -> bool {
        match self {
            Self::Release => false,
            Self::Operate => mode != CYCLIC_SYNCHRONOUS_TORQUE,
            Self::Stop(_) | Self::Hold => true,
        }
    }
}

/// Whether `object` is a set-point that acts as soon as it comes: the cyclic mode's own.
pub(super) const fn takes_at_once(mode: i8, object: Object) -> bool {
    match mode {
        CYCLIC_SYNCHRONOUS_POSITION => {
            matches!(object, Object::TARGET_POSITION | Object::POSITION_OFFSET)
        }
        CYCLIC_SYNCHRONOUS_VELOCITY => {
            matches!(object, Object::TARGET_VELOCITY | Object::VELOCITY_OFFSET)
        }
        CYCLIC_SYNCHRONOUS_TORQUE => {
            matches!(object, Object::TARGET_TORQUE | Object::TORQUE_OFFSET)
        }
        _ => false,
    }
}

/// Whether the drive has a mode of operation (6502h, mode 1 at bit 0); mode 0 is none, and any has it.
pub(super) fn has_mode(dictionary: &Dictionary, mode: u8) -> bool {
    let modes = u64::from(dictionary.unsigned(Object::SUPPORTED_MODES)) << 1 | 1;
    modes.checked_shr(u32::from(mode)).is_some_and(|modes| modes & 1 == 1)
}

/// 6060h: 607Ah is taken at every SYNC.
const CYCLIC_SYNCHRONOUS_POSITION: i8 = 8;
/// 6060h: 60FFh is taken at every SYNC.
const CYCLIC_SYNCHRONOUS_VELOCITY: i8 = 9;
/// 6060h: none is chosen.
pub(super) const NO_MODE: i8 = 0;
