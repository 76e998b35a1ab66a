//! Cyclic synchronous position and velocity modes (CiA 402-2, 15.2 and 15.3): the master makes the
//! profile, one set-point a SYNC.
//!
//! From one set-point to the next the demand goes in a straight line and takes 60C2h for it; then it
//! stays until the next comes. What 6060h is set to before any set-point has come keeps the motor where
//! it is.

use crate::canopen::dictionary::Dictionary;
use crate::canopen::drive::Statusword;
use crate::canopen::object::Object;
use crate::sim::motion::Asked;
use crate::sim::motion::axis::Axis;
use crate::sim::motion::axis::Moment;
use crate::sim::motion::bits;
use crate::sim::motion::following;
use crate::sim::motion::following::Following;
use crate::sim::motion::limits;
use crate::sim::motion::limits::Limited;
use crate::sim::motion::limits::within;
use crate::sim::motion::ramp::Demand;
use crate::sim::motion::units::saturated;
use crate::sim::motion::units::signed;

/// A straight line to a set-point.
#[derive(Clone, Copy, Debug)]
struct Line {
    end: f64,
    /// Per s.
    slope: f64,
}

impl Line {
    const fn at(end: f64) -> Self {
        Self { end, slope: 0.0 }
    }

    /// The value `dt` s after `value`, and the slope it has come on.
    fn after(&self, value: f64, dt: f64) -> (f64, f64) {
        let left = self.end - value;
        let way = self.slope * dt;
        let slope = if left.abs() > 0.0 { self.slope } else { 0.0 };
        (if way.abs() < left.abs() { value + way } else { self.end }, slope)
    }
}

/// Whether a set-point has come: at a SYNC (`dt` = 0), or because it is another one.
#[derive(Clone, Copy, Debug)]
struct SetPoints {
    last: i32,
    is_any: bool,
}

impl SetPoints {
    const fn begin(last: i32) -> Self {
        Self { last, is_any: false }
    }

    fn take(&mut self, set_point: i32, dt: f64) -> Option<i32> {
        let is_new = set_point != self.last || (!self.is_any && dt <= 0.0);
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
        axis.demand = Demand::at(axis.demand.place);
        Self {
            set_points: SetPoints::begin(position(dictionary)),
            line: Line::at(axis.demand.place),
            is_limited: false,
            following: Following::default(),
        }
    }

    pub(super) fn step(&mut self, axis: &mut Axis, moment: &Moment<'_>) -> Asked {
        let dictionary = moment.dictionary;
        if let Some(target) = self.set_points.take(position(dictionary), moment.dt) {
            self.aim_at(target, axis, dictionary);
        }
        let (place, slope) = self.line.after(axis.demand.place, moment.dt);
        let offset = f64::from(signed(dictionary, Object::VELOCITY_OFFSET));
        // 60B1h is the velocity feed-forward of a master that has a better one than the line.
        let has_offset = offset.abs() > 0.0;
        let velocity = if has_offset { axis.shaft.units.velocity(offset) } else { slope };
        axis.demand = Demand { place, velocity, acceleration: 0.0 };
        let torque = axis.follow_place(f64::from(dictionary.i16(Object::TORQUE_OFFSET)), moment);
        let is_lost = self.following.is_lost(axis, moment);
        Asked {
            per_mille: torque.value,
            status: Statusword::TARGET_FOLLOWED | bits::bit(bits::FOLLOWING_ERROR, is_lost),
            is_limited: torque.is_limited || self.is_limited,
            error: if is_lost { following::FOLLOWING_ERROR } else { 0 },
        }
    }

    /// A line to the nearest place that is shown as `target`, within 607Dh and the speed limits.
    fn aim_at(&mut self, target: i32, axis: &Axis, dictionary: &Dictionary) {
        let allowed = limits::position(dictionary, f64::from(target));
        let here = axis.demand.place;
        let end = axis.shaft.place_nearest(here, saturated(allowed.value));
        let top = limits::top_speed(&axis.shaft.units, dictionary);
        let slope = within((end - here) / interpolation_time(dictionary), top);
        self.line = Line { end, slope: slope.value };
        self.is_limited = allowed.is_limited || slope.is_limited;
    }
}

/// 607Ah and 60B0h; the sum wraps as positions do.
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
        axis.demand = Demand::at(axis.demand.place);
        Self {
            set_points: SetPoints::begin(velocity(dictionary)),
            line: Line::at(0.0),
            is_limited: false,
        }
    }

    pub(super) fn step(&mut self, axis: &mut Axis, moment: &Moment<'_>) -> Asked {
        let dictionary = moment.dictionary;
        let start = axis.demand.velocity;
        if let Some(target) = self.set_points.take(velocity(dictionary), moment.dt) {
            let wanted = axis.shaft.units.velocity(f64::from(target));
            let Limited { value, is_limited } =
                within(wanted, limits::top_speed(&axis.shaft.units, dictionary));
            self.line =
                Line { end: value, slope: (value - start) / interpolation_time(dictionary) };
            self.is_limited = is_limited;
        }
        let (velocity, _) = self.line.after(start, moment.dt);
        axis.demand = Demand { velocity, acceleration: 0.0, ..axis.demand };
        let torque = axis.follow_velocity(f64::from(dictionary.i16(Object::TORQUE_OFFSET)), moment);
        Asked {
            per_mille: torque.value,
            status: Statusword::TARGET_FOLLOWED,
            is_limited: torque.is_limited || self.is_limited,
            error: 0,
        }
    }
}

/// 60FFh and 60B1h.
fn velocity(dictionary: &Dictionary) -> i32 {
    signed(dictionary, Object::TARGET_VELOCITY)
        .saturating_add(signed(dictionary, Object::VELOCITY_OFFSET))
}

/// 60C2h in s, from 0.1 ms to 10 s.
fn interpolation_time(dictionary: &Dictionary) -> f64 {
    let value = f64::from(dictionary.unsigned(Object::INTERPOLATION_TIME));
    let exponent = i32::from(dictionary.i8(Object::INTERPOLATION_TIME_INDEX));
    (value * 10.0_f64.powi(exponent)).clamp(SHORTEST, LONGEST)
}

const SHORTEST: f64 = 1e-4;
const LONGEST: f64 = 10.0;
