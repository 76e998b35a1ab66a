//! Friction fitted to simulated sweeps of every joint of the shipped files: how far it is off, and whether the stated
//! deviations hold. Gravity is the simulation's in the sweep, and the controller's in the fit.

use crate::common::prelude::*;
use calibration::fit::Direction;
use calibration::fit::posture::{PostureReading, postures};
use calibration::fit::sweep::{Estimate, JointFriction, Moving};
use sim::friction_rig::{FrictionRig, FrictionRigSettings, SlowReading};
use units::drive::PerMille;

const CONFIGS: [&str; 4] = ["kraft_like", "kraft_like_500hz", "jpl_like", "sixr_spherical"];
const SEEDS: u64 = 25;

/// Relative errors, and errors in standard deviations.
#[derive(Default)]
struct Errors {
    relative: Vec<f64>,
    stated: Vec<f64>,
}

impl Errors {
    fn add(&mut self, found: Estimate, truth: f64) {
        self.relative.push(found.value / truth - 1.0);
        self.stated.push((found.value - truth) / found.deviation);
    }

    /// Largest and RMS relative error, and RMS error in standard deviations.
    fn figures(&self) -> [f64; 3] {
        let rms = |errors: &[f64]| {
            let squares: f64 = errors.iter().map(|error| error * error).sum();
            (squares / f64::from(u32::try_from(errors.len()).unwrap())).sqrt()
        };
        let largest = self.relative.iter().fold(0.0, |most: f64, error| most.max(error.abs()));
        [largest, rms(&self.relative), rms(&self.stated)]
    }
}

/// Returns the torque or force of a reading without gravity, in N·m or N.
fn torque(config: &Config, place: usize, reading: &SlowReading) -> f64 {
    let mut actual = [PerMille(0); 6];
    actual[place] = PerMille(reading.per_mille);
    let arm = &config.controller.arm;
    let gravity = arm.gravity(&arm.posture(&reading.q));
    config.controller.calibration.torques(&actual)[place] - gravity[place]
}

#[test]
fn friction_of_simulated_sweeps_is_found_as_well_as_stated() {
    let (mut coulomb, mut viscous) = (Errors::default(), Errors::default());
    for name in CONFIGS {
        let config = config(&format!("config/{name}.toml"));
        let plant = config.plant();
        for (place, joint) in config.joints.iter().enumerate() {
            let settings = FrictionRigSettings {
                actuator: world::actuator(&joint.plant.actuator),
                joint: place,
                resistance: world::resistance(&joint.plant),
                start: world::start(&plant),
            };
            for seed in 0..SEEDS {
                let rig = FrictionRig::new(world::arm(&plant), settings, seed);
                let readings = rig.measure();
                let (held, moving): (Vec<&SlowReading>, Vec<_>) =
                    readings.iter().partition(|reading| reading.velocity.abs() <= 0.0);
                let moving = moving.into_iter().map(|reading| Moving {
                    velocity: reading.velocity,
                    torque: torque(&config, place, reading),
                });
                let resolution = joint.calibration.resolution();
                let found =
                    JointFriction::fit(&moving.collect::<Vec<_>>(), resolution, true).unwrap();
                assert_eq!(found.doubts(), [], "{name} {} {seed}", joint.name);
                let [true_coulomb, true_viscous] = rig.friction();
                coulomb.add(found.both.coulomb, true_coulomb);
                viscous.add(found.both.viscous, true_viscous);
                let held = held.into_iter().map(|reading| PostureReading {
                    q: reading.q.into(),
                    direction: if reading.is_rising { Direction::Up } else { Direction::Down },
                    torque: torque(&config, place, reading),
                });
                let capacity = joint.calibration.curve().max_torque();
                for posture in postures(&held.collect::<Vec<_>>()) {
                    assert!(posture.error.unwrap().abs() < 0.003 * capacity, "{posture:?}");
                }
            }
        }
    }
    let ([most, rms, stated], [viscous_most, viscous_rms, viscous_stated]) =
        (coulomb.figures(), viscous.figures());
    println!("Coulomb: {most:.3} at most, {rms:.4} RMS, {stated:.2} stated deviations RMS");
    println!("viscous: {viscous_most:.3} at most, {viscous_rms:.4} RMS, {viscous_stated:.2} RMS");
    assert!(most < 0.05 && rms < 0.012 && stated < 1.15);
    assert!(viscous_most < 0.25 && viscous_rms < 0.05 && viscous_stated < 1.25);
}
