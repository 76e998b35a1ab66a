//! Object under control at {MRF}: follows commands with a first-order servo lag and speed limits.
//!
//! The object has no dynamics. Contact moves it by force accommodation only, in rate mode (4.3). In pose mode surfaces
//! stop it if a virtual coupling draws it: [`god_object`](crate::god_object). The object is free, or the tool of an arm
//! that follows the same twists within the limits of its joints: [`following_arm`](crate::following_arm).

use nalgebra::Isometry3;
use thiserror::Error;

use crate::following_arm::FollowingArm;
use crate::interaction::{Interaction, ToolState};
use units::math;
use units::spatial::{Motion, Twist, Wrench};

/// Maximum distance from the base, in m.
const MAX_DISTANCE: f64 = 1e5;

/// First-order servo with speed limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo {
    time_constant: f64,
    max_speed: f64,
    max_turn: f64,
}

/// Servo parameter out of range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("{quantity} of the servo must be within 0..=1000, got {value}")]
pub struct InvalidServo {
    /// `time constant`, `speed` or `angular speed`.
    pub quantity: &'static str,
    /// Rejected value, in s, m/s or rad/s.
    pub value: f64,
}

impl Servo {
    /// Creates a servo from its time constant in s, zero for no lag, and speed limits in m/s and rad/s.
    ///
    /// # Errors
    /// Returns the first value that is negative, above 1000 or NaN.
    pub fn new(time_constant: f64, max_speed: f64, max_turn: f64) -> Result<Self, InvalidServo> {
        for (quantity, value) in
            [("time constant", time_constant), ("speed", max_speed), ("angular speed", max_turn)]
        {
            if !(0.0..=1_000.0).contains(&value) {
                return Err(InvalidServo { quantity, value });
            }
        }
        Ok(Self { time_constant, max_speed, max_turn })
    }

    /// Replaces the time constant, in s, which must be valid.
    #[must_use]
    pub const fn with_lag(self, time_constant: f64) -> Self {
        Self { time_constant, ..self }
    }

    /// Returns the time constant, in s; zero for no lag.
    pub const fn time_constant(&self) -> f64 {
        self.time_constant
    }

    /// Returns the maximum speeds, in m/s and rad/s.
    pub const fn max_speeds(&self) -> [f64; 2] {
        [self.max_speed, self.max_turn]
    }

    /// Returns the step response after `dt` s, `1 - exp(-dt/τ)`.
    fn part(&self, dt: f64) -> f64 {
        if self.time_constant > 0.0 { -math::exp_m1(-dt / self.time_constant) } else { 1.0 }
    }

    /// Scales a twist to the speed limits, keeping its direction.
    pub(super) fn limited(&self, v_m: Twist) -> Twist {
        let slower = |limit: f64, speed: f64| if speed > limit { limit / speed } else { 1.0 };
        let scale = slower(self.max_speed, v_m.linear.norm());
        v_m * scale.min(slower(self.max_turn, v_m.angular.norm()))
    }
}

/// Body with a wrist sensor and a payload: free, or held by an arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Object {
    servo: Servo,
    interaction: Interaction,
    arm: Option<FollowingArm>,
    tool: ToolState,
}

impl Object {
    /// Creates a free object at rest at `x_b_m`, without sensor offset, payload or accommodation.
    pub fn new(servo: Servo, x_b_m: Isometry3<f64>) -> Self {
        let tool = ToolState::at_rest(x_b_m);
        Self { servo, interaction: Interaction::default(), arm: None, tool }
    }

    /// Sets sensor, payload, accommodation and shared control.
    #[must_use]
    pub fn with_interaction(self, interaction: Interaction) -> Self {
        Self { interaction, ..self }
    }

    /// Attaches the object to an arm, whose pose it takes over.
    #[must_use]
    pub fn held_by(self, arm: FollowingArm) -> Self {
        Self { tool: ToolState::at_rest(arm.pose()), arm: Some(arm), ..self }
    }

    /// Places a free object at rest at `x_b_m`.
    pub fn place(&mut self, x_b_m: Isometry3<f64>) {
        self.tool = ToolState::at_rest(x_b_m);
    }

    /// Returns the arm that holds the object; `None` for a free object.
    pub const fn arm(&self) -> Option<&FollowingArm> {
        self.arm.as_ref()
    }

    /// Returns the pose of {MRF} in its base.
    pub const fn pose(&self) -> &Isometry3<f64> {
        &self.tool.x_b_m
    }

    /// Returns the twist of {MRF}, in {MRF}.
    pub const fn twist(&self) -> &Twist {
        &self.tool.v_m
    }

    /// Simulates the sensor's reading with the contact wrench `f_m_contact` on the object: contact and payload.
    pub fn reading(&self, f_m_contact: &Wrench) -> Wrench {
        self.interaction.reading(&self.tool, f_m_contact)
    }

