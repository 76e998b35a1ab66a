//! The object under control at {MRF}: follows commands as a robot with servos does, with a first-order lag and speed
//! limits.
//!
//! No dynamics: contact moves it by force accommodation only, and only in rate mode (4.3). In pose mode surfaces stop it
//! where a virtual coupling draws it: [`god_object`](crate::god_object).

use nalgebra::{Isometry3, Vector3};
use thiserror::Error;

use crate::accommodation::Accommodation;
use crate::payload::Payload;
use units::spatial::{Motion, Twist, Wrench};

/// Maximum distance from the base, in m.
const MAX_DISTANCE: f64 = 1e5;

/// Servo of an object.
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
    /// Time constant, speed or angular velocity.
    pub quantity: &'static str,
    /// Value given.
    pub value: f64,
}

impl Servo {
    /// Creates a servo from its time constant in s, zero for none, and speed limits in m/s and rad/s.
    ///
    /// # Errors
    /// A negative, too large or NaN value.
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

    /// Returns the time constant, in s; zero for none.
    pub const fn time_constant(&self) -> f64 {
        self.time_constant
    }

    /// Returns the fraction of a distance that is covered in `dt` s.
    fn part(&self, dt: f64) -> f64 {
        if self.time_constant > 0.0 { -(-dt / self.time_constant).exp_m1() } else { 1.0 }
    }

    /// Scales the twist to the speed limits; keeps its direction.
    fn limited(&self, v_m: Twist) -> Twist {
        let slower = |limit: f64, speed: f64| if speed > limit { limit / speed } else { 1.0 };
        let scale = slower(self.max_speed, v_m.linear.norm());
        v_m * scale.min(slower(self.max_turn, v_m.angular.norm()))
    }
}

/// A body with a force sensor, and a payload beyond the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Object {
    servo: Servo,
    accommodation: Accommodation,
    payload: Payload,
    x_m_s: Isometry3<f64>,
    gravity_in_b: Vector3<f64>,
    x_b_m: Isometry3<f64>,
    v_m: Twist,
}

impl Object {
    /// Creates an object at rest at `x_b_m`, without sensor offset, payload or accommodation.
    pub fn new(servo: Servo, x_b_m: Isometry3<f64>) -> Self {
        Self {
            servo,
            accommodation: Accommodation::default(),
            payload: Payload::default(),
            x_m_s: Isometry3::identity(),
            gravity_in_b: Vector3::zeros(),
            x_b_m,
            v_m: Twist::ZERO,
        }
    }

    /// Sets the force accommodation.
    #[must_use]
    pub fn with_accommodation(self, accommodation: Accommodation) -> Self {
        Self { accommodation, ..self }
    }

    /// Sets the sensor pose `x_m_s`, the payload, and gravity in the base, in m/s².
    #[must_use]
    pub fn with_payload(
        self,
        x_m_s: Isometry3<f64>,
        payload: Payload,
        gravity_in_b: Vector3<f64>,
    ) -> Self {
        Self { x_m_s, payload, gravity_in_b, ..self }
    }

    /// Returns the pose of {MRF} in its base.
    pub const fn pose(&self) -> &Isometry3<f64> {
        &self.x_b_m
    }

    /// Returns the twist of {MRF}, in {MRF}.
    pub const fn twist(&self) -> &Twist {
        &self.v_m
    }

    /// Returns the sensor value while `f_m_contact` acts on the object: contact and payload.
    pub fn sensed(&self, f_m_contact: &Wrench) -> Wrench {
        f_m_contact.at(&self.x_m_s.inverse()) + self.weight()
    }

    /// Subtracts the payload from a sensor value: returns the contact wrench, at {S} (decision 8).
    pub fn contact(&self, f_s_sensed: &Wrench) -> Wrench {
        *f_s_sensed - self.weight()
    }

    /// Follows `command` for `dt` s while `f_m_contact` acts on it at {MRF}. Stops at an invalid command, or at one
    /// that leaves the range of positions.
    pub fn step(&mut self, dt: f64, command: &Motion, f_m_contact: &Wrench) {
        let part = self.servo.part(dt);
        let v_m = match command {
            Motion::Hold => self.towards(&Twist::ZERO, part),
            Motion::Rate(v_m) => self.towards(&self.accommodation.rate(v_m, f_m_contact), part),
            Motion::Pose(x_b_d) => Twist::reaching(&(self.x_b_m.inverse() * x_b_d), dt) * part,
        };
        self.advance(dt, v_m);
    }

    /// Moves with `v_m` for `dt` s, within the speed limits of the servo and without its lag. Stops at an invalid twist,
    /// or at one that leaves the range of positions.
    pub fn advance(&mut self, dt: f64, v_m: Twist) {
        let limited = self.servo.limited(v_m);
        let moved = self.x_b_m * limited.over(dt);
        if limited.is_finite() && is_in_range(&moved) {
            self.v_m = limited;
            self.x_b_m = moved;
            self.x_b_m.rotation.renormalize();
        } else {
            self.v_m = Twist::ZERO;
        }
    }

    /// Returns the twist after one lag step towards another.
    fn towards(&self, v_m_other: &Twist, part: f64) -> Twist {
        self.v_m * (1.0 - part) + *v_m_other * part
    }

    fn weight(&self) -> Wrench {
        self.payload.weight(&(self.x_b_m * self.x_m_s), &self.gravity_in_b)
    }
}

/// Returns whether a pose is valid and within range.
fn is_in_range(x: &Isometry3<f64>) -> bool {
    x.translation.vector.iter().all(|part| part.abs() <= MAX_DISTANCE)
        && (x.rotation.norm() - 1.0).abs() < 1e-6
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn servo(time_constant: f64) -> Servo {
        Servo::new(time_constant, 10.0, 10.0).unwrap()
    }

    fn object(time_constant: f64) -> Object {
        Object::new(servo(time_constant), Isometry3::translation(0.4, 0.0, 0.3))
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
            let object = Object::new(servo(0.01), x_b_m)
                .with_payload(x_m_s, payload, Vector3::new(0.0, 0.0, -9.81));
            let f_m = Wrench::from_components(f);
            let f_s = object.contact(&object.sensed(&f_m));
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
            let mut object = object(0.01).with_accommodation(Accommodation::new([0.1; 6], [0.0; 6]).unwrap());
            for _ in 0..3 {
                object.step(dt, &command, &Wrench::from_components(f));
                prop_assert!(is_in_range(object.pose()) && object.twist().is_finite());
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
        assert!((object.twist().linear.x - (1.0 - (-1.0_f64).exp())).abs() < 1e-9);
    }

    #[test]
    fn accommodation_acts_in_rate_mode_only() {
        let push = Wrench::from_components([10.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let law = Accommodation::new([0.01; 6], [0.0; 6]).unwrap();
        let here = *object(0.0).pose();
        let moved = |command| {
            let mut object = object(0.0).with_accommodation(law);
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
