//! What stands between a drive's current loop and the arm: a motor and its gear.
//!
//! Not the drive: it is asked for per mille of rated torque, and gives N·m at its joint. On the way lie
//! the lag of the current loop, the torque curve of each direction, hysteresis and backlash; the current
//! heats the winding.

mod backlash;
mod current_loop;
mod hysteresis;
pub mod winding;

use crate::actuator::ActuatorSettings;
use crate::actuator::TorqueCurve;
use crate::drivetrain::backlash::Backlash;
use crate::drivetrain::current_loop::CurrentLoop;
use crate::drivetrain::hysteresis::Hysteresis;
use crate::drivetrain::winding::Winding;

/// What a drive senses of its motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensed {
    /// Of the motor, as its joint would have to be for it, in rad (m).
    pub position: f64,
    /// The same, in rad/s (m/s).
    pub velocity: f64,
    /// The torque its current makes, in ‰ of rated torque.
    pub per_mille: f64,
    /// Of its winding, in °C.
    pub temperature: f64,
}

/// What one motor and its gear are like.
#[derive(Clone, Copy, Debug)]
pub struct DrivetrainSettings {
    /// Its torque curve, and where it ends.
    pub actuator: ActuatorSettings,
    /// Its torque curve where the joint's torque is negative, if it is another one there: `c1`, `c3`, `c5`
    /// as in [`ActuatorSettings::torque_curve`].
    pub torque_curve_reverse: Option<[f64; 3]>,
    /// Time constant of the current loop, in s.
    pub current_loop: f64,
    /// Width of the hysteresis, in N·m (N) at the joint.
    pub hysteresis: f64,
    /// Width of the gap between motor and joint, in rad (m) at the joint.
    pub backlash: f64,
    /// Of the rotor, seen at the joint, in kg·m² (kg); matters in a gap only.
    pub rotor_inertia: f64,
    /// Thermal time constant of the winding, in s.
    pub thermal_time_constant: f64,
}

