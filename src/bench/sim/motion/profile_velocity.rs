//! Profile velocity mode (CiA 402-2, 12): 60FFh on the ramps of 6083h and 6084h.

use crate::motion::axis::{Axis, StepInput};
use crate::motion::limits::{self, within};
use crate::motion::ramp::Profile;
use crate::motion::reached::{Standstill, TargetWindow};
use crate::motion::units::signed;
use crate::motion::{TorqueDemand, bits};
use canopen::object::Object;

/// State of profile velocity mode.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ProfileVelocity {
    reached: TargetWindow,
    standstill: Standstill,
}

impl ProfileVelocity {
    pub(super) fn step(&mut self, axis: &mut Axis, input: &StepInput<'_>) -> TorqueDemand {
        let (units, dictionary) = (axis.shaft.units, input.dictionary);
        let wanted = units.velocity(f64::from(signed(dictionary, Object::TARGET_VELOCITY)));
        let top = limits::top_speed(&units, dictionary);
        let target = within(wanted, top);
        let profile = Profile::new(
            top,
            limits::acceleration(&units, dictionary, Object::PROFILE_ACCELERATION),
            limits::deceleration(&units, dictionary, Object::PROFILE_DECELERATION),
        );
        axis.demand = axis.demand.toward_velocity(input.dt, target.value, &profile);
        let torque = axis.follow_velocity(0.0, input);
        let is_reached = self.reached.is_velocity_reached(axis, input, wanted);
        TorqueDemand {
            per_mille: torque.value,
            status: bits::bit(bits::TARGET_REACHED, is_reached) | self.speed_zero(axis, input),
            is_limited: torque.is_limited || target.is_limited,
            error: 0,
        }
    }

    /// Returns statusword bit 12. Bit 13, maximum slippage, is never set.
    pub(super) fn speed_zero(&mut self, axis: &Axis, input: &StepInput<'_>) -> u16 {
        bits::bit(bits::SPEED_ZERO, !self.standstill.has_left_rest(axis, input))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bits::{SPEED_ZERO, TARGET_REACHED};
    use crate::motion::fixture::{ENABLED, Fixture, HALT};
    use crate::motion::rotor::Rotor;

    const MODE: i8 = 3;

    fn fixture() -> Fixture {
        Fixture::with(MODE, Rotor { coulomb: 30.0, load: 100.0, ..Rotor::default() }, |_| {})
    }

    #[test]
    fn velocity_ramps_to_its_target_and_holds_under_load() {
        let mut fixture = fixture();
        fixture.put(Object::TARGET_VELOCITY, -80_000);
        fixture.put(Object::PROFILE_ACCELERATION, 400_000);
        fixture.run(100);
        assert_eq!(fixture.read(Object::VELOCITY_DEMAND), -40_000);
        assert!(!fixture.has(TARGET_REACHED) && !fixture.has(SPEED_ZERO));
        fixture.run(1_000);
        assert_eq!(fixture.read(Object::VELOCITY_DEMAND), -80_000);
        assert!((fixture.rotor.velocity + 80_000.0).abs() < 500.0, "{}", fixture.rotor.velocity);
        assert!(fixture.has(TARGET_REACHED) && !fixture.has(SPEED_ZERO));
    }

    #[test]
    fn acceleration_and_deceleration_have_their_own_ramps() {
        let mut fixture = fixture();
        fixture.put(Object::PROFILE_ACCELERATION, 500_000);
        fixture.put(Object::PROFILE_DECELERATION, 250_000);
        fixture.put(Object::TARGET_VELOCITY, 50_000);
        let is_fast = |b: &mut Fixture| b.read(Object::VELOCITY_DEMAND) == 50_000;
        assert_eq!(fixture.until(500, is_fast), 100);
        fixture.put(Object::TARGET_VELOCITY, 0);
        assert_eq!(fixture.until(500, |b| b.read(Object::VELOCITY_DEMAND) == 0), 200);
    }

    #[test]
    fn speed_limit_applies_and_sets_internal_limit() {
        let mut fixture = fixture();
        fixture.put(Object::MAX_PROFILE_VELOCITY, 10_000);
        fixture.put(Object::TARGET_VELOCITY, 20_000);
        fixture.run(500);
        assert_eq!(fixture.read(Object::VELOCITY_DEMAND), 10_000);
        assert!(fixture.demand.is_limited && !fixture.has(TARGET_REACHED));
    }

    #[test]
    fn halt_stops_and_its_end_restores_the_velocity() {
        let mut fixture = fixture();
        fixture.put(Object::TARGET_VELOCITY, 50_000);
        fixture.run(500);
        fixture.set_controlword(ENABLED | HALT);
        assert!(!fixture.has(TARGET_REACHED));
        fixture.run(500);
        assert!(fixture.has(TARGET_REACHED) && fixture.has(SPEED_ZERO));
        fixture.set_controlword(ENABLED);
        fixture.run(500);
        assert!(fixture.has(TARGET_REACHED) && !fixture.has(SPEED_ZERO));
        assert!((fixture.rotor.velocity - 50_000.0).abs() < 1_000.0);
    }

    #[test]
    fn mode_start_in_motion_keeps_the_velocity() {
        let moving = Rotor { velocity: 50_000.0, ..Rotor::default() };
        let mut fixture = Fixture::with(MODE, moving, |_| {});
        fixture.put(Object::TARGET_VELOCITY, 50_000);
        for _ in 0..100 {
            fixture.tick();
            assert!(fixture.demand.per_mille.abs() < 5.0, "{:?}", fixture.demand);
        }
    }
}
