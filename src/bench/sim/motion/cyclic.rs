//! Cyclic synchronous position and velocity modes (CiA 402-2, 15.2 and 15.3): one set-point per SYNC; the master
//! generates the profile.
//!
//! The demand moves linearly to each set-point within the interpolation time (60C2h) and then stays. Before the first
//! set-point the motor holds its position.

use crate::motion::axis::{Axis, StepInput};
use crate::motion::following::Following;
use crate::motion::limits::{self, LimitedValue, within};
use crate::motion::ramp::Demand;
use crate::motion::units::{saturated, signed};
use crate::motion::{TorqueDemand, bits};
use canopen::drive::Statusword;
use canopen::error_codes::FOLLOWING_ERROR;
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;

/// Linear interpolation to a set-point.
#[derive(Clone, Copy, Debug)]
struct Line {
    end: f64,
    /// Change per s.
    slope: f64,
}

impl Line {
    const fn at(end: f64) -> Self {
        Self { end, slope: 0.0 }
    }

    /// Returns the value and its slope `dt` s after `value`.
    fn after(&self, value: f64, dt: f64) -> (f64, f64) {
        let left = self.end - value;
        let distance = self.slope * dt;
        let slope = if left.abs() > 0.0 { self.slope } else { 0.0 };
        (if distance.abs() < left.abs() { value + distance } else { self.end }, slope)
    }
}

/// Detects new set-points.
#[derive(Clone, Copy, Debug)]
struct SetPoints {
    last: i32,
    /// Time has passed since the start of the mode.
    is_under_way: bool,
    is_any: bool,
}

impl SetPoints {
    /// Starts with `old`, a set-point from before the start of the mode.
    const fn begin(old: i32) -> Self {
        Self { last: old, is_under_way: false, is_any: false }
    }

    /// Returns the set-point if it is new: another value, or the first SYNC (`dt` = 0) of the mode.
    fn take(&mut self, set_point: i32, dt: f64) -> Option<i32> {
        let is_sync = dt <= 0.0 && self.is_under_way;
        let is_new = set_point != self.last || (is_sync && !self.is_any);
        self.is_under_way |= dt > 0.0;
        self.is_any |= is_new;
        self.last = set_point;
        is_new.then_some(set_point)
    }
}

/// Cyclic synchronous position mode.
#[derive(Clone, Copy, Debug)]
pub(super) struct CyclicPosition {
    set_points: SetPoints,
    line: Line,
    is_limited: bool,
    following: Following,
}

impl CyclicPosition {
    pub(super) fn begin(axis: &mut Axis, dictionary: &Dictionary) -> Self {
        axis.demand = Demand::at(axis.demand.position);
        Self {
            set_points: SetPoints::begin(position(dictionary)),
            line: Line::at(axis.demand.position),
            is_limited: false,
            following: Following::default(),
        }
    }

    pub(super) fn step(&mut self, axis: &mut Axis, input: &StepInput<'_>) -> TorqueDemand {
        let dictionary = input.dictionary;
        if let Some(target) = self.set_points.take(position(dictionary), input.dt) {
            self.set_target(target, axis, dictionary);
        }
        let (position, slope) = self.line.after(axis.demand.position, input.dt);
        let offset = f64::from(signed(dictionary, Object::VELOCITY_OFFSET));
        // A velocity offset (60B1h) is the master's feed-forward and replaces the slope.
        let has_offset = offset.abs() > 0.0;
        let velocity = if has_offset { axis.shaft.units.velocity(offset) } else { slope };
        axis.demand = Demand { position, velocity, acceleration: 0.0 };
        let torque = axis.follow_position(f64::from(dictionary.i16(Object::TORQUE_OFFSET)), input);
        let is_lost = self.following.is_lost(axis, input);
        TorqueDemand {
            per_mille: torque.value,
            status: Statusword::TARGET_FOLLOWED | bits::bit(bits::FOLLOWING_ERROR, is_lost),
            is_limited: torque.is_limited || self.is_limited,
            error: if is_lost { FOLLOWING_ERROR } else { 0 },
        }
    }

    /// Starts a line to the nearest position displayed as `target`, within 607Dh and the speed limits.
    fn set_target(&mut self, target: i32, axis: &Axis, dictionary: &Dictionary) {
        let allowed = limits::position(dictionary, f64::from(target));
        let here = axis.demand.position;
        let end = axis.shaft.nearest_target(here, saturated(allowed.value));
        let top = limits::top_speed(&axis.shaft.units, dictionary);
        let slope = within((end - here) / interpolation_time(dictionary), top);
        self.line = Line { end, slope: slope.value };
        self.is_limited = allowed.is_limited || slope.is_limited;
    }
}

/// Sum of 607Ah and 60B0h; wraps as positions do.
fn position(dictionary: &Dictionary) -> i32 {
    signed(dictionary, Object::TARGET_POSITION)
        .wrapping_add(signed(dictionary, Object::POSITION_OFFSET))
}

