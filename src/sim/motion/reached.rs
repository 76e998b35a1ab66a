//! Whether the motor is where it was sent, or as fast, or at rest (CiA 402-2: 6067h to 6070h).

use crate::motion::axis::Axis;
use crate::motion::axis::Moment;
use crate::motion::following::NO_WINDOW;
use crate::motion::lasting::Lasting;
use canopen::object::Object;

/// A watch on a target.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reached(Lasting);

impl Reached {
    /// Whether the motor has been in the position window (6067h) for its time (6068h). `is_arrived`: the
    /// demand is at the target; without a window that alone counts.
    pub(super) fn is_there(&mut self, axis: &Axis, moment: &Moment<'_>, is_arrived: bool) -> bool {
        let window = moment.dictionary.unsigned(Object::POSITION_WINDOW);
        if window == NO_WINDOW {
            return is_arrived;
        }
        let is_inside = is_arrived && axis.behind(moment).abs() <= f64::from(window);
        let time = moment.dictionary.unsigned(Object::POSITION_WINDOW_TIME);
        self.0.has_lasted(moment.dt, is_inside, time)
    }

    /// Whether the motor has been within the velocity window (606Dh) of `target`, in increments/s, for
    /// its time (606Eh).
    pub(super) fn is_as_fast(&mut self, axis: &Axis, moment: &Moment<'_>, target: f64) -> bool {
        let window = axis.shaft.units.size(moment.dictionary, Object::VELOCITY_WINDOW);
        let is_inside = (target - moment.actual.velocity).abs() <= window;
        let time = moment.dictionary.unsigned(Object::VELOCITY_WINDOW_TIME);
        self.0.has_lasted(moment.dt, is_inside, time)
    }
}

/// A watch on motion as such.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Standstill(Lasting);

impl Standstill {
    /// Whether the motor has not been faster than 606Fh for the time in 6070h.
    pub(super) fn is_at_rest(&mut self, axis: &Axis, moment: &Moment<'_>) -> bool {
        let is_slow = !is_moving(axis, moment);
        self.0.has_lasted(moment.dt, is_slow, time(moment))
    }

    /// Whether the motor has been faster than 606Fh for the time in 6070h: bit 12 of profile velocity
    /// mode is the contrary.
    pub(super) fn has_left_rest(&mut self, axis: &Axis, moment: &Moment<'_>) -> bool {
        let is_moving = is_moving(axis, moment);
        self.0.has_lasted(moment.dt, is_moving, time(moment))
    }
}

fn is_moving(axis: &Axis, moment: &Moment<'_>) -> bool {
    let threshold = axis.shaft.units.size(moment.dictionary, Object::VELOCITY_THRESHOLD);
    moment.actual.velocity.abs() > threshold
}

fn time(moment: &Moment<'_>) -> u32 {
    moment.dictionary.unsigned(Object::VELOCITY_THRESHOLD_TIME)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bits::SPEED_ZERO;
    use crate::motion::bits::TARGET_REACHED;
    use crate::motion::fixture::ENABLED;
    use crate::motion::fixture::Fixture;
    use crate::motion::fixture::START;
    use crate::motion::rotor::Rotor;

    #[test]
    fn without_a_window_the_demand_alone_says_that_the_target_is_reached() {
        for (window, is_reached) in [(NO_WINDOW, true), (100, false), (NO_WINDOW - 1, true)] {
            let stuck = Rotor { coulomb: 5_000.0, ..Rotor::default() };
            let mut fixture = Fixture::with(1, stuck, |_| {});
            fixture.put(Object::POSITION_WINDOW, window.cast_signed());
            fixture.put(Object::TARGET_POSITION, 10_000);
            fixture.word(ENABLED | START);
            fixture.tick();
            assert!(!fixture.has(TARGET_REACHED), "the demand is on its way");
            fixture.run(500);
            assert_eq!(fixture.has(TARGET_REACHED), is_reached, "{window}");
        }
    }

    #[test]
    fn a_motor_has_to_be_fast_for_a_while_before_it_is_said_to_move() {
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
