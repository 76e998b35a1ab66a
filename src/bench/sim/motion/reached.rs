//! Target reached and standstill detection (CiA 402-2: 6067h to 6070h).

use crate::motion::axis::{Axis, StepInput};
use crate::motion::condition_timer::ConditionTimer;
use crate::motion::following::NO_WINDOW;
use canopen::object::Object;

/// Target reached detection.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TargetWindow(ConditionTimer);

impl TargetWindow {
    /// Returns whether the motor has been in the position window (6067h) for its time (6068h). `is_arrived`: the demand
    /// is at the target, which is sufficient without a window.
    pub(super) fn is_position_reached(
        &mut self,
        axis: &Axis,
        input: &StepInput<'_>,
        is_arrived: bool,
    ) -> bool {
        let window = input.dictionary.optional(Object::POSITION_WINDOW).unwrap_or(NO_WINDOW);
        if window == NO_WINDOW {
            return is_arrived;
        }
        let is_inside = is_arrived && axis.following_error(input).abs() <= f64::from(window);
        let time = input.dictionary.unsigned(Object::POSITION_WINDOW_TIME);
        self.0.has_lasted(input.dt, is_inside, time)
    }

    /// Returns whether the motor has been within the velocity window (606Dh) of `target`, in increments/s, for its
    /// time (606Eh).
    pub(super) fn is_velocity_reached(
        &mut self,
        axis: &Axis,
        input: &StepInput<'_>,
        target: f64,
    ) -> bool {
        let window = axis.shaft.units.size(input.dictionary, Object::VELOCITY_WINDOW);
        let is_inside = (target - input.actual.velocity).abs() <= window;
        let time = input.dictionary.unsigned(Object::VELOCITY_WINDOW_TIME);
        self.0.has_lasted(input.dt, is_inside, time)
    }
}

/// Standstill detection.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Standstill(ConditionTimer);

impl Standstill {
    /// Returns whether the velocity has been below 606Fh for the time in 6070h.
    pub(super) fn is_at_rest(&mut self, axis: &Axis, input: &StepInput<'_>) -> bool {
        let is_slow = !is_moving(axis, input);
        self.0.has_lasted(input.dt, is_slow, time(input))
    }

    /// Returns whether the velocity has been above 606Fh for the time in 6070h; bit 12 of profile velocity mode is
    /// its inverse.
    pub(super) fn has_left_rest(&mut self, axis: &Axis, input: &StepInput<'_>) -> bool {
        let is_moving = is_moving(axis, input);
        self.0.has_lasted(input.dt, is_moving, time(input))
    }
}

fn is_moving(axis: &Axis, input: &StepInput<'_>) -> bool {
    let threshold = axis.shaft.units.size(input.dictionary, Object::VELOCITY_THRESHOLD);
    input.actual.velocity.abs() > threshold
}

fn time(input: &StepInput<'_>) -> u32 {
    input.dictionary.unsigned(Object::VELOCITY_THRESHOLD_TIME)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bits::{SPEED_ZERO, TARGET_REACHED};
    use crate::motion::fixture::{ENABLED, Fixture, START};
    use crate::motion::rotor::Rotor;

    #[test]
    fn disabled_window_reaches_the_target_with_the_demand() {
        for (window, is_reached) in [(NO_WINDOW, true), (100, false), (NO_WINDOW - 1, true)] {
            let stuck = Rotor { coulomb: 5_000.0, ..Rotor::default() };
            let mut fixture = Fixture::with(1, stuck, |_| {});
            fixture.put(Object::POSITION_WINDOW, window.cast_signed());
            fixture.put(Object::TARGET_POSITION, 10_000);
            fixture.set_controlword(ENABLED | START);
            fixture.tick();
            assert!(!fixture.has(TARGET_REACHED), "the demand has not arrived");
            fixture.run(500);
            assert_eq!(fixture.has(TARGET_REACHED), is_reached, "{window}");
        }
    }

    #[test]
    fn speed_zero_clears_after_the_threshold_time() {
        let mut fixture = Fixture::with(3, Rotor { inertia: 1e9, ..Rotor::default() }, |_| {});
        fixture.put(Object::VELOCITY_THRESHOLD, 500);
        fixture.put(Object::VELOCITY_THRESHOLD_TIME, 5);
        let seen = [501.0, 499.0, -501.0, -501.0, -501.0, -501.0, -501.0, 500.0].map(|velocity| {
            fixture.rotor.velocity = velocity;
            fixture.tick();
            fixture.has(SPEED_ZERO)
        });
        assert_eq!(seen, [true, true, true, true, true, true, false, true]);
    }
}
