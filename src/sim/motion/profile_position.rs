//! Profile position mode (CiA 402-2, 10): set-points one after another, or one in place of another.
//!
//! One set-point can wait for the one before to be reached. Bit 9 of the controlword (to pass a target
//! without stopping) is not heeded, and 60F2h is not there: a relative target counts from the target
//! before it, and the axis is linear.

use crate::canopen::drive::Controlword;
use crate::canopen::object::Object;
use crate::sim::motion::Asked;
use crate::sim::motion::axis::Axis;
use crate::sim::motion::axis::Moment;
use crate::sim::motion::bits;
use crate::sim::motion::following;
use crate::sim::motion::following::Following;
use crate::sim::motion::limits;
use crate::sim::motion::ramp::Course;
use crate::sim::motion::ramp::Profile;
use crate::sim::motion::reached::Reached;
use crate::sim::motion::units::signed;

/// Where to go, and how.
#[derive(Clone, Copy, Debug)]
struct SetPoint {
    /// A place.
    target: f64,
    profile: Profile,
    /// 607Dh has kept it from being further away.
    is_limited: bool,
}

/// The mode.
#[derive(Clone, Copy, Debug)]
pub(super) struct ProfilePosition {
    now: SetPoint,
    next: Option<SetPoint>,
    /// To `now`, and how long it has been under way, in s.
    course: Course,
    time: f64,
    /// Bit 4 has been answered, and is still set.
    is_answered: bool,
    reached: Reached,
    following: Following,
}

impl ProfilePosition {
    /// The motor comes to rest as the profile lets it, and stays.
    pub(super) fn begin(axis: &Axis, moment: &Moment<'_>) -> Self {
        let profile = limits::profile(&axis.shaft.units, moment.dictionary);
        let target = profile.place_of_rest(&axis.demand);
        let now = SetPoint { target, profile, is_limited: false };
        Self {
            now,
            next: None,
            course: Course::to_place(axis.demand, target, &profile),
            time: 0.0,
            is_answered: false,
            reached: Reached::default(),
            following: Following::default(),
        }
    }

    /// The handshake of bit 4 and bit 12 (CiA 402-2, figures 20 to 22).
    pub(super) fn on_controlword(
        &mut self,
        word: Controlword,
        has_risen: bool,
        axis: &Axis,
        moment: &Moment<'_>,
    ) {
        if !bits::is_started(word) {
            self.is_answered = false;
        }
        if !has_risen {
            return;
        }
        if bits::is_immediate(word) || (self.is_arrived() && self.next.is_none()) {
            self.next = None;
            self.is_answered = true;
            self.go_to(self.set_point(word, axis, moment), axis);
        } else if self.next.is_none() {
            self.is_answered = true;
            self.next = Some(self.set_point(word, axis, moment));
        }
    }

    pub(super) fn step(&mut self, axis: &mut Axis, moment: &Moment<'_>) -> Asked {
        self.time += moment.dt;
        if let Some(next) = self.next.filter(|_| self.is_arrived()) {
            self.next = None;
            self.go_to(next, axis);
        }
        axis.demand = self.course.at(self.time);
        let torque = axis.follow_place(0.0, moment);
        let is_there = self.reached.is_there(axis, moment, self.is_arrived());
        let is_lost = self.following.is_lost(axis, moment);
        Asked {
            per_mille: torque.value,
            status: bits::bit(bits::TARGET_REACHED, is_there && self.next.is_none())
                | self.acknowledgement()
                | bits::bit(bits::FOLLOWING_ERROR, is_lost),
            is_limited: torque.is_limited || self.now.is_limited,
            error: if is_lost { following::FOLLOWING_ERROR } else { 0 },
        }
    }

    /// After a halt the way is continued.
    pub(super) fn resume(&mut self, axis: &Axis) {
        self.go_to(self.now, axis);
    }

    /// Bit 12.
    pub(super) const fn acknowledgement(&self) -> u16 {
        bits::bit(bits::SET_POINT_ACKNOWLEDGED, self.is_answered || self.next.is_some())
    }

    /// What the objects say now. They may change before it is its turn.
    fn set_point(&self, word: Controlword, axis: &Axis, moment: &Moment<'_>) -> SetPoint {
        let shaft = &axis.shaft;
        let units = f64::from(signed(moment.dictionary, Object::TARGET_POSITION));
        let base = self.now.target;
        let from = if bits::is_relative(word) { f64::from(shaft.shown(base)) } else { 0.0 };
        let limited = limits::position(moment.dictionary, from + units);
        SetPoint {
            target: shaft.place_beside(base, limited.value),
            profile: limits::profile(&shaft.units, moment.dictionary),
            is_limited: limited.is_limited,
        }
    }

    fn go_to(&mut self, set_point: SetPoint, axis: &Axis) {
        self.now = set_point;
        self.course = Course::to_place(axis.demand, set_point.target, &set_point.profile);
        self.time = 0.0;
        self.reached = Reached::default();
    }

    fn is_arrived(&self) -> bool {
        self.time >= self.course.duration()
    }
}
