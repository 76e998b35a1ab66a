//! Motor task of each state of the power state machine.

use crate::drive::power::Power;
use crate::drive::stop::Stop;
use canopen::drive::{CYCLIC_SYNCHRONOUS_TORQUE, State};
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;

/// Motor task.
#[derive(Clone, Copy, Debug)]
pub(super) enum Task {
    /// No torque.
    Release,
    /// Follow the active mode.
    Operate,
    /// Stop on a ramp.
    Stop(Stop),
    /// Hold position at standstill.
    Hold,
}

impl Task {
    /// Returns the next task in `mode`. A stop that continues in another state does not start again.
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

    /// Returns whether the mode may change: not during a stop.
    pub(super) const fn allows_mode_change(&self) -> bool {
        match self {
            Self::Release | Self::Operate => true,
            Self::Stop(_) | Self::Hold => false,
        }
    }

    /// Returns whether the task runs the control loops in `mode`.
    pub(super) const fn needs_servo(&self, mode: i8) -> bool {
        match self {
            Self::Release => false,
            Self::Operate => mode != CYCLIC_SYNCHRONOUS_TORQUE,
            Self::Stop(_) | Self::Hold => true,
        }
    }
}

/// Returns whether `object` is a set-point of a cyclic mode, which acts as soon as it is received.
pub(super) const fn is_immediate_set_point(mode: i8, object: Object) -> bool {
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

/// Returns whether the drive supports a mode of operation (6502h, mode 1 at bit 0) or it is 0, no mode. Without 6502h it
/// supports all.
pub(super) fn has_mode(dictionary: &Dictionary, mode: u8) -> bool {
    let modes =
        u64::from(dictionary.optional(Object::SUPPORTED_MODES).unwrap_or(u32::MAX)) << 1 | 1;
    modes.checked_shr(u32::from(mode)).is_some_and(|modes| modes & 1 == 1)
}

/// Returns whether a mode is cyclic synchronous torque.
pub(super) const fn is_cyclic_torque(mode: u8) -> bool {
    mode.cast_signed() == CYCLIC_SYNCHRONOUS_TORQUE
}

/// 6060h: cyclic synchronous position, 607Ah at every SYNC.
const CYCLIC_SYNCHRONOUS_POSITION: i8 = 8;
/// 6060h: cyclic synchronous velocity, 60FFh at every SYNC.
const CYCLIC_SYNCHRONOUS_VELOCITY: i8 = 9;
/// 6060h: no mode.
pub(super) const NO_MODE: i8 = 0;