impl DrivetrainSettings {
    /// A good one: a fast current loop, no hysteresis, no backlash.
    pub const fn good(actuator: ActuatorSettings) -> Self {
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

/// The motor and the gear of one joint.
#[derive(Clone, Copy, Debug)]
pub struct Drivetrain {
    current: CurrentLoop,
    winding: Winding,
    curve: TorqueCurve,
    hysteresis: Hysteresis,
    backlash: Backlash,
    /// What `torque` was worked out from, in ‰ of rated torque.
    mean: f64,
    /// What the motor made of it, in N·m (N).
    made: f64,
    torque: f64,
}

impl Drivetrain {
    /// At rest and cold.
    pub fn new(settings: &DrivetrainSettings) -> Self {
        let curve = TorqueCurve::new(&settings.actuator);
        Self {
            current: CurrentLoop::new(settings.current_loop),
            winding: Winding::new(settings.thermal_time_constant),
            curve: settings.torque_curve_reverse.map_or(curve, |reverse| curve.reverse(reverse)),
            hysteresis: Hysteresis::new(settings.hysteresis),
            backlash: Backlash::new(settings.backlash, settings.rotor_inertia),
            mean: 0.0,
            made: 0.0,
            torque: 0.0,
        }
    }

    /// The current loop is asked for `per_mille` of rated torque from now on.
    pub const fn ask(&mut self, per_mille: f64) {
        self.current.ask(per_mille);
    }

    /// What is asked of the current loop, in ‰ of rated torque.
    pub const fn demand(&self) -> f64 {
        self.current.demand()
    }

    /// Lets `h` s pass; what it exerted on its joint in their mean, in N·m (N).
    pub fn exert(&mut self, h: f64) -> f64 {
        let mean = self.current.advance(h);
        self.winding.advance(h, mean);
        if (self.mean - mean).abs() > 0.0 {
            self.mean = mean;
            self.made = self.curve.torque(mean);
        }
        let given = self.hysteresis.follow(self.made);
        self.torque = self.backlash.transmit(h, given);
        self.torque
    }

    /// Its end of the linkage has moved to `position` with `velocity`, in rad and rad/s (m and m/s).
    pub fn follow(&mut self, position: f64, velocity: f64) {
        self.backlash.follow(position, velocity);
    }

    /// What it exerted on its joint last, in N·m (N).
    pub const fn torque(&self) -> f64 {
        self.torque
    }

    /// What its drive senses of it.
    pub const fn sensed(&self) -> Sensed {
        Sensed {
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

    /// What it exerts once the current has come.
    fn settled(train: &mut Drivetrain, per_mille: f64) -> f64 {
        train.ask(per_mille);
        (0..100).map(|_| train.exert(H)).last().unwrap()
    }

    #[test]
    fn a_demand_acts_with_the_lag_of_the_current_loop_and_is_sensed_with_it() {
        let mut train = Drivetrain::new(&DrivetrainSettings::good(ACTUATOR));
        train.ask(-500.0);
        let first = train.exert(H);
        let sensed = train.sensed().per_mille;
        assert!((sensed + 500.0 * (1.0 - (-1.25_f64).exp())).abs() < 1e-9, "{sensed} ‰");
        let end = settled(&mut train, -500.0);
        assert!(0.0 < first && first < 0.5 * end, "{first} N·m, then {end} N·m");
        assert_eq!(train.sensed().per_mille, -500.0);
        assert_eq!(end, TorqueCurve::new(&ACTUATOR).torque(-500.0));
    }

    #[test]
    fn each_direction_has_its_own_curve() {
        let reverse = [150.0, 0.0, 0.0];
        let good = DrivetrainSettings::good(ACTUATOR);
        let mut train =
            Drivetrain::new(&DrivetrainSettings { torque_curve_reverse: Some(reverse), ..good });
        // The gear turns it round: a negative target is a positive torque.
        assert!((settled(&mut train, 300.0) + 2.0).abs() < 1e-12);
        let forward = settled(&mut train, -300.0);
        assert_eq!(forward, settled(&mut Drivetrain::new(&good), -300.0));
        assert!((forward - 2.0).abs() > 0.1);
    }

    #[test]
    fn driven_up_and_down_it_shows_its_hysteresis() {
        let settings = DrivetrainSettings { hysteresis: 0.2, ..DrivetrainSettings::good(ACTUATOR) };
        let mut train = Drivetrain::new(&settings);
        settled(&mut train, 700.0);
        let up = settled(&mut train, 0.0);
        settled(&mut train, -700.0);
        let down = settled(&mut train, 0.0);
        assert!((down - up - 0.2).abs() < 1e-9, "{up} N·m and {down} N·m");
    }

    #[test]
    fn an_encoder_sees_the_motor_and_not_the_joint() {
        let settings = DrivetrainSettings {
            backlash: 0.01,
            rotor_inertia: 0.008,
            ..DrivetrainSettings::good(ACTUATOR)
        };
        let mut train = Drivetrain::new(&settings);
        train.follow(0.003, 0.1);
        assert_eq!(train.sensed().position, 0.0);
        train.follow(0.008, 0.1);
        assert!((train.sensed().position - 0.003).abs() < 1e-12);
        assert!((train.sensed().velocity - 0.1).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn torque_never_exceeds_what_the_joint_bears(
            demands in prop::collection::vec(-32_768.0..32_767.0_f64, 1..40), width in 0.0..1.0_f64
        ) {
            let settings = DrivetrainSettings { hysteresis: width, ..DrivetrainSettings::good(ACTUATOR) };
            let mut train = Drivetrain::new(&settings);
            for demand in demands {
                train.ask(demand);
                prop_assert!(train.exert(H).abs() <= ACTUATOR.max_torque + 1e-12);
            }
        }
    }
}
