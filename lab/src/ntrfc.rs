//! Rate control that becomes force control in contact (NTRFC, Williams 1997, 4.3), of a simulated arm against a wall.
//!
//! ```text
//!  at rest   -f_m = K_FA⁻¹ v_m + sign F_db     v_m: commanded rate; f_m: wrench of the wall on the tool; F_db: deadband
//! ```
//!
//! The arm approaches with the commanded rate, meets the wall, and comes to rest with the force of the law, without a
//! switch of modes. The command goes to the arm directly: hand and node are in the other experiments.

use std::time::Duration;

use serde::Serialize;

use crate::no_trial::NoTrial;
use config::Config;
use config::robots::RobotArm;
use remote::Remote;
use remote::site::Virtual;
use robot::accommodation::Accommodation;
use sim::wrist_sensor::WristSensorSettings;
use testbench::robot_site::{Equipment, RobotSite};
use units::spatial::{Motion, Twist};
use units::time::Instant;

/// Distance of the wall that every press allows for, in m.
const REACH: f64 = 0.2;

/// Time in contact, in s.
const PRESSED: f64 = 4.0;

/// Last part of a press, over which the force at rest is averaged, in s.
const REST: f64 = 1.0;

/// Speed of the tool below which a press counts as calm, in m/s, RMS.
const CALM: f64 = 5e-4;

/// One approach and contact with a constant commanded rate.
#[derive(Clone, Copy, Debug)]
pub struct Press {
    /// Commanded rate into the wall, in m/s; negative for a wall as far behind the tool as the configuration's is ahead.
    pub speed: f64,
    /// K_FA of translations, in m/s per N.
    pub accommodation: f64,
    /// Deadband of the accommodation, in N.
    pub deadband: f64,
    /// Stiffness of the wall, in N/m.
    pub stiffness: f64,
    /// Standard deviation of the sensor's noise, in N.
    pub noise: f64,
    /// Bias of the sensor along the normal, in N.
    pub bias: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// Press in figures.
#[derive(Clone, Debug, Serialize)]
pub struct PressResult {
    /// Name of the robot file.
    pub arm: String,
    /// Commanded rate, in m/s.
    pub speed_m_per_s: f64,
    /// K_FA, in m/s per N.
    pub accommodation_m_per_ns: f64,
    /// K_FA k_e τ_s, of at most 1/4 for an arm that does not turn back at the wall.
    pub servo_share: f64,
    /// Deadband of the accommodation, in N.
    pub deadband_n: f64,
    /// Bias of the sensor, in N.
    pub bias_n: f64,
    /// Force of the law, in N; negative into a wall behind.
    pub law_n: f64,
    /// Force on the wall at rest, in N.
    pub rest_n: f64,
    /// Largest force, in N.
    pub peak_n: f64,
    /// RMS speed of the tool along the normal at the end, in m/s.
    pub unrest_m_per_s: f64,
}

impl PressResult {
    /// Returns the difference from the law, with the bias taken off, as a share of the law.
    pub fn error(&self) -> f64 {
        (self.rest_n - self.law_n - self.bias_n) / self.law_n
    }

    /// Returns the overshoot of the peak over the force at rest, as a share of the latter.
    pub fn overshoot(&self) -> f64 {
        self.peak_n / self.rest_n.abs() - 1.0
    }

    /// Returns whether the tool's RMS speed at the end is below 0.5 mm/s.
    pub const fn is_calm(&self) -> bool {
        self.unrest_m_per_s < CALM
    }
}

impl Press {
    /// Ideal sensor and no deadband, at 20 mm/s against 10 kN/m with a K_FA of 2 mm/s per N.
    pub const IDEAL: Self = Self {
        speed: 0.02,
        accommodation: 0.002,
        deadband: 0.0,
        stiffness: 10_000.0,
        noise: 0.0,
        bias: 0.0,
        seed: 1,
    };