/// Cyclic synchronous velocity mode.
#[derive(Clone, Copy, Debug)]
pub(super) struct CyclicVelocity {
    set_points: SetPoints,
    line: Line,
    is_limited: bool,
}

impl CyclicVelocity {
    pub(super) fn begin(axis: &mut Axis, dictionary: &Dictionary) -> Self {
        axis.demand = Demand::at(axis.demand.position);
        Self {
            set_points: SetPoints::begin(velocity(dictionary)),
            line: Line::at(0.0),
            is_limited: false,
        }
    }

    pub(super) fn step(&mut self, axis: &mut Axis, input: &StepInput<'_>) -> TorqueDemand {
        let dictionary = input.dictionary;
        let start = axis.demand.velocity;
        if let Some(target) = self.set_points.take(velocity(dictionary), input.dt) {
            let wanted = axis.shaft.units.velocity(f64::from(target));
            let LimitedValue { value, is_limited } =
                within(wanted, limits::top_speed(&axis.shaft.units, dictionary));
            self.line =
                Line { end: value, slope: (value - start) / interpolation_time(dictionary) };
            self.is_limited = is_limited;
        }
        let (velocity, _) = self.line.after(start, input.dt);
        axis.demand = Demand { velocity, acceleration: 0.0, ..axis.demand };
        let torque = axis.follow_velocity(f64::from(dictionary.i16(Object::TORQUE_OFFSET)), input);
        TorqueDemand {
            per_mille: torque.value,
            status: Statusword::TARGET_FOLLOWED,
            is_limited: torque.is_limited || self.is_limited,
            error: 0,
        }
    }
}

/// Sum of 60FFh and 60B1h; saturates.
fn velocity(dictionary: &Dictionary) -> i32 {
    signed(dictionary, Object::TARGET_VELOCITY)
        .saturating_add(signed(dictionary, Object::VELOCITY_OFFSET))
}

/// Interpolation time (60C2h) in s, from 0.1 ms to 10 s.
fn interpolation_time(dictionary: &Dictionary) -> f64 {
    let value = f64::from(dictionary.unsigned(Object::INTERPOLATION_TIME));
    let exponent = i32::from(dictionary.i8(Object::INTERPOLATION_TIME_INDEX));
    (value * 10.0_f64.powi(exponent)).clamp(MIN_INTERPOLATION_TIME, MAX_INTERPOLATION_TIME)
}

