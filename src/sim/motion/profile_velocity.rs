//! Profile velocity mode (CiA 402-2, 12): 60FFh on the ramps of 6083h and 6084h.

use crate::canopen::object::Object;
use crate::sim::motion::Asked;
use crate::sim::motion::axis::Axis;
use crate::sim::motion::axis::Moment;
use crate::sim::motion::bits;
use crate::sim::motion::limits;
use crate::sim::motion::limits::within;
use crate::sim::motion::ramp::Profile;
use crate::sim::motion::reached::Reached;
use crate::sim::motion::reached::Standstill;
use crate::sim::motion::units::signed;

/// The mode.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ProfileVelocity {
    reached: Reached,
    standstill: Standstill,
}

impl ProfileVelocity {
    pub(super) fn step(&mut self, axis: &mut Axis, moment: &Moment<'_>) -> Asked {
        let (units, dictionary) = (axis.shaft.units, moment.dictionary);
        let wanted = units.velocity(f64::from(signed(dictionary, Object::TARGET_VELOCITY)));
        let top = limits::top_speed(&units, dictionary);
        let target = within(wanted, top);
        let profile = Profile::new(
            top,
            limits::acceleration(&units, dictionary, Object::PROFILE_ACCELERATION),
            limits::deceleration(&units, dictionary, Object::PROFILE_DECELERATION),
        );
        axis.demand = axis.demand.toward_velocity(moment.dt, target.value, &profile);
        let torque = axis.follow_velocity(0.0, moment);
        let is_reached = self.reached.is_as_fast(axis, moment, wanted);
        Asked {
            per_mille: torque.value,
            status: bits::bit(bits::TARGET_REACHED, is_reached) | self.speed_zero(axis, moment),
            is_limited: torque.is_limited || target.is_limited,
            error: 0,
        }
    }

    /// Bit 12. Bit 13, the slip of an asynchronous motor, is never too much.
    pub(super) fn speed_zero(&mut self, axis: &Axis, moment: &Moment<'_>) -> u16 {
        bits::bit(bits::SPEED_ZERO, !self.standstill.has_left_rest(axis, moment))
    }
}
