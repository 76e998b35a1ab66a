//! Profile position mode (CiA 402-2, 10): single set-points and sets of set-points.
//!
//! One set-point can wait for the one before. Controlword bit 9 (change on set-point) is ignored. 60F2h is absent: a
//! relative target is relative to the previous target, and the axis is linear.

use crate::motion::axis::{Axis, StepInput};
use crate::motion::following::Following;
use crate::motion::ramp::{Profile, Trajectory};
use crate::motion::reached::TargetWindow;
use crate::motion::units::signed;
use crate::motion::{TorqueDemand, bits, limits};
use canopen::drive::Controlword;
use canopen::error_codes::FOLLOWING_ERROR;
use canopen::object::Object;

/// Target position and profile.
#[derive(Clone, Copy, Debug)]
struct SetPoint {
    /// Unwrapped position, in increments.
    target: f64,
    profile: Profile,
    /// 607Dh limits the target.
    is_limited: bool,
}

/// State of profile position mode.
#[derive(Clone, Copy, Debug)]
pub(super) struct ProfilePosition {
    now: SetPoint,
    next: Option<SetPoint>,
    /// Trajectory to `now`.
    trajectory: Trajectory,
    /// Time on the trajectory, in s.
    time: f64,
    /// Bit 4 is acknowledged and still set.
    is_acknowledged: bool,
    reached: TargetWindow,
    following: Following,
}

impl ProfilePosition {
    /// Starts the mode: the motor decelerates on its profile and stays.
    pub(super) fn begin(axis: &Axis, input: &StepInput<'_>) -> Self {
        let profile = limits::profile(&axis.shaft.units, input.dictionary);
        let target = profile.rest_position(&axis.demand);
        let now = SetPoint { target, profile, is_limited: false };
        Self {
            now,
            next: None,
            trajectory: Trajectory::to_position(axis.demand, target, &profile),
            time: 0.0,
            is_acknowledged: false,
            reached: TargetWindow::default(),
            following: Following::default(),
        }
    }

    /// Handles the handshake of bits 4 and 12 (CiA 402-2, figures 20 to 22).
    pub(super) fn on_controlword(
        &mut self,
        word: Controlword,
        is_rising_edge: bool,
        axis: &Axis,
        input: &StepInput<'_>,
    ) {
        if !bits::is_started(word) {
            self.is_acknowledged = false;
        }
        if !is_rising_edge {
            return;
        }
        if bits::is_immediate(word) || (self.is_arrived() && self.next.is_none()) {
            self.next = None;
            self.is_acknowledged = true;
            self.start_motion(self.set_point(word, axis, input), axis);
        } else if self.next.is_none() {
            self.is_acknowledged = true;
            self.next = Some(self.set_point(word, axis, input));
        }
    }

    pub(super) fn step(&mut self, axis: &mut Axis, input: &StepInput<'_>) -> TorqueDemand {
        self.time += input.dt;
        if let Some(next) = self.next.filter(|_| self.is_arrived()) {
            self.next = None;
            self.start_motion(next, axis);
        }
        axis.demand = self.trajectory.at(self.time);
        let torque = axis.follow_position(0.0, input);
        let is_position_reached = self.reached.is_position_reached(axis, input, self.is_arrived());
        let is_lost = self.following.is_lost(axis, input);
        TorqueDemand {
            per_mille: torque.value,
            status: bits::bit(bits::TARGET_REACHED, is_position_reached && self.next.is_none())
                | self.acknowledgement()
                | bits::bit(bits::FOLLOWING_ERROR, is_lost),
            is_limited: torque.is_limited || self.now.is_limited,
            error: if is_lost { FOLLOWING_ERROR } else { 0 },
        }
    }

    /// Continues to the set-point after a halt.
    pub(super) fn resume(&mut self, axis: &Axis) {
        self.start_motion(self.now, axis);
    }

    /// Returns statusword bit 12.
    pub(super) const fn acknowledgement(&self) -> u16 {
        bits::bit(bits::SET_POINT_ACKNOWLEDGED, self.is_acknowledged || self.next.is_some())
    }

    /// Reads a set-point from the objects, which may change before it is executed.
    fn set_point(&self, word: Controlword, axis: &Axis, input: &StepInput<'_>) -> SetPoint {
        let shaft = &axis.shaft;
        let units = f64::from(signed(input.dictionary, Object::TARGET_POSITION));
        let base = self.now.target;
        let from =
            if bits::is_relative(word) { f64::from(shaft.position_units(base)) } else { 0.0 };
        let limited = limits::position(input.dictionary, from + units);
        SetPoint {
            target: shaft.linear_target(base, limited.value),
            profile: limits::profile(&shaft.units, input.dictionary),
            is_limited: limited.is_limited,
        }
    }

