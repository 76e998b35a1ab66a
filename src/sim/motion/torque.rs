//! The torque modes: profile torque (CiA 402-2, 13), where 6071h acts on the slope of 6087h, and cyclic
//! synchronous torque (CiA 402-2, 15.4), where it acts at once.
//!
//! No slope in the cyclic mode: the master makes the profile there, and a torque that is reflected to a
//! hand must not lag behind it.

use crate::canopen::dictionary::Dictionary;
use crate::canopen::drive::Statusword;
use crate::canopen::object::Object;
use crate::sim::motion::Asked;
use crate::sim::motion::axis::Axis;
use crate::sim::motion::axis::Moment;
use crate::sim::motion::bits;

/// Profile torque mode: the torque on the slope, in ‰.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ProfileTorque(f64);

impl ProfileTorque {
    /// The slope begins at the torque there is.
    pub(super) const fn begin(axis: &Axis) -> Self {
        Self(axis.torque())
    }

    pub(super) fn step(&mut self, axis: &mut Axis, moment: &Moment<'_>) -> Asked {
        let target = f64::from(moment.dictionary.i16(Object::TARGET_TORQUE));
        self.0 = toward(self.0, target, moment);
        let torque = axis.push(self.0, moment);
        // A limit holds the slope back too, or it would have to come back from beyond it.
        self.0 = torque.value;
        let is_there = (torque.value - target).abs() <= 0.0
            && (moment.actual.per_mille - target).abs() <= TORQUE_WINDOW;
        Asked {
            per_mille: torque.value,
            status: bits::bit(bits::TARGET_REACHED, is_there),
            is_limited: torque.is_limited,
            error: 0,
        }
    }
}

/// A torque this near to its target has reached it, in ‰: there is no object for it.
const TORQUE_WINDOW: f64 = 20.0;

/// `torque` a moment later on its slope (6087h) to `target`, all in ‰.
pub(super) fn toward(torque: f64, target: f64, moment: &Moment<'_>) -> f64 {
    let change = slope(moment.dictionary) * moment.dt;
    torque + (target - torque).clamp(-change, change)
}

/// 6087h, in ‰/s.
fn slope(dictionary: &Dictionary) -> f64 {
    f64::from(dictionary.unsigned(Object::TORQUE_SLOPE)).max(1.0)
}

/// One step of cyclic synchronous torque mode: 6071h and 60B2h, at once.
pub(super) fn step_cyclic(axis: &mut Axis, moment: &Moment<'_>) -> Asked {
    let target = moment.dictionary.i16(Object::TARGET_TORQUE);
    let offset = moment.dictionary.i16(Object::TORQUE_OFFSET);
    let torque = axis.push(f64::from(target) + f64::from(offset), moment);
    Asked {
        per_mille: torque.value,
        status: Statusword::TARGET_FOLLOWED,
        is_limited: torque.is_limited,
        error: 0,
    }
}