    /// Converts a reading to the wrench for the operator, at {S}: the contact, with the payload if so configured.
    pub fn operator_wrench(&self, reading: &Wrench) -> Wrench {
        self.interaction.operator_wrench(&self.tool, reading)
    }

    /// Follows `command` for `dt` s with the contact wrench `f_m_contact` at {MRF}. Stops at a command that is invalid, or
    /// leaves the range of positions.
    pub fn step(&mut self, dt: f64, command: &Motion, f_m_contact: &Wrench) {
        let part = self.servo.part(dt);
        let v_m = match command {
            Motion::Hold => self.towards(&Twist::ZERO, part),
            Motion::Rate(v_m) => self.towards(&self.interaction.rate(v_m, f_m_contact), part),
            Motion::Pose(x_b_d) => Twist::reaching(&(self.tool.x_b_m.inverse() * x_b_d), dt) * part,
        };
        self.advance(dt, v_m);
    }

    /// Moves with `v_m` for `dt` s without servo lag, within the speed limits and, with an arm, its joint limits. Stops at a
    /// twist that is invalid, or leaves the range of positions.
    pub fn advance(&mut self, dt: f64, v_m: Twist) {
        let limited = self.servo.limited(v_m);
        let before = self.tool;
        let moved = match &mut self.arm {
            Some(arm) => arm.moved(dt, &limited),
            None => before.x_b_m * limited.over(dt),
        };
        let v_m = match &self.arm {
            Some(_) => Twist::reaching(&(before.x_b_m.inverse() * moved), dt),
            None => limited,
        };
        if v_m.is_finite() && is_in_range(&moved) {
            let v_dot_m = (v_m + before.v_m * -1.0) * dt.recip();
            let v_dot_m = if v_dot_m.is_finite() { v_dot_m } else { Twist::ZERO };
            self.tool = ToolState { x_b_m: moved, v_m, v_dot_m };
            self.tool.x_b_m.rotation.renormalize();
        } else {
            self.tool = ToolState::at_rest(before.x_b_m);
        }
    }

    /// Returns the twist after one step of the first-order lag towards another.
    fn towards(&self, v_m_other: &Twist, part: f64) -> Twist {
        self.tool.v_m * (1.0 - part) + *v_m_other * part
    }
}

