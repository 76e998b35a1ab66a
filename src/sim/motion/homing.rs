//! Homing mode (CiA 402-2, 11): methods 33 and 34, the next index pulse in negative or positive
//! direction, and 37 with its older form 35, where the motor stands.
//!
//! The home position is shown as the home offset (607Ch) from then on. 60E3h lists what is here.

use crate::motion::Asked;
use crate::motion::axis::Axis;
use crate::motion::axis::Moment;
use crate::motion::bits;
use crate::motion::limits;
use crate::motion::ramp::Demand;
use crate::motion::ramp::Profile;
use crate::motion::reached::Standstill;
use crate::motion::units::signed;
use canopen::drive::Controlword;
use canopen::object::Object;

/// What is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Method {
    NegativeIndex,
    PositiveIndex,
    Here,
}

impl Method {
    const fn of(number: i8) -> Option<Self> {
        match number {
            33 => Some(Self::NegativeIndex),
            34 => Some(Self::PositiveIndex),
            35 | 37 => Some(Self::Here),
            _ => None,
        }
    }
}

/// How far it has come.
#[derive(Clone, Copy, Debug, Default)]
enum Progress {
    #[default]
    NotStarted,
    /// On the way to an index pulse at this place, 1 forward and -1 backward.
    Searching {
        index: f64,
        sign: f64,
    },
    /// Coming to rest with the home position known.
    Found,
    Done,
    /// Coming to rest without one.
    Interrupted,
    Failed,
}

/// The mode.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Homing {
    progress: Progress,
    standstill: Standstill,
    is_at_rest: bool,
}

impl Homing {
    /// Bit 4 starts it, and interrupts it when it falls.
    pub(super) fn on_controlword(
        &mut self,
        word: Controlword,
        has_risen: bool,
        axis: &mut Axis,
        moment: &Moment<'_>,
    ) {
        if has_risen {
            self.start(axis, moment);
        } else if !bits::is_started(word) {
            self.interrupt();
        }
    }

    /// A halt, or bit 4 has fallen.
    pub(super) const fn interrupt(&mut self) {
        if matches!(self.progress, Progress::Searching { .. }) {
            self.progress = Progress::Interrupted;
        }
    }

    fn start(&mut self, axis: &mut Axis, moment: &Moment<'_>) {
        self.is_at_rest = false;
        let place = moment.actual.place;
        let turn = axis.shaft.units.turn();
        self.progress = match Method::of(moment.dictionary.i8(Object::HOMING_METHOD)) {
            Some(Method::Here) => {
                set_home(axis, place, moment);
                Progress::Found
            }
            Some(Method::NegativeIndex) => {
                let index = ((place / turn).ceil() - 1.0) * turn;
                Progress::Searching { index, sign: -1.0 }
            }
            Some(Method::PositiveIndex) => {
                let index = ((place / turn).floor() + 1.0) * turn;
                Progress::Searching { index, sign: 1.0 }
            }
            None => Progress::Failed,
        };
    }

    pub(super) fn step(&mut self, axis: &mut Axis, moment: &Moment<'_>) -> Asked {
        let speed = self.search(axis, moment);
        if !self.is_at_rest {
            let units = &axis.shaft.units;
            let rate = limits::acceleration(units, moment.dictionary, Object::HOMING_ACCELERATION);
            let top = limits::top_speed(units, moment.dictionary);
            let profile = Profile::new(top, rate, rate);
            axis.demand = axis.demand.toward_velocity(moment.dt, speed, &profile);
            self.come_to_rest(axis, moment);
        }
        let torque = if self.is_at_rest {
            axis.follow_place(0.0, moment)
        } else {
            axis.follow_velocity(0.0, moment)
        };
        Asked {
            per_mille: torque.value,
            status: self.status(self.is_at_rest),
            is_limited: torque.is_limited,
            error: 0,
        }
    }

    /// The velocity it searches with, in increments/s; zero once it has found something.
    fn search(&mut self, axis: &mut Axis, moment: &Moment<'_>) -> f64 {
        let Progress::Searching { index, sign } = self.progress else { return 0.0 };
        if (moment.actual.place - index) * sign >= 0.0 {
            set_home(axis, index, moment);
            self.progress = Progress::Found;
            return 0.0;
        }
        sign * axis.shaft.units.size(moment.dictionary, Object::HOMING_SPEED_ZERO)
    }

    /// Once the demand is zero and the motor at rest, its place is kept.
    fn come_to_rest(&mut self, axis: &mut Axis, moment: &Moment<'_>) {
        let is_slow = self.standstill.is_at_rest(axis, moment);
        let is_searching = matches!(self.progress, Progress::Searching { .. });
        if is_searching || !is_slow || axis.demand.velocity.abs() > 0.0 {
            return;
        }
        self.is_at_rest = true;
        axis.demand = Demand::at(moment.actual.place);
        self.progress = match self.progress {
            Progress::Found => Progress::Done,
            Progress::Interrupted => Progress::NotStarted,
            Progress::NotStarted
            | Progress::Searching { .. }
            | Progress::Done
            | Progress::Failed => self.progress,
        };
    }

