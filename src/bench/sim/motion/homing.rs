//! Homing mode (CiA 402-2, 11): methods 33 and 34, index pulse in negative or positive direction, and 37 (formerly 35),
//! current position.
//!
//! The home position then reads as the home offset (607Ch). 60E3h lists the methods.

use crate::motion::axis::{Axis, StepInput};
use crate::motion::ramp::{Demand, Profile};
use crate::motion::reached::Standstill;
use crate::motion::units::signed;
use crate::motion::{TorqueDemand, bits, limits};
use canopen::drive::Controlword;
use canopen::object::Object;

/// Homing method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Method {
    NegativeIndex,
    PositiveIndex,
    Here,
}

impl Method {
    /// Returns the method of 6098h; 35 and 37 are 34 in a drive that moves (`homing_moves`).
    const fn from_number(number: i8, homing_moves: bool) -> Option<Self> {
        match number {
            33 => Some(Self::NegativeIndex),
            34 => Some(Self::PositiveIndex),
            35 | 37 if homing_moves => Some(Self::PositiveIndex),
            35 | 37 => Some(Self::Here),
            _ => None,
        }
    }
}

/// Progress of a homing.
#[derive(Clone, Copy, Debug, Default)]
enum Progress {
    #[default]
    NotStarted,
    /// Searches the index pulse at this position; the sign is the direction.
    Searching {
        index: f64,
        sign: f64,
    },
    /// Decelerates with the home position known.
    Found,
    Done,
    /// Decelerates without a home position.
    Interrupted,
    Failed,
}

/// State of homing mode.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Homing {
    progress: Progress,
    standstill: Standstill,
    is_at_rest: bool,
}

impl Homing {
    /// Handles bit 4: a rising edge starts homing, a falling edge interrupts it.
    pub(super) fn on_controlword(
        &mut self,
        word: Controlword,
        is_rising_edge: bool,
        axis: &mut Axis,
        input: &StepInput<'_>,
    ) {
        if is_rising_edge {
            self.start(axis, input);
        } else if !bits::is_started(word) {
            self.interrupt();
        }
    }

    /// Interrupts the search, after a halt or a falling bit 4.
    pub(super) const fn interrupt(&mut self) {
        if matches!(self.progress, Progress::Searching { .. }) {
            self.progress = Progress::Interrupted;
        }
    }

    fn start(&mut self, axis: &mut Axis, input: &StepInput<'_>) {
        self.is_at_rest = false;
        let position = input.actual.position;
        let turn = axis.shaft.units.increments_per_revolution();
        let phase = input.actual.index;
        let turns = (position - phase) / turn;
        let number = input.dictionary.i8(Object::HOMING_METHOD);
        self.progress = match Method::from_number(number, axis.homing_moves) {
            Some(Method::Here) => {
                set_home(axis, position, input);
                Progress::Found
            }
            Some(Method::NegativeIndex) => {
                let index = (turns.ceil() - 1.0) * turn + phase;
                Progress::Searching { index, sign: -1.0 }
            }
            Some(Method::PositiveIndex) => {
                let index = (turns.floor() + 1.0) * turn + phase;
                Progress::Searching { index, sign: 1.0 }
            }
            None => Progress::Failed,
        };
    }

    pub(super) fn step(&mut self, axis: &mut Axis, input: &StepInput<'_>) -> TorqueDemand {
        let speed = self.search(axis, input);
        if !self.is_at_rest {
            let units = &axis.shaft.units;
            let rate = limits::acceleration(units, input.dictionary, Object::HOMING_ACCELERATION);
            let top = limits::top_speed(units, input.dictionary);
            let profile = Profile::new(top, rate, rate);
            axis.demand = axis.demand.toward_velocity(input.dt, speed, &profile);
            self.hold_at_standstill(axis, input);
        }
        let torque = if self.is_at_rest {
            axis.follow_position(0.0, input)
        } else {
            axis.follow_velocity(0.0, input)
        };
        TorqueDemand {
            per_mille: torque.value,
            status: self.status(self.is_at_rest),
            is_limited: torque.is_limited,
            error: 0,
        }
    }

    /// Returns the search velocity, in increments/s; zero once the index pulse is found.
    fn search(&mut self, axis: &mut Axis, input: &StepInput<'_>) -> f64 {
        let Progress::Searching { index, sign } = self.progress else { return 0.0 };
        if (input.actual.position - index) * sign >= 0.0 {
            set_home(axis, index, input);
            self.progress = Progress::Found;
            return 0.0;
        }
        sign * axis.shaft.units.size(input.dictionary, Object::HOMING_SPEED_ZERO)
    }

