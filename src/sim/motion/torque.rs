//! The torque modes: profile torque (CiA 402-2, 13), where 6071h acts on the slope of 6087h, and cyclic
//! synchronous torque (CiA 402-2, 15.4), where it acts at once.
//!
//! No slope in the cyclic mode: the master makes the profile there, and a torque that is reflected to a
//! hand must not lag behind it.

use crate::motion::Asked;
use crate::motion::axis::Axis;
use crate::motion::axis::Moment;
use crate::motion::bits;
use canopen::dictionary::Dictionary;
use canopen::drive::Statusword;
use canopen::object::Object;

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

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "whole numbers are exact, and limits are kept exactly")]
mod tests {
    use super::*;
    use crate::motion::bits::TARGET_REACHED;
    use crate::motion::fixture::ENABLED;
    use crate::motion::fixture::Fixture;
    use crate::motion::fixture::HALT;
    use crate::motion::rotor::Rotor;

    fn locked(mode: i8) -> Fixture {
        Fixture::with(mode, Rotor { inertia: 1e9, ..Rotor::default() }, |_| {})
    }

    #[test]
    fn a_profile_torque_takes_its_slope_up_and_down() {
        let mut fixture = locked(4);
        fixture.put(Object::TORQUE_SLOPE, 2_000);
        fixture.put(Object::TARGET_TORQUE, 500);
        fixture.sync();
        assert_eq!(fixture.asked.per_mille, 0.0, "no time, no slope");
        fixture.run(100);
        assert!((fixture.asked.per_mille - 200.0).abs() < 1e-9);
        assert!(!fixture.has(TARGET_REACHED));
        fixture.run(160);
        assert!(fixture.has(TARGET_REACHED) && fixture.asked.per_mille == 500.0);
        fixture.put(Object::TARGET_TORQUE, -500);
        fixture.run(250);
        assert!(fixture.asked.per_mille.abs() < 1e-9);
    }

    #[test]
    fn a_halted_torque_goes_down_and_comes_back() {
        let mut fixture = locked(4);
        fixture.put(Object::TARGET_TORQUE, 500);
        fixture.run(100);
        fixture.word(ENABLED | HALT);
        fixture.run(20);
        assert!((fixture.asked.per_mille - 300.0).abs() < 1e-9, "{:?}", fixture.asked);
        fixture.run(40);
        assert!(fixture.asked.per_mille == 0.0 && fixture.has(TARGET_REACHED));
        fixture.word(ENABLED);
        fixture.run(10);
        assert!((fixture.asked.per_mille - 100.0).abs() < 1e-9, "{:?}", fixture.asked);
    }

    #[test]
    fn a_cyclic_torque_is_there_at_once() {
        let mut fixture = locked(10);
        for (target, offset, asked) in
            [(100, 0, 100.0), (-250, 50, -200.0), (3_000, 1, 3_000.0), (0, 0, 0.0)]
        {
            fixture.put(Object::TARGET_TORQUE, target);
            fixture.put(Object::TORQUE_OFFSET, offset);
            fixture.sync();
            assert_eq!(fixture.asked.per_mille, asked);
            assert_eq!(fixture.asked.status, Statusword::TARGET_FOLLOWED);
            assert_eq!(fixture.asked.is_limited, target + offset > 3_000);
        }
    }

    #[test]
    fn a_halted_cyclic_torque_is_gone_at_once_and_follows_nothing() {
        let mut fixture = locked(10);
        fixture.put(Object::TARGET_TORQUE, 500);
        fixture.sync();
        fixture.word(ENABLED | HALT);
        assert_eq!((fixture.asked.per_mille, fixture.asked.status), (0.0, 0));
        fixture.word(ENABLED);
        assert_eq!(fixture.asked.per_mille, 500.0);
    }

    #[test]
    fn a_limit_holds_the_slope_back_with_the_torque() {
        let mut fixture = locked(4);
        fixture.put(Object::MAX_TORQUE, 100);
        fixture.put(Object::TARGET_TORQUE, 1_000);
        fixture.run(200);
        assert!(fixture.asked.per_mille == 100.0 && fixture.asked.is_limited);
        fixture.put(Object::TARGET_TORQUE, 0);
        fixture.run(5);
        assert!((fixture.asked.per_mille - 50.0).abs() < 1e-9, "{:?}", fixture.asked);
    }
}