const MIN_INTERPOLATION_TIME: f64 = 1e-4;
const MAX_INTERPOLATION_TIME: f64 = 10.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::fixture::{ENABLED, Fixture, HALT, put};
    use crate::motion::rotor::Rotor;

    const POSITION: i8 = 8;
    const VELOCITY: i8 = 9;

    fn fixture(mode: i8) -> Fixture {
        Fixture::with(mode, Rotor { coulomb: 30.0, ..Rotor::default() }, |_| {})
    }

    /// Runs one SYNC and the `period` ms after it.
    fn cycle(fixture: &mut Fixture, object: Object, set_point: i32, period: u32) {
        fixture.put(object, set_point);
        fixture.sync();
        fixture.run(period);
    }

    #[test]
    fn old_set_point_acts_at_the_first_sync() {
        let mut fixture = Fixture::with(POSITION, Rotor::default(), |dictionary| {
            put(dictionary, Object::TARGET_POSITION, 1_000);
        });
        fixture.run(100);
        assert!(fixture.position().abs() < 5);
        fixture.sync();
        fixture.run(1_000);
        assert!((fixture.position() - 1_000).abs() < 50);
    }

    #[test]
    fn demand_is_interpolated_linearly() {
        let mut fixture = fixture(POSITION);
        fixture.put(Object::INTERPOLATION_TIME, 4);
        fixture.put(Object::TARGET_POSITION, 400);
        fixture.sync();
        let demands: Vec<_> = (0..6)
            .map(|_| {
                fixture.tick();
                (fixture.read(Object::POSITION_DEMAND), fixture.read(Object::VELOCITY_DEMAND))
            })
            .collect();
        let expected =
            [(100, 100_000), (200, 100_000), (300, 100_000), (400, 100_000), (400, 0), (400, 0)];
        assert_eq!(demands, expected);
    }

    #[test]
    fn cyclic_position_follows_a_sine() {
        let mut fixture = fixture(POSITION);
        let mut most = 0.0_f64;
        for millis in 0..4_000 {
            let phase = std::f64::consts::TAU * f64::from(millis) * 1e-3;
            let set_point = saturated(20_000.0 * (1.0 - phase.cos()));
            cycle(&mut fixture, Object::TARGET_POSITION, set_point, 1);
            most = most.max(f64::from(fixture.read(Object::FOLLOWING_ERROR)).abs());
        }
        // Its velocity goes up to 125,664 increments/s.
        assert!(most < 1_500.0, "{most} increments behind");
    }

    #[test]
    fn cyclic_position_follows_a_sine_across_the_wrap() {
        let start = Rotor { position: f64::from(i32::MAX) - 10_000.0, ..Rotor::default() };
        let mut fixture = Fixture::with(POSITION, start, |_| {});
        let begin = fixture.position();
        for millis in 0..2_000 {
            let phase = std::f64::consts::TAU * f64::from(millis) * 1e-3;
            let distance = saturated(20_000.0 * (1.0 - phase.cos()));
            cycle(&mut fixture, Object::TARGET_POSITION, begin.wrapping_add(distance), 1);
            assert!(fixture.read(Object::FOLLOWING_ERROR).abs() < 1_500);
            assert_eq!(fixture.position(), crate::motion::units::wrapped(fixture.rotor.position));
        }
        assert!(fixture.rotor.velocity.abs() < 1e5);
    }

    #[test]
    fn offsets_are_added_to_targets() {
        let mut fixture = fixture(POSITION);
        fixture.put(Object::POSITION_OFFSET, -300);
        cycle(&mut fixture, Object::TARGET_POSITION, 1_000, 1);
        assert_eq!(fixture.read(Object::POSITION_DEMAND), 700);
        fixture.put(Object::TORQUE_OFFSET, 200);
        let before = fixture.tick().per_mille;
        fixture.put(Object::TORQUE_OFFSET, 0);
        let after = fixture.tick().per_mille;
        assert!(before - after > 100.0, "{before} ‰, then {after} ‰");
        let mut fixture = self::fixture(VELOCITY);
        fixture.put(Object::VELOCITY_OFFSET, 500);
        cycle(&mut fixture, Object::TARGET_VELOCITY, -1_000, 1);
        assert_eq!(fixture.read(Object::VELOCITY_DEMAND), -500);
    }

    #[test]
    fn torque_offset_reduces_the_following_error() {
        let dip = |offset| {
            let mut fixture = Fixture::with(
                POSITION,
                Rotor { load: 300.0, torque: 0.0, ..Rotor::default() },
                |_| {},
            );
            fixture.put(Object::TORQUE_OFFSET, offset);
            (0..300).fold(0, |most, _| {
                fixture.tick();
                most.max(fixture.position().abs())
            })
        };
        assert!(dip(300) * 10 < dip(0), "{} and {}", dip(300), dip(0));
    }

    #[test]
    fn set_point_beyond_a_limit_is_followed_to_the_limit() {
        let mut fixture = fixture(POSITION);
        fixture.put(Object::MAX_POSITION_LIMIT, 500);
        cycle(&mut fixture, Object::TARGET_POSITION, 900, 2);
        assert_eq!(fixture.read(Object::POSITION_DEMAND), 500);
        assert!(fixture.demand.is_limited);
        fixture.put(Object::MAX_PROFILE_VELOCITY, 10_000);
        cycle(&mut fixture, Object::TARGET_POSITION, 400, 2);
        assert_eq!(fixture.read(Object::POSITION_DEMAND), 480);
        assert!(fixture.demand.is_limited);
        fixture.run(20);
        assert_eq!(fixture.read(Object::POSITION_DEMAND), 400);
    }

    #[test]
    fn cyclic_velocity_follows_targets_and_halts() {
        let mut fixture = fixture(VELOCITY);
        for _ in 0..500 {
            cycle(&mut fixture, Object::TARGET_VELOCITY, 60_000, 1);
        }
        assert!((fixture.rotor.velocity - 60_000.0).abs() < 500.0);
        assert!(fixture.has(Statusword::TARGET_FOLLOWED));
        fixture.set_controlword(ENABLED | HALT);
        fixture.run(500);
        assert!(fixture.rotor.velocity.abs() < 100.0);
        assert!(!fixture.has(Statusword::TARGET_FOLLOWED));
        fixture.set_controlword(ENABLED);
        fixture.run(500);
        assert!(fixture.rotor.velocity.abs() < 100.0, "waits for a new set-point");
        cycle(&mut fixture, Object::TARGET_VELOCITY, 60_000, 500);
        assert!((fixture.rotor.velocity - 60_000.0).abs() < 500.0);
    }

    #[test]
    fn interpolation_time_is_bounded() {
        let mut dictionary = crate::motion::fixture::drive();
        for (value, index, seconds) in [
            (1, -3, 1e-3),
            (255, -4, 25.5e-3),
            (1, -128, MIN_INTERPOLATION_TIME),
            (255, 63, MAX_INTERPOLATION_TIME),
        ] {
            put(&mut dictionary, Object::INTERPOLATION_TIME, value);
            dictionary.set(Object::INTERPOLATION_TIME_INDEX, &i8::to_le_bytes(index));
            assert!((interpolation_time(&dictionary) - seconds).abs() < 1e-9);
        }
    }
}
