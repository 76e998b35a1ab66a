//! Drivetrain between current loop and joint: a motor and its gear.
//!
//! Input: torque demand in per mille of rated torque. Output: N·m at the joint. In between: lag of the current loop,
//! torque curve per direction, hysteresis and backlash. The current heats the winding.

mod backlash;
mod current_loop;
mod hysteresis;
pub mod winding;

use crate::actuator::{ActuatorSettings, TorqueCurve};
use crate::drivetrain::backlash::Backlash;
use crate::drivetrain::current_loop::CurrentLoop;
use crate::drivetrain::hysteresis::Hysteresis;
use crate::drivetrain::winding::Winding;

/// Values that a drive measures of its motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorReading {
    /// Motor position in joint coordinates, in rad (m).
    pub position: f64,
    /// Motor velocity in joint coordinates, in rad/s (m/s).
    pub velocity: f64,
    /// Torque from the motor current, in ‰ of rated torque.
    pub per_mille: f64,
    /// Winding temperature, in °C.
    pub temperature: f64,
}

/// Parameters of a motor and gear.
#[derive(Clone, Copy, Debug)]
pub struct DrivetrainSettings {
    /// Torque curve and its range.
    pub actuator: ActuatorSettings,
    /// Torque curve for negative joint torque, if it differs: `c1`, `c3`, `c5` as in
    /// [`ActuatorSettings::torque_curve`].
    pub torque_curve_reverse: Option<[f64; 3]>,
    /// Time constant of the current loop, in s.
    pub current_loop: f64,
    /// Width of the hysteresis, in N·m (N) at the joint.
    pub hysteresis: f64,
    /// Width of the backlash, in rad (m) at the joint.
    pub backlash: f64,
    /// Rotor inertia at the joint, in kg·m² (kg); used with backlash only.
    pub rotor_inertia: f64,
    /// Thermal time constant of the winding, in s.
    pub thermal_time_constant: f64,
}

impl DrivetrainSettings {
    /// Returns an ideal drivetrain: fast current loop, no hysteresis, no backlash.
    pub const fn ideal(actuator: ActuatorSettings) -> Self {
        Self {
            actuator,
            torque_curve_reverse: None,
            current_loop: 0.2e-3,
            hysteresis: 0.0,
            backlash: 0.0,
            rotor_inertia: 0.0,
            thermal_time_constant: 30.0,
        }
    }
}

/// Motor and gear of one joint.
#[derive(Clone, Copy, Debug)]
pub struct Drivetrain {
    current: CurrentLoop,
    winding: Winding,
    curve: TorqueCurve,
    hysteresis: Hysteresis,
    backlash: Backlash,
    /// Mean current of the last step, in ‰ of rated torque.
    mean: f64,
    /// Motor torque of that current, in N·m (N).
    motor_torque: f64,
    torque: f64,
}

impl Drivetrain {
    /// Creates a drivetrain at rest and at room temperature.
    pub fn new(settings: &DrivetrainSettings) -> Self {
        let curve = TorqueCurve::new(&settings.actuator);
        Self {
            current: CurrentLoop::new(settings.current_loop),
            winding: Winding::new(settings.thermal_time_constant),
            curve: settings.torque_curve_reverse.map_or(curve, |reverse| curve.reverse(reverse)),
            hysteresis: Hysteresis::new(settings.hysteresis),
            backlash: Backlash::new(settings.backlash, settings.rotor_inertia),
            mean: 0.0,
            motor_torque: 0.0,
            torque: 0.0,
        }
    }

    /// Sets the torque demand, in ‰ of rated torque.
    pub const fn set_demand(&mut self, per_mille: f64) {
        self.current.set_demand(per_mille);
    }

    /// Returns the torque demand, in ‰ of rated torque.
    pub const fn demand(&self) -> f64 {
        self.current.demand()
    }

    /// Advances by `h` s and returns the mean joint torque, in N·m (N).
    pub fn step(&mut self, h: f64) -> f64 {
        let mean = self.current.advance(h);
        self.winding.advance(h, mean);
        if (self.mean - mean).abs() > 0.0 {
            self.mean = mean;
            self.motor_torque = self.curve.torque(mean);
        }
        let transmitted = self.hysteresis.step(self.motor_torque);
        self.torque = self.backlash.transmit(h, transmitted);
        self.torque
    }