    /// Holds the position once the demand is zero and the motor at standstill.
    fn hold_at_standstill(&mut self, axis: &mut Axis, input: &StepInput<'_>) {
        let is_slow = self.standstill.is_at_rest(axis, input);
        let is_searching = matches!(self.progress, Progress::Searching { .. });
        if is_searching || !is_slow || axis.demand.velocity.abs() > 0.0 {
            return;
        }
        self.is_at_rest = true;
        axis.demand = Demand::at(input.actual.position);
        axis.is_homed |= matches!(self.progress, Progress::Found);
        self.progress = match self.progress {
            Progress::Found => Progress::Done,
            Progress::Interrupted => Progress::NotStarted,
            Progress::NotStarted
            | Progress::Searching { .. }
            | Progress::Done
            | Progress::Failed => self.progress,
        };
    }

    /// Returns statusword bits 10, 12 and 13.
    pub(super) const fn status(&self, is_at_rest: bool) -> u16 {
        let outcome = match self.progress {
            Progress::Found | Progress::Done => bits::HOMING_ATTAINED,
            Progress::Failed => bits::HOMING_ERROR,
            Progress::NotStarted | Progress::Searching { .. } | Progress::Interrupted => 0,
        };
        outcome | bits::bit(bits::TARGET_REACHED, is_at_rest)
    }
}