    fn start_motion(&mut self, set_point: SetPoint, axis: &Axis) {
        self.now = set_point;
        self.trajectory =
            Trajectory::to_position(axis.demand, set_point.target, &set_point.profile);
        self.time = 0.0;
        self.reached = TargetWindow::default();
    }

    fn is_arrived(&self) -> bool {
        self.time >= self.trajectory.duration()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bits::{SET_POINT_ACKNOWLEDGED, TARGET_REACHED};
    use crate::motion::fixture::{ENABLED, Fixture, HALT, IMMEDIATELY, RELATIVE, START};
    use crate::motion::rotor::Rotor;

    const MODE: i8 = 1;

    fn fixture() -> Fixture {
        Fixture::new(MODE)
    }

    /// Writes a set-point with the handshake of CiA 402-2.
    fn send(fixture: &mut Fixture, target: i32, bits: u16) {
        fixture.put(Object::TARGET_POSITION, target);
        fixture.set_controlword(ENABLED | START | bits);
        fixture.tick();
        fixture.set_controlword(ENABLED);
        fixture.tick();
    }

    fn arrive(fixture: &mut Fixture) -> u32 {
        fixture.until(10_000, |fixture| fixture.has(TARGET_REACHED))
    }

    #[test]
    fn without_a_set_point_the_position_is_held() {
        let mut fixture = fixture();
        fixture.put(Object::TARGET_POSITION, 50_000);
        fixture.run(100);
        assert!(fixture.position().abs() < 5);
        assert!(fixture.has(TARGET_REACHED) && !fixture.has(SET_POINT_ACKNOWLEDGED));
    }

    /// CiA 402-2, 10.3: controlword, and the expected bit 12.
    #[test]
    fn set_point_handshake_is_that_of_cia_402() {
        let set = ENABLED | START;
        for (what, words) in [
            ("one", vec![(set, true), (ENABLED, false)]),
            ("held", vec![(set, true), (set, true), (set, true), (ENABLED, false)]),
            (
                "two: the second waits",
                vec![(set, true), (ENABLED, false), (set, true), (ENABLED, true)],
            ),
            (
                "three: the third is lost",
                vec![
                    (set, true),
                    (ENABLED, false),
                    (set, true),
                    (ENABLED, true),
                    (set, true),
                    (ENABLED, true),
                ],
            ),
            (
                "immediate: none waits",
                vec![
                    (set, true),
                    (ENABLED, false),
                    (set | IMMEDIATELY, true),
                    (ENABLED, false),
                    (set | IMMEDIATELY, true),
                    (ENABLED, false),
                ],
            ),
            (
                "immediate: the waiting one is lost",
                vec![
                    (set, true),
                    (ENABLED, false),
                    (set, true),
                    (ENABLED, true),
                    (set | IMMEDIATELY, true),
                    (ENABLED, false),
                ],
            ),
        ] {
            let mut fixture = fixture();
            fixture.put(Object::TARGET_POSITION, 50_000);
            for (step, (word, is_acknowledged)) in words.into_iter().enumerate() {
                fixture.set_controlword(word);
                assert_eq!(fixture.has(SET_POINT_ACKNOWLEDGED), is_acknowledged, "{what}: {step}");
                fixture.tick();
                assert_eq!(fixture.has(SET_POINT_ACKNOWLEDGED), is_acknowledged, "{what}: {step}");
            }
        }
    }

    #[test]
    fn set_of_set_points_reaches_each_target() {
        let mut fixture = fixture();
        send(&mut fixture, 20_000, 0);
        send(&mut fixture, -10_000, 0);
        assert!(fixture.has(SET_POINT_ACKNOWLEDGED), "the second waits");
        let mut maximum = 0;
        for _ in 0..3_000 {
            fixture.tick();
            maximum = maximum.max(fixture.read(Object::POSITION_DEMAND));
        }
        assert_eq!(maximum, 20_000);
        assert_eq!(fixture.read(Object::POSITION_DEMAND), -10_000);
        assert!(fixture.has(TARGET_REACHED) && !fixture.has(SET_POINT_ACKNOWLEDGED));
        assert!((fixture.position() + 10_000).abs() <= 100, "{}", fixture.position());
    }

    #[test]
    fn immediate_set_point_replaces_the_previous_one() {
        let mut fixture = fixture();
        send(&mut fixture, 200_000, 0);
        fixture.run(200);
        send(&mut fixture, -5_000, IMMEDIATELY);
        let mut maximum = 0;
        for _ in 0..3_000 {
            fixture.tick();
            maximum = maximum.max(fixture.read(Object::POSITION_DEMAND));
        }
        assert!(maximum < 30_000, "{maximum}");
        assert_eq!(fixture.read(Object::POSITION_DEMAND), -5_000);
    }

    #[test]
    fn relative_set_points_add_to_the_previous_target() {
        let mut fixture = fixture();
        send(&mut fixture, 7_000, 0);
        send(&mut fixture, 2_000, RELATIVE);
        fixture.run(2_000);
        send(&mut fixture, -500, RELATIVE);
        fixture.run(1_000);
        assert_eq!(fixture.read(Object::POSITION_DEMAND), 8_500);
    }

    #[test]
    fn set_point_is_read_at_the_rising_edge_of_bit_4() {
        let mut fixture = fixture();
        send(&mut fixture, 10_000, 0);
        fixture.put(Object::TARGET_POSITION, 99_999);
        fixture.put(Object::PROFILE_VELOCITY, 1);
        arrive(&mut fixture);
        assert_eq!(fixture.read(Object::POSITION_DEMAND), 10_000);
    }

    #[test]
    fn motion_takes_the_time_of_its_profile() {
        let mut fixture = fixture();
        for (object, value) in [
            (Object::PROFILE_VELOCITY, 50_000),
            (Object::PROFILE_ACCELERATION, 100_000),
            (Object::PROFILE_DECELERATION, 200_000),
        ] {
            fixture.put(object, value);
        }
        fixture.put(Object::TARGET_POSITION, 100_000);
        fixture.set_controlword(ENABLED | START);
        let taken = fixture.until(5_000, |b| b.read(Object::POSITION_DEMAND) == 100_000);
        // 0.5 s up (12,500), 0.25 s down (6,250), 81,250 at 50,000/s.
        assert!((2_373..=2_376).contains(&taken), "{taken} ms");
        let reached = taken + arrive(&mut fixture);
        assert!((2_385..2_900).contains(&reached), "{reached} ms with 6068h");
    }

    #[test]
    fn target_in_degrees_uses_gear_and_feed() {
        let mut fixture = fixture();
        fixture.put(Object::GEAR_MOTOR_REVOLUTIONS, 40);
        fixture.put(Object::FEED, 360_000);
        fixture.put(Object::PROFILE_VELOCITY, 90_000);
        fixture.begin(MODE);
        send(&mut fixture, 9_000, 0);
        arrive(&mut fixture);
        fixture.run(300);
        assert!((fixture.rotor.position - 16_384.0).abs() < 100.0, "{:?}", fixture.rotor);
        assert!((fixture.position() - 9_000).abs() <= 55, "{}", fixture.position());
    }

    #[test]
    fn halt_stops_the_motor_and_its_end_continues() {
        let mut fixture = fixture();
        send(&mut fixture, 100_000, 0);
        fixture.run(500);
        fixture.set_controlword(ENABLED | HALT);
        assert!(!fixture.has(TARGET_REACHED));
        let taken = fixture.until(1_000, |fixture| fixture.has(TARGET_REACHED));
        assert!((100..400).contains(&taken), "{taken} ms, 6084h takes 100 of them");
        let position = fixture.position();
        fixture.run(200);
        assert!((fixture.position() - position).abs() < 50, "held");
        fixture.set_controlword(ENABLED);
        fixture.run(3_000);
        assert!((fixture.position() - 100_000).abs() <= 100);
        assert!(fixture.has(TARGET_REACHED));
    }

    #[test]
    fn software_position_limits_bound_the_target() {
        let mut fixture = fixture();
        fixture.put(Object::MAX_POSITION_LIMIT, 5_000);
        send(&mut fixture, 9_000, 0);
        assert!(fixture.demand.is_limited);
        fixture.run(1_000);
        assert_eq!(fixture.read(Object::POSITION_DEMAND), 5_000);
        send(&mut fixture, 4_000, 0);
        fixture.run(1_000);
        assert_eq!(fixture.read(Object::POSITION_DEMAND), 4_000);
        assert!(!fixture.demand.is_limited);
    }

    #[test]
    fn following_error_faults_after_its_time() {
        let stuck = Rotor { coulomb: 5_000.0, ..Rotor::default() };
        let mut fixture = Fixture::with(MODE, stuck, |dictionary| {
            crate::motion::fixture::put(dictionary, Object::FOLLOWING_ERROR_WINDOW, 1_000);
            crate::motion::fixture::put(dictionary, Object::FOLLOWING_ERROR_TIME, 50);
        });
        send(&mut fixture, 100_000, 0);
        let outside = fixture.until(1_000, |b| b.read(Object::FOLLOWING_ERROR) > 1_000);
        let lost = fixture.until(1_000, |fixture| fixture.demand.error == FOLLOWING_ERROR);
        assert!(outside > 0 && (48..=51).contains(&lost), "{outside} ms, {lost} ms");
        assert!(fixture.has(bits::FOLLOWING_ERROR));
    }

    #[test]
    fn moving_motor_decelerates_on_the_profile_at_mode_start() {
        let moving = Rotor { velocity: 50_000.0, ..Rotor::default() };
        let mut fixture = Fixture::with(MODE, moving, |_| {});
        arrive(&mut fixture);
        // 50,000²/2/1,000,000.
        assert!((fixture.position() - 1_250).abs() <= 100, "{}", fixture.position());
    }
}
