//! Torque modes: profile torque (CiA 402-2, 13), 6071h on the slope of 6087h, and cyclic synchronous torque (CiA 402-2,
//! 15.4), without a slope.
//!
//! The master generates the profile of the cyclic mode: a slope would delay the force reflected to a hand.

use crate::motion::axis::{Axis, StepInput};
use crate::motion::{TorqueDemand, bits};
use canopen::drive::Statusword;
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;

/// Profile torque mode: torque on the slope, in ‰.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ProfileTorque(f64);

impl ProfileTorque {
    /// Starts the slope at the actual torque demand.
    pub(super) const fn begin(axis: &Axis) -> Self {
        Self(axis.torque())
    }

    pub(super) fn step(&mut self, axis: &mut Axis, input: &StepInput<'_>) -> TorqueDemand {
        let target = f64::from(input.dictionary.i16(Object::TARGET_TORQUE));
        self.0 = approach(self.0, target, input);
        let torque = axis.set_torque(self.0, input);
        // The slope starts again at the limit, not beyond it.
        self.0 = torque.value;
        let is_position_reached = (torque.value - target).abs() <= 0.0
            && (input.actual.per_mille - target).abs() <= TORQUE_WINDOW;
        TorqueDemand {
            per_mille: torque.value,
            status: bits::bit(bits::TARGET_REACHED, is_position_reached),
            is_limited: torque.is_limited,
            error: 0,
        }
    }
}

/// Distance within which a target torque counts as reached, in ‰: no object defines it.
const TORQUE_WINDOW: f64 = 20.0;

/// Returns `torque` one step closer to `target` on the slope of 6087h, in ‰.
pub(super) fn approach(torque: f64, target: f64, input: &StepInput<'_>) -> f64 {
    let change = slope(input.dictionary) * input.dt;
    torque + (target - torque).clamp(-change, change)
}

/// Torque slope (6087h), in ‰/s.
fn slope(dictionary: &Dictionary) -> f64 {
    f64::from(dictionary.unsigned(Object::TORQUE_SLOPE)).max(1.0)
}

/// Runs one step of cyclic synchronous torque mode: 6071h plus 60B2h, without a slope.
pub(super) fn step_cyclic(axis: &mut Axis, input: &StepInput<'_>) -> TorqueDemand {
    let target = input.dictionary.i16(Object::TARGET_TORQUE);
    let offset = input.dictionary.i16(Object::TORQUE_OFFSET);
    let torque = axis.set_torque(f64::from(target) + f64::from(offset), input);
    TorqueDemand {
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
    use crate::motion::fixture::{ENABLED, Fixture, HALT};
    use crate::motion::rotor::Rotor;

    fn locked(mode: i8) -> Fixture {
        Fixture::with(mode, Rotor { inertia: 1e9, ..Rotor::default() }, |_| {})
    }

    #[test]
    fn profile_torque_follows_its_slope() {
        let mut fixture = locked(4);
        fixture.put(Object::TORQUE_SLOPE, 2_000);
        fixture.put(Object::TARGET_TORQUE, 500);
        fixture.sync();
        assert_eq!(fixture.demand.per_mille, 0.0, "no time, no slope");
        fixture.run(100);
        assert!((fixture.demand.per_mille - 200.0).abs() < 1e-9);
        assert!(!fixture.has(TARGET_REACHED));
        fixture.run(160);
        assert!(fixture.has(TARGET_REACHED) && fixture.demand.per_mille == 500.0);
        fixture.put(Object::TARGET_TORQUE, -500);
        fixture.run(250);
        assert!(fixture.demand.per_mille.abs() < 1e-9);
    }

    #[test]
    fn halt_lowers_profile_torque_and_its_end_restores_it() {
        let mut fixture = locked(4);
        fixture.put(Object::TARGET_TORQUE, 500);
        fixture.run(100);
        fixture.set_controlword(ENABLED | HALT);
        fixture.run(20);
        assert!((fixture.demand.per_mille - 300.0).abs() < 1e-9, "{:?}", fixture.demand);
        fixture.run(40);
        assert!(fixture.demand.per_mille == 0.0 && fixture.has(TARGET_REACHED));
        fixture.set_controlword(ENABLED);
        fixture.run(10);
        assert!((fixture.demand.per_mille - 100.0).abs() < 1e-9, "{:?}", fixture.demand);
    }

    #[test]
    fn cyclic_torque_acts_at_once() {
        let mut fixture = locked(10);
        for (target, offset, demand) in
            [(100, 0, 100.0), (-250, 50, -200.0), (3_000, 1, 3_000.0), (0, 0, 0.0)]
        {
            fixture.put(Object::TARGET_TORQUE, target);
            fixture.put(Object::TORQUE_OFFSET, offset);
            fixture.sync();
            assert_eq!(fixture.demand.per_mille, demand);
            assert_eq!(fixture.demand.status, Statusword::TARGET_FOLLOWED);
            assert_eq!(fixture.demand.is_limited, target + offset > 3_000);
        }
    }

    #[test]
    fn halt_removes_cyclic_torque_at_once() {
        let mut fixture = locked(10);
        fixture.put(Object::TARGET_TORQUE, 500);
        fixture.sync();
        fixture.set_controlword(ENABLED | HALT);
        assert_eq!((fixture.demand.per_mille, fixture.demand.status), (0.0, 0));
        fixture.set_controlword(ENABLED);
        assert_eq!(fixture.demand.per_mille, 500.0);
    }

    #[test]
    fn slope_continues_from_the_limit() {
        let mut fixture = locked(4);
        fixture.put(Object::MAX_TORQUE, 100);
        fixture.put(Object::TARGET_TORQUE, 1_000);
        fixture.run(200);
        assert!(fixture.demand.per_mille == 100.0 && fixture.demand.is_limited);
        fixture.put(Object::TARGET_TORQUE, 0);
        fixture.run(5);
        assert!((fixture.demand.per_mille - 50.0).abs() < 1e-9, "{:?}", fixture.demand);
    }
}
