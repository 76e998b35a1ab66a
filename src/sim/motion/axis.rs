//! What all modes share: where the shaft is, what is demanded of it, and the servo that obeys.

use crate::motion::limits::Limited;
use crate::motion::limits::TorqueLimits;
use crate::motion::limits::top_speed;
use crate::motion::ramp::Demand;
use crate::motion::servo::Aim;
use crate::motion::servo::Servo;
use crate::motion::shaft::Actual;
use crate::motion::shaft::Shaft;
use crate::motion::tuning::Tuning;
use crate::motion::units::Units;
use crate::motion::units::saturated;
use crate::motion::units::wrapped;
use canopen::dictionary::Dictionary;
use canopen::object::Object;

/// One axis.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Axis {
    pub(super) shaft: Shaft,
    pub(super) demand: Demand,
    servo: Servo,
    /// The torque asked for last, in ‰.
    asked: Limited,
}

/// What a mode has to go by: the time that has passed, in s, the motor, and the objects.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment<'a> {
    pub(super) dt: f64,
    pub(super) actual: Actual,
    pub(super) dictionary: &'a Dictionary,
}

impl Axis {
    pub(super) fn new(tuning: Tuning, units: Units) -> Self {
        Self { servo: Servo::new(tuning), shaft: Shaft::new(units), ..Self::default() }
    }

    /// The motor keeps what it does.
    pub(super) const fn take_over(&mut self, actual: &Actual) {
        self.servo.take_over(actual);
        let Actual { place, velocity, per_mille } = *actual;
        self.demand = Demand { place, velocity, acceleration: 0.0 };
        self.asked = Limited { value: per_mille, is_limited: false };
    }

    /// The torque asked for last, in ‰.
    pub(super) const fn torque(&self) -> f64 {
        self.asked.value
    }

    /// Asks for a torque, in ‰.
    pub(super) fn push(&mut self, torque: f64, moment: &Moment<'_>) -> Limited {
        self.asked = TorqueLimits::of(moment.dictionary).clamp(torque);
        self.asked
    }

    /// Asks for the torque that keeps the motor at the demanded place.
    pub(super) fn follow_place(&mut self, torque: f64, moment: &Moment<'_>) -> Limited {
        self.follow(true, torque, moment)
    }

    /// Asks for the torque that keeps the motor at the demanded velocity, wherever that leads.
    pub(super) fn follow_velocity(&mut self, torque: f64, moment: &Moment<'_>) -> Limited {
        self.demand.place = moment.actual.place;
        self.follow(false, torque, moment)
    }

    fn follow(&mut self, has_place: bool, torque: f64, moment: &Moment<'_>) -> Limited {
        let limits = TorqueLimits::of(moment.dictionary);
        let top_speed = top_speed(&self.shaft.units, moment.dictionary);
        let aim = Aim { demand: self.demand, has_place, torque, top_speed };
        self.asked = if moment.dt > 0.0 {
            self.servo.torque(moment.dt, &aim, &moment.actual, &limits)
        } else {
            let last = limits.clamp(self.asked.value);
            Limited { is_limited: last.is_limited || self.asked.is_limited, ..last }
        };
        self.asked
    }

    /// The hardest it can brake, in increments/s².
    pub(super) fn hardest(&self, moment: &Moment<'_>) -> f64 {
        let limits = TorqueLimits::of(moment.dictionary);
        let against = if self.demand.velocity > 0.0 { f64::MIN } else { f64::MAX };
        self.servo.acceleration(limits.clamp(against).value.abs())
    }

    /// How far the motor is behind the demand, in position units.
    pub(super) fn behind(&self, moment: &Moment<'_>) -> f64 {
        self.shaft.units.way_shown(self.demand.place - moment.actual.place)
    }

    /// 6062h, 60FCh and 60F4h tell of the demanded place.
    pub(super) fn show_place(&self, actual: &Actual, dictionary: &mut Dictionary) {
        let behind = self.shaft.units.way_shown(self.demand.place - actual.place);
        for (object, value) in [
            (Object::POSITION_DEMAND, self.shaft.shown(self.demand.place)),
            (Object::POSITION_DEMAND_INTERNAL, wrapped(self.demand.place)),
            (Object::FOLLOWING_ERROR, saturated(behind)),
        ] {
            dictionary.set(object, &value.to_le_bytes());
        }
    }

    /// 606Bh tells of the demanded velocity.
    pub(super) fn show_velocity(&self, dictionary: &mut Dictionary) {
        let velocity = saturated(self.shaft.units.velocity_shown(self.demand.velocity));
        dictionary.set(Object::VELOCITY_DEMAND, &velocity.to_le_bytes());
    }
}