    /// Bits 10, 12 and 13.
    pub(super) const fn status(&self, is_at_rest: bool) -> u16 {
        let outcome = match self.progress {
            Progress::Found | Progress::Done => bits::HOMING_ATTAINED,
            Progress::Failed => bits::HOMING_ERROR,
            Progress::NotStarted | Progress::Searching { .. } | Progress::Interrupted => 0,
        };
        outcome | bits::bit(bits::TARGET_REACHED, is_at_rest)
    }
}

fn set_home(axis: &mut Axis, place: f64, moment: &Moment<'_>) {
    let offset = f64::from(signed(moment.dictionary, Object::HOME_OFFSET));
    axis.shaft.set_home(place, offset);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bits::HOMING_ATTAINED;
    use crate::motion::bits::HOMING_ERROR;
    use crate::motion::bits::TARGET_REACHED;
    use crate::motion::fixture::ENABLED;
    use crate::motion::fixture::Fixture;
    use crate::motion::fixture::HALT;
    use crate::motion::fixture::START;
    use crate::motion::rotor::Rotor;
    use canopen::object::Object;

    const MODE: i8 = 6;

    fn fixture(method: i32, place: f64) -> Fixture {
        let rotor = Rotor { place, coulomb: 30.0, ..Rotor::default() };
        let mut fixture = Fixture::with(MODE, rotor, |_| {});
        fixture.put(Object::HOMING_METHOD, method);
        fixture.put(Object::HOME_OFFSET, -1_234);
        fixture.run(20);
        fixture
    }

    fn status(fixture: &Fixture) -> (bool, bool, bool) {
        (fixture.has(HOMING_ERROR), fixture.has(HOMING_ATTAINED), fixture.has(TARGET_REACHED))
    }

    #[test]
    fn where_it_stands_is_home_and_is_shown_as_the_home_offset() {
        for method in [35, 37] {
            let mut fixture = fixture(method, 40_000.0);
            assert_eq!(fixture.position(), 40_000);
            assert_eq!(status(&fixture), (false, false, true), "not started");
            fixture.word(ENABLED | START);
            fixture.run(20);
            assert_eq!(status(&fixture), (false, true, true), "completed");
            assert!((fixture.position() + 1_234).abs() < 20, "{}", fixture.position());
            assert!((fixture.shown(Object::POSITION_DEMAND) + 1_234).abs() < 20);
        }
    }

    #[test]
    fn an_index_pulse_is_found_in_either_direction() {
        for (method, start, index) in
            [(33, 40_000.0, 32_768), (34, 40_000.0, 49_152), (33, 32_768.0, 16_384)]
        {
            let mut fixture = fixture(method, start);
            fixture.word(ENABLED | START);
            fixture.run(50);
            assert_eq!(status(&fixture), (false, false, false), "in progress");
            fixture.until(5_000, |b| b.has(HOMING_ATTAINED) && b.has(TARGET_REACHED));
            let counts = fixture.rotor.feedback().position;
            assert_eq!(fixture.position(), counts - index - 1_234, "{method}");
            assert!((counts - index).abs() < 2_000, "it stays near");
        }
    }

    #[test]
    fn polarity_turns_what_is_shown_and_not_what_is_looked_for() {
        let mut fixture = fixture(34, 40_000.0);
        fixture.put(Object::POLARITY, 0x80);
        fixture.begin(MODE);
        fixture.word(ENABLED | START);
        fixture.until(5_000, |b| b.has(HOMING_ATTAINED) && b.has(TARGET_REACHED));
        let beyond = fixture.rotor.feedback().position - 49_152;
        assert!(beyond >= 0 && fixture.position() == -beyond - 1_234, "{beyond} beyond the index");
    }

    #[test]
    fn every_method_the_data_sheet_lists_works_and_no_other_does() {
        let dictionary = crate::motion::fixture::drive();
        let count = dictionary.unsigned(Object::SUPPORTED_HOMING_METHODS);
        let listed: Vec<i8> = (1..=count)
            .map(|sub| {
                let sub = u8::try_from(sub).unwrap();
                dictionary.i8(Object { sub, ..Object::SUPPORTED_HOMING_METHODS })
            })
            .collect();
        for method in i8::MIN..=i8::MAX {
            assert_eq!(Method::of(method).is_some(), listed.contains(&method), "{method}");
        }
    }

    #[test]
    fn a_method_that_is_not_there_is_an_error_and_moves_nothing() {
        let mut fixture = fixture(17, 40_000.0);
        fixture.word(ENABLED | START);
        fixture.run(100);
        assert_eq!(status(&fixture), (true, false, true));
        assert!((fixture.position() - 40_000).abs() < 50);
    }

    #[test]
    fn bit_4_that_falls_and_a_halt_interrupt_it() {
        for word in [ENABLED, ENABLED | START | HALT] {
            let mut fixture = fixture(33, 40_000.0);
            fixture.word(ENABLED | START);
            fixture.run(50);
            fixture.word(word);
            fixture.until(1_000, |fixture| fixture.has(TARGET_REACHED));
            assert_eq!(status(&fixture), (false, false, true));
            let place = fixture.position();
            fixture.word(ENABLED);
            fixture.run(200);
            assert!((fixture.position() - place).abs() < 50, "it does not go on by itself");
            fixture.word(ENABLED | START);
            fixture.until(5_000, |fixture| fixture.has(HOMING_ATTAINED));
        }
    }
}
