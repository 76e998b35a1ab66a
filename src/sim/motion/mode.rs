//! The modes of operation (6060h), and what each makes of a controlword, of time, and of a halt.

use crate::motion::Asked;
use crate::motion::axis::Axis;
use crate::motion::axis::Moment;
use crate::motion::bits;
use crate::motion::cyclic::CyclicPosition;
use crate::motion::cyclic::CyclicVelocity;
use crate::motion::homing::Homing;
use crate::motion::profile_position::ProfilePosition;
use crate::motion::profile_velocity::ProfileVelocity;
use crate::motion::stop::Stopped;
use crate::motion::torque;
use crate::motion::torque::ProfileTorque;
use canopen::drive::Controlword;

/// A mode, and what it has in mind.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum Mode {
    /// None is chosen, or one that is not there: no torque.
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

impl Mode {
    /// The mode of a number (6060h).
    pub(super) fn begin(number: i8, axis: &mut Axis, moment: &Moment<'_>) -> Self {
        match number {
            1 => Self::ProfilePosition(ProfilePosition::begin(axis, moment)),
            3 => Self::ProfileVelocity(ProfileVelocity::default()),
            4 => Self::ProfileTorque(ProfileTorque::begin(axis)),
            6 => Self::Homing(Homing::default()),
            8 => Self::CyclicPosition(CyclicPosition::begin(axis, moment.dictionary)),
            9 => Self::CyclicVelocity(CyclicVelocity::begin(axis, moment.dictionary)),
            10 => Self::CyclicTorque,
            _ => Self::None,
        }
    }

    pub(super) fn on_controlword(
        &mut self,
        word: Controlword,
        has_risen: bool,
        axis: &mut Axis,
        moment: &Moment<'_>,
    ) {
        match self {
            Self::ProfilePosition(mode) => mode.on_controlword(word, has_risen, axis, moment),
            Self::Homing(mode) => mode.on_controlword(word, has_risen, axis, moment),
            Self::None
            | Self::ProfileVelocity(_)
            | Self::ProfileTorque(_)
            | Self::CyclicPosition(_)
            | Self::CyclicVelocity(_)
            | Self::CyclicTorque => {}
        }
    }

    pub(super) fn step(&mut self, axis: &mut Axis, moment: &Moment<'_>) -> Asked {
        match self {
            Self::CyclicTorque => torque::step_cyclic(axis, moment),
            Self::ProfilePosition(mode) => mode.step(axis, moment),
            Self::ProfileVelocity(mode) => mode.step(axis, moment),
            Self::ProfileTorque(mode) => mode.step(axis, moment),
            Self::Homing(mode) => mode.step(axis, moment),
            Self::CyclicPosition(mode) => mode.step(axis, moment),
            Self::CyclicVelocity(mode) => mode.step(axis, moment),
            Self::None => Asked { per_mille: axis.push(0.0, moment).value, ..Asked::default() },
        }
    }

    /// Bits 10, 12 and 13 while halted; `is_over`: the motor stands still.
    pub(super) fn halted(&mut self, is_over: bool, axis: &Axis, moment: &Moment<'_>) -> u16 {
        let at_rest = bits::bit(bits::TARGET_REACHED, is_over);
        match self {
            Self::ProfilePosition(mode) => at_rest | mode.acknowledgement(),
            Self::ProfileVelocity(mode) => at_rest | mode.speed_zero(axis, moment),
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

    /// After a stop it goes on from where the motor is.
    pub(super) fn resume(&mut self, axis: &mut Axis, moment: &Moment<'_>) {
        match self {
            Self::ProfilePosition(mode) => mode.resume(axis),
            Self::ProfileTorque(mode) => *mode = ProfileTorque::begin(axis),
            Self::CyclicPosition(mode) => {
                *mode = CyclicPosition::begin(axis, moment.dictionary);
            }
            Self::CyclicVelocity(mode) => {
                *mode = CyclicVelocity::begin(axis, moment.dictionary);
            }
            Self::Homing(mode) => mode.interrupt(),
            Self::None | Self::ProfileVelocity(_) | Self::CyclicTorque => {}
        }
    }

    /// What a stop has to bring down.
    pub(super) const fn stopped(&self) -> Stopped {
        match self {
            Self::None | Self::CyclicTorque => Stopped::CyclicTorque,
            Self::ProfileTorque(_) => Stopped::Torque,
            Self::ProfilePosition(_)
            | Self::ProfileVelocity(_)
            | Self::Homing(_)
            | Self::CyclicPosition(_)
            | Self::CyclicVelocity(_) => Stopped::Velocity,
        }
    }

    /// Whether there is a place it demands, for 6062h to tell.
    pub(super) const fn has_place(&self) -> bool {
        matches!(self, Self::ProfilePosition(_) | Self::CyclicPosition(_) | Self::Homing(_))
    }
}