    /// Sets position and velocity of the joint side, in rad and rad/s (m and m/s).
    pub fn set_joint_motion(&mut self, position: f64, velocity: f64) {
        self.backlash.set_joint_motion(position, velocity);
    }

    /// Returns the last joint torque, in N·m (N).
    pub const fn torque(&self) -> f64 {
        self.torque
    }

    /// Returns the values that the drive measures.
    pub const fn sensed(&self) -> MotorReading {
        MotorReading {
            position: self.backlash.position(),
            velocity: self.backlash.velocity(),
            per_mille: self.current.per_mille(),
            temperature: self.winding.temperature(),
        }
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "what is not touched stays what it is, bit for bit")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const H: f64 = 250e-6;

    const ACTUATOR: ActuatorSettings = ActuatorSettings {
        counts_per_rev: 16_384.0,
        gear_ratio: -40.0,
        zero_counts: 0,
        rated_torque: 0.1765,
        torque_curve: [133.144, -0.393_453, 0.019_672_6],
        max_torque: 6.0,
    };

    /// Returns the joint torque after the current has settled.
    fn settled(train: &mut Drivetrain, per_mille: f64) -> f64 {
        train.set_demand(per_mille);
        (0..100).map(|_| train.step(H)).last().unwrap()
    }

    #[test]
    fn demand_acts_with_the_lag_of_the_current_loop() {
        let mut train = Drivetrain::new(&DrivetrainSettings::ideal(ACTUATOR));
        train.set_demand(-500.0);
        let first = train.step(H);
        let sensed = train.sensed().per_mille;
        assert!((sensed + 500.0 * (1.0 - (-1.25_f64).exp())).abs() < 1e-9, "{sensed} ‰");
        let end = settled(&mut train, -500.0);
        assert!(0.0 < first && first < 0.5 * end, "{first} N·m, then {end} N·m");
        assert_eq!(train.sensed().per_mille, -500.0);
        assert_eq!(end, TorqueCurve::new(&ACTUATOR).torque(-500.0));
    }

    #[test]
    fn directions_have_their_own_curves() {
        let reverse = [150.0, 0.0, 0.0];
        let ideal = DrivetrainSettings::ideal(ACTUATOR);
        let mut train =
            Drivetrain::new(&DrivetrainSettings { torque_curve_reverse: Some(reverse), ..ideal });
        // The gear inverts: a negative target is a positive torque.
        assert!((settled(&mut train, 300.0) + 2.0).abs() < 1e-12);
        let forward = settled(&mut train, -300.0);
        assert_eq!(forward, settled(&mut Drivetrain::new(&ideal), -300.0));
        assert!((forward - 2.0).abs() > 0.1);
    }

    #[test]
    fn torque_cycle_shows_the_hysteresis() {
        let settings =
            DrivetrainSettings { hysteresis: 0.2, ..DrivetrainSettings::ideal(ACTUATOR) };
        let mut train = Drivetrain::new(&settings);
        settled(&mut train, 700.0);
        let up = settled(&mut train, 0.0);
        settled(&mut train, -700.0);
        let down = settled(&mut train, 0.0);
        assert!((down - up - 0.2).abs() < 1e-9, "{up} N·m and {down} N·m");
    }

    #[test]
    fn encoder_measures_the_motor_side() {
        let settings = DrivetrainSettings {
            backlash: 0.01,
            rotor_inertia: 0.008,
            ..DrivetrainSettings::ideal(ACTUATOR)
        };
        let mut train = Drivetrain::new(&settings);
        train.set_joint_motion(0.003, 0.1);
        assert_eq!(train.sensed().position, 0.0);
        train.set_joint_motion(0.008, 0.1);
        assert!((train.sensed().position - 0.003).abs() < 1e-12);
        assert!((train.sensed().velocity - 0.1).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn torque_stays_within_the_joint_maximum(
            demands in prop::collection::vec(-32_768.0..32_767.0_f64, 1..40), width in 0.0..1.0_f64
        ) {
            let settings = DrivetrainSettings { hysteresis: width, ..DrivetrainSettings::ideal(ACTUATOR) };
            let mut train = Drivetrain::new(&settings);
            for demand in demands {
                train.set_demand(demand);
                prop_assert!(train.step(H).abs() <= ACTUATOR.max_torque + 1e-12);
            }
        }
    }
}