fn set_home(axis: &mut Axis, position: f64, input: &StepInput<'_>) {
    let offset = f64::from(signed(input.dictionary, Object::HOME_OFFSET));
    axis.shaft.set_home(position, offset);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bits::{HOMING_ATTAINED, HOMING_ERROR, TARGET_REACHED};
    use crate::motion::fixture::{ENABLED, Fixture, HALT, START, put};
    use crate::motion::rotor::Rotor;
    use canopen::object::Object;

    const MODE: i8 = 6;

    fn fixture(method: i32, position: f64) -> Fixture {
        let rotor = Rotor { position, coulomb: 30.0, ..Rotor::default() };
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
    fn method_37_sets_the_home_offset_here() {
        for method in [35, 37] {
            let mut fixture = fixture(method, 40_000.0);
            assert_eq!(fixture.position(), 40_000);
            assert_eq!(status(&fixture), (false, false, true), "not started");
            fixture.set_controlword(ENABLED | START);
            fixture.run(20);
            assert_eq!(status(&fixture), (false, true, true), "completed");
            assert!((fixture.position() + 1_234).abs() < 20, "{}", fixture.position());
            assert!((fixture.read(Object::POSITION_DEMAND) + 1_234).abs() < 20);
        }
    }

    #[test]
    fn index_pulse_is_found_in_both_directions() {
        for (method, start, index) in
            [(33, 40_000.0, 32_768), (34, 40_000.0, 49_152), (33, 32_768.0, 16_384)]
        {
            let mut fixture = fixture(method, start);
            fixture.set_controlword(ENABLED | START);
            fixture.run(50);
            assert_eq!(status(&fixture), (false, false, false), "in progress");
            fixture.until(5_000, |b| b.has(HOMING_ATTAINED) && b.has(TARGET_REACHED));
            let counts = fixture.rotor.feedback().position;
            assert_eq!(fixture.position(), counts - index - 1_234, "{method}");
            assert!((counts - index).abs() < 2_000, "it stays near");
        }
    }

    #[test]
    fn index_pulse_is_at_its_angle_of_the_motor() {
        for (method, index) in [(33, 37_768.0), (34, 54_152.0)] {
            let mut fixture = fixture(method, 40_000.0);
            fixture.rotor.index = 5_000.0;
            fixture.set_controlword(ENABLED | START);
            fixture.until(5_000, |b| b.has(HOMING_ATTAINED) && b.has(TARGET_REACHED));
            let beyond = f64::from(fixture.rotor.feedback().position) - index;
            assert!((f64::from(fixture.position() + 1_234) - beyond).abs() < 1.0, "{method}");
        }
    }

    #[test]
    fn moving_methods_35_and_37_are_method_34() {
        let run = |method, homing_moves| {
            let mut fixture = fixture(method, 40_000.0);
            fixture.motion = fixture.motion.with_moving_homing(homing_moves);
            fixture.set_controlword(ENABLED | START);
            let ticks = (0..3_000).map(|_| fixture.tick()).collect::<Vec<_>>();
            (ticks, fixture.position())
        };
        let positive = run(34, false);
        for method in [34, 35, 37] {
            assert_eq!(run(method, true), positive, "{method}");
        }
        assert_eq!(run(33, true), run(33, false), "other methods are unchanged");
    }

    #[test]
    fn homing_torque_stays_within_max_torque() {
        for (method, homing_moves) in [(37, false), (37, true), (33, false), (34, false)] {
            for load in [0.0, 30.0, -30.0] {
                let rotor = Rotor { position: 40_000.0, load, ..Rotor::default() };
                let mut fixture = Fixture::with(MODE, rotor, |dictionary| {
                    put(dictionary, Object::MAX_TORQUE, 50);
                    // Faster than 50 ‰ allow.
                    put(dictionary, Object::HOMING_SPEED_ZERO, 50_000);
                    put(dictionary, Object::HOMING_ACCELERATION, 100_000_000);
                });
                fixture.motion = fixture.motion.with_moving_homing(homing_moves);
                fixture.put(Object::HOMING_METHOD, method);
                fixture.run(500);
                fixture.set_controlword(ENABLED | START);
                let mut most = 0.0_f64;
                for _ in 0..6_000 {
                    most = most.max(fixture.tick().per_mille.abs());
                }
                assert!(most <= 50.0, "{most} ‰, method {method}, load {load} ‰");
                let has_moved = method != 37 || homing_moves;
                assert_eq!(most >= 49.9, has_moved, "{most} ‰, method {method}, load {load} ‰");
                assert_eq!(status(&fixture), (false, true, true), "method {method}, load {load} ‰");
            }
        }
    }

    #[test]
    fn homing_is_known_once_it_has_completed() {
        let mut fixture = fixture(34, 40_000.0);
        fixture.set_controlword(ENABLED | START);
        while !(fixture.has(HOMING_ATTAINED) && fixture.has(TARGET_REACHED)) {
            assert!(!fixture.motion.is_homed());
            fixture.tick();
        }
        assert!(fixture.motion.is_homed());
        fixture.begin(10);
        assert!(fixture.motion.is_homed(), "in other modes as well");
        let position = fixture.position();
        fixture.motion.forget_homing();
        assert_eq!((fixture.motion.is_homed(), fixture.position()), (false, position));
    }

    #[test]
    fn polarity_inverts_the_display_not_the_search() {
        let mut fixture = fixture(34, 40_000.0);
        fixture.put(Object::POLARITY, 0x80);
        fixture.begin(MODE);
        fixture.set_controlword(ENABLED | START);
        fixture.until(5_000, |b| b.has(HOMING_ATTAINED) && b.has(TARGET_REACHED));
        let beyond = fixture.rotor.feedback().position - 49_152;
        assert!(beyond >= 0 && fixture.position() == -beyond - 1_234, "{beyond} beyond the index");
    }

    #[test]
    fn supported_methods_are_those_of_60e3h() {
        let dictionary = crate::motion::fixture::drive();
        let count = dictionary.unsigned(Object::SUPPORTED_HOMING_METHODS);
        let listed: Vec<i8> = (1..=count)
            .map(|sub| {
                let sub = u8::try_from(sub).unwrap();
                dictionary.i8(Object { sub, ..Object::SUPPORTED_HOMING_METHODS })
            })
            .collect();
        for method in i8::MIN..=i8::MAX {
            assert_eq!(
                Method::from_number(method, false).is_some(),
                listed.contains(&method),
                "{method}"
            );
        }
    }

    #[test]
    fn unsupported_method_is_a_homing_error_without_motion() {
        let mut fixture = fixture(17, 40_000.0);
        fixture.set_controlword(ENABLED | START);
        fixture.run(100);
        assert_eq!(status(&fixture), (true, false, true));
        assert!((fixture.position() - 40_000).abs() < 50);
    }

    #[test]
    fn falling_bit_4_and_halt_interrupt_homing() {
        for word in [ENABLED, ENABLED | START | HALT] {
            let mut fixture = fixture(33, 40_000.0);
            fixture.set_controlword(ENABLED | START);
            fixture.run(50);
            fixture.set_controlword(word);
            fixture.until(1_000, |fixture| fixture.has(TARGET_REACHED));
            assert_eq!(status(&fixture), (false, false, true));
            let position = fixture.position();
            fixture.set_controlword(ENABLED);
            fixture.run(200);
            assert!((fixture.position() - position).abs() < 50, "no motion without a new start");
            fixture.set_controlword(ENABLED | START);
            fixture.until(5_000, |fixture| fixture.has(HOMING_ATTAINED));
        }
    }
}
