//! Dispatch to the modes of operation (6060h).

use crate::motion::axis::{Axis, StepInput};
use crate::motion::cyclic::{CyclicPosition, CyclicVelocity};
use crate::motion::homing::Homing;
use crate::motion::profile_position::ProfilePosition;
use crate::motion::profile_velocity::ProfileVelocity;
use crate::motion::stop::StopQuantity;
use crate::motion::torque::{self, ProfileTorque};
use crate::motion::{TorqueDemand, bits};
use canopen::drive::Controlword;

/// Active mode with its state.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum OperationMode {
    /// No mode selected, or an unsupported one: no torque.
    #[default]
    None,
    ProfilePosition(ProfilePosition),
    ProfileVelocity(ProfileVelocity),
    ProfileTorque(ProfileTorque),
    Homing(Homing),
    CyclicPosition(CyclicPosition),
    CyclicVelocity(CyclicVelocity),
    CyclicTorque,
}

impl OperationMode {
    /// Starts the mode of a number in 6060h.
    pub(super) fn begin(number: i8, axis: &mut Axis, input: &StepInput<'_>) -> Self {
        match number {
            1 => Self::ProfilePosition(ProfilePosition::begin(axis, input)),
            3 => Self::ProfileVelocity(ProfileVelocity::default()),
            4 => Self::ProfileTorque(ProfileTorque::begin(axis)),
            6 => Self::Homing(Homing::default()),
            8 => Self::CyclicPosition(CyclicPosition::begin(axis, input.dictionary)),
            9 => Self::CyclicVelocity(CyclicVelocity::begin(axis, input.dictionary)),
            10 => Self::CyclicTorque,
            _ => Self::None,
        }
    }

    pub(super) fn on_controlword(
        &mut self,
        word: Controlword,
        is_rising_edge: bool,
        axis: &mut Axis,
        input: &StepInput<'_>,
    ) {
        match self {
            Self::ProfilePosition(mode) => mode.on_controlword(word, is_rising_edge, axis, input),
            Self::Homing(mode) => mode.on_controlword(word, is_rising_edge, axis, input),
            Self::None
            | Self::ProfileVelocity(_)
            | Self::ProfileTorque(_)
            | Self::CyclicPosition(_)
            | Self::CyclicVelocity(_)
            | Self::CyclicTorque => {}
        }
    }

    pub(super) fn step(&mut self, axis: &mut Axis, input: &StepInput<'_>) -> TorqueDemand {
        match self {
            Self::CyclicTorque => torque::step_cyclic(axis, input),
            Self::ProfilePosition(mode) => mode.step(axis, input),
            Self::ProfileVelocity(mode) => mode.step(axis, input),
            Self::ProfileTorque(mode) => mode.step(axis, input),
            Self::Homing(mode) => mode.step(axis, input),
            Self::CyclicPosition(mode) => mode.step(axis, input),
            Self::CyclicVelocity(mode) => mode.step(axis, input),
            Self::None => TorqueDemand {
                per_mille: axis.set_torque(0.0, input).value,
                ..TorqueDemand::default()
            },
        }
    }

    /// Returns statusword bits 10, 12 and 13 while halted; `is_over` at standstill.
    pub(super) fn halted(&mut self, is_over: bool, axis: &Axis, input: &StepInput<'_>) -> u16 {
        let at_rest = bits::bit(bits::TARGET_REACHED, is_over);
        match self {
            Self::ProfilePosition(mode) => at_rest | mode.acknowledgement(),
            Self::ProfileVelocity(mode) => at_rest | mode.speed_zero(axis, input),
            Self::ProfileTorque(_) => at_rest,
            Self::Homing(mode) => {
                mode.interrupt();
                mode.status(is_over)
            }
            Self::None | Self::CyclicPosition(_) | Self::CyclicVelocity(_) | Self::CyclicTorque => {
                0
            }
        }
    }

    /// Continues after a halt, from the actual motion.
    pub(super) fn resume(&mut self, axis: &mut Axis, input: &StepInput<'_>) {
        match self {
            Self::ProfilePosition(mode) => mode.resume(axis),
            Self::ProfileTorque(mode) => *mode = ProfileTorque::begin(axis),
            Self::CyclicPosition(mode) => {
                *mode = CyclicPosition::begin(axis, input.dictionary);
            }
            Self::CyclicVelocity(mode) => {
                *mode = CyclicVelocity::begin(axis, input.dictionary);
            }
            Self::Homing(mode) => mode.interrupt(),
            Self::None | Self::ProfileVelocity(_) | Self::CyclicTorque => {}
        }
    }

    /// Returns the quantity that a stop brings to zero.
    pub(super) const fn stopped(&self) -> StopQuantity {
        match self {
            Self::None | Self::CyclicTorque => StopQuantity::CyclicTorque,
            Self::ProfileTorque(_) => StopQuantity::Torque,
            Self::ProfilePosition(_)
            | Self::ProfileVelocity(_)
            | Self::Homing(_)
            | Self::CyclicPosition(_)
            | Self::CyclicVelocity(_) => StopQuantity::Velocity,
        }
    }

    /// Returns whether the mode has a position demand (6062h).
    pub(super) const fn has_position_demand(&self) -> bool {
        matches!(self, Self::ProfilePosition(_) | Self::CyclicPosition(_) | Self::Homing(_))
    }
}