    /// Plays the press with an arm that holds the object of `config`.
    ///
    /// # Errors
    /// Returns an error if the configuration has no wall, a gain is invalid, or the arm cannot be simulated.
    pub fn play(&self, config: &Config, arm: &RobotArm) -> Result<PressResult, NoTrial> {
        let config = self.configured(config, arm)?;
        let [bias, noise] = [self.bias, self.noise].map(|force| [0.0, 0.0, force, 0.0, 0.0, 0.0]);
        let sensor = WristSensorSettings { bias, noise, ..WristSensorSettings::default() };
        let equipment = Equipment { sensor, ..Equipment::from_remote(&config.remote) };
        let mut site = RobotSite::in_free_space(&config, &equipment, self.seed)?;
        let ahead = Twist::from_components([0.0, 0.0, self.speed, 0.0, 0.0, 0.0]);
        let command = Motion::Rate(ahead).into();
        let (mut now, mut peak) = (Instant::ZERO, 0.0_f64);
        let (mut rest, mut squares, mut count) = (0.0, 0.0, 0.0);
        let period = config.period.as_secs_f64();
        let seconds = REACH / self.speed.abs() + PRESSED;
        let mut t = 0.0;
        while t < seconds {
            site.exchange(now, &command);
            let force = -site.arm().f_m_contact().force.z;
            peak = peak.max(force.abs());
            if t >= seconds - REST {
                rest += force;
                squares += site.arm().v_m().linear.z.powi(2);
                count += 1.0;
            }
            now = now + Duration::from_secs_f64(period);
            t += period;
        }
        let lag = config.remote.servo.time_constant();
        Ok(PressResult {
            arm: arm.name.clone(),
            speed_m_per_s: self.speed,
            accommodation_m_per_ns: self.accommodation,
            servo_share: self.accommodation * self.stiffness * lag,
            deadband_n: self.deadband,
            bias_n: self.bias,
            law_n: self.speed / self.accommodation + self.deadband.copysign(self.speed),
            rest_n: rest / count,
            peak_n: peak,
            unrest_m_per_s: (squares / count).sqrt(),
        })
    }

    /// Returns the configuration with this wall and accommodation.
    fn configured(&self, config: &Config, arm: &RobotArm) -> Result<Config, NoTrial> {
        let mut remote: Virtual = config.remote.clone();
        let (point, normal, contact) = remote.wall.as_mut().ok_or(NoTrial::NoWall)?;
        contact.stiffness = self.stiffness;
        if self.speed < 0.0 {
            *point = arm.following().pose().translation.vector * 2.0 - *point;
            *normal = -*normal;
        }
        let gain = self.accommodation;
        let turn = config.remote.interaction.accommodation.gain()[3];
        let force = self.deadband;
        let deadband = [force, force, force, 0.0, 0.0, 0.0];
        let law = Accommodation::new([gain, gain, gain, turn, turn, turn], deadband)?;
        let k_t = *config.controller.reflection.gain();
        let config = config.clone().with_remote(remote).with_switches_at(k_t, law);
        Ok(config.with_robot(arm.clone()))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn rows(press: Press) -> [PressResult; 2] {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        ["puma560", "eight_r_synthetic"].map(|name| {
            let file = format!("config/robots/{name}.toml");
            press.play(&config, &RobotArm::load(Path::new(&file)).unwrap()).unwrap()
        })
    }

    #[test]
    fn force_at_rest_is_that_of_the_law() {
        for row in rows(Press::IDEAL) {
            assert!(row.error().abs() < 0.01 && row.is_calm(), "{row:?}");
        }
    }

    #[test]
    fn bias_shifts_the_force_by_itself() {
        for row in rows(Press { noise: 0.2, bias: 1.0, ..Press::IDEAL }) {
            assert!(row.error().abs() < 0.01, "{row:?}");
        }
    }

    #[test]
    fn deadband_adds_to_the_force_of_either_sign() {
        for press in [0.02, -0.02].map(|speed| Press { speed, deadband: 2.0, ..Press::IDEAL }) {
            for row in rows(press) {
                assert!(row.error().abs() < 0.01 && row.is_calm(), "{row:?}");
                assert!((row.rest_n.abs() - 12.0).abs() < 0.12, "{row:?}");
                assert!(row.rest_n * press.speed > 0.0, "{row:?}");
            }
        }
    }

    #[test]
    fn faster_approach_has_a_larger_peak() {
        let slow = rows(Press::IDEAL);
        let fast = rows(Press { speed: 0.06, ..Press::IDEAL });
        for (slow, fast) in slow.iter().zip(&fast) {
            assert!(fast.peak_n > slow.peak_n && fast.is_calm(), "{fast:?}");
        }
    }
}