/// Returns whether a pose is valid and within range.
fn is_in_range(x: &Isometry3<f64>) -> bool {
    x.translation.vector.iter().all(|part| part.abs() <= MAX_DISTANCE)
        && (x.rotation.norm() - 1.0).abs() < 1e-6
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;
    use crate::accommodation::Accommodation;
    use crate::payload::Payload;
    use crate::testing;
    use crate::wrist_sensor::WristSensor;

    fn servo(time_constant: f64) -> Servo {
        Servo::new(time_constant, 10.0, 10.0).unwrap()
    }

    fn object(time_constant: f64) -> Object {
        Object::new(servo(time_constant), Isometry3::translation(0.4, 0.0, 0.3))
    }

    fn yielding(gain: f64) -> Interaction {
        let accommodation = Accommodation::new([gain; 6], [0.0; 6]).unwrap();
        Interaction { accommodation, ..Interaction::default() }
    }

    fn pose() -> impl Strategy<Value = Isometry3<f64>> {
        prop::array::uniform6(-1.0..1.0_f64)
            .prop_map(|[x, y, z, a, b, c]| Isometry3::new([x, y, z].into(), [a, b, c].into()))
    }

    fn six(size: f64) -> impl Strategy<Value = [f64; 6]> {
        prop::array::uniform6(-size..size)
    }

    fn distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
        let x = a.inverse() * b;
        x.translation.vector.norm() + x.rotation.angle()
    }

    proptest! {
        #[test]
        fn removing_the_payload_leaves_the_contact(
            x_b_m in pose(), x_m_s in pose(), f in six(50.0)
        ) {
            let payload = Payload::new(1.5, [0.0, 0.01, 0.04]).unwrap();
            let interaction = Interaction {
                sensor: WristSensor { x_m_s, ..WristSensor::default() },
                payload,
                gravity_in_b: Vector3::new(0.0, 0.0, -9.81),
                ..Interaction::default()
            };
            let object = Object::new(servo(0.01), x_b_m).with_interaction(interaction);
            let f_m = Wrench::from_components(f);
            let f_s = object.operator_wrench(&object.reading(&f_m));
            for (a, b) in f_s.at(&x_m_s).components().iter().zip(f_m.components()) {
                prop_assert!((a - b).abs() < 1e-10);
            }
        }

        #[test]
        fn constant_pose_command_is_reached(x_b_d in pose()) {
            let mut object = object(0.01);
            for _ in 0..2_000 {
                object.step(1e-3, &Motion::Pose(x_b_d), &Wrench::ZERO);
            }
            prop_assert!(distance(object.pose(), &x_b_d) < 1e-6);
        }

        #[test]
        fn constant_rate_command_is_reached(v in six(1.0)) {
            let mut object = object(0.01);
            let v_m = Twist::from_components(v);
            for _ in 0..500 {
                object.step(1e-3, &Motion::Rate(v_m), &Wrench::ZERO);
            }
            for (a, b) in object.twist().components().iter().zip(v_m.components()) {
                prop_assert!((a - b).abs() < 1e-12);
            }
        }

        #[test]
        fn constant_rate_without_lag_is_a_screw_motion(v in six(1.0)) {
            let v_m = Twist::from_components(v);
            let (mut fine, mut coarse) = (object(0.0), object(0.0));
            for _ in 0..10 {
                fine.step(0.01, &Motion::Rate(v_m), &Wrench::ZERO);
            }
            coarse.step(0.1, &Motion::Rate(v_m), &Wrench::ZERO);
            prop_assert!(distance(fine.pose(), coarse.pose()) < 1e-7);
        }

        #[test]
        fn speed_limit_keeps_the_direction(v in six(100.0)) {
            let mut object = object(0.0);
            let v_m = Twist::from_components(v);
            object.step(1e-3, &Motion::Rate(v_m), &Wrench::ZERO);
            let Twist { linear, angular } = *object.twist();
            prop_assert!(linear.norm() <= 10.0 + 1e-9 && angular.norm() <= 10.0 + 1e-9);
            prop_assert!(linear.cross(&v_m.linear).norm() < 1e-9);
            prop_assert!(linear.dot(&v_m.linear) >= 0.0);
        }

        #[test]
        fn any_input_keeps_the_pose_in_range(
            dt in any::<f64>(), v in prop::array::uniform6(any::<f64>()),
            f in prop::array::uniform6(any::<f64>()), kind in 0..3
        ) {
            let [a, b, c, d, e, g] = v;
            let command = match kind {
                0 => Motion::Hold,
                1 => Motion::Rate(Twist::from_components(v)),
                _ => Motion::Pose(Isometry3::new([a, b, c].into(), [d, e, g].into())),
            };
            let mut object = object(0.01).with_interaction(yielding(0.1));
            for _ in 0..3 {
                object.step(dt, &command, &Wrench::from_components(f));
                prop_assert!(is_in_range(object.pose()) && object.twist().is_finite());
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn arms_follow_as_the_free_object_does(v in six(1.0), is_long in any::<bool>()) {
            let [x, y, z, a, b, c] = v;
            let v_m = Twist::from_components([0.1 * x, 0.1 * y, 0.1 * z, 0.4 * a, 0.4 * b, 0.4 * c]);
            let (chain, q) = if is_long {
                (testing::eight_r(), testing::posture(8))
            } else {
                (testing::puma(), testing::posture(6))
            };
            let arm = FollowingArm::new(testing::law(chain, 1e4), q);
            let mut held = object(0.05).held_by(arm);
            let mut free = Object::new(servo(0.05), *held.pose());
            for cycle in 0..1_500 {
                // A rate, its reverse, then a pose.
                let command = match cycle {
                    0..500 => Motion::Rate(v_m),
                    500..1_000 => Motion::Rate(v_m * -0.5),
                    _ => Motion::Pose(arm.pose() * v_m.over(0.2)),
                };
                held.step(1e-3, &command, &Wrench::ZERO);
                free.step(1e-3, &command, &Wrench::ZERO);
                prop_assume!(held.arm().unwrap().sigma_min() > 0.05);
                let off = free.pose().inverse() * held.pose();
                prop_assert!(off.translation.vector.norm() < 1e-3, "{off}");
                prop_assert!(off.rotation.angle() < 0.5_f64.to_radians(), "{off}");
            }
        }
    }

    #[test]
    fn rate_command_is_followed_with_the_lag() {
        let mut object = object(0.1);
        let v_m = Twist::from_components([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        for _ in 0..100 {
            object.step(1e-3, &Motion::Rate(v_m), &Wrench::ZERO);
        }
        assert!((object.twist().linear.x - (1.0 - math::exp(-1.0))).abs() < 1e-9);
    }

    #[test]
    fn accommodation_acts_in_rate_mode_only() {
        let push = Wrench::from_components([10.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let here = *object(0.0).pose();
        let moved = |command| {
            let mut object = object(0.0).with_interaction(yielding(0.01));
            object.step(0.1, &command, &push);
            object.pose().translation.x - here.translation.x
        };
        assert!((moved(Motion::Rate(Twist::ZERO)) - 0.01).abs() < 1e-12);
        assert!(moved(Motion::Hold).abs() < 1e-15 && moved(Motion::Pose(here)).abs() < 1e-15);
    }

    #[test]
    fn invalid_servo_parameters_are_refused() {
        for wrong in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(Servo::new(wrong, 1.0, 1.0).is_err());
            assert!(Servo::new(0.1, wrong, 1.0).is_err());
            assert!(Servo::new(0.1, 1.0, wrong).is_err());
        }
    }
}
