//! Section 4.2 of the paper: with linear torque curves "the feeling at the FRHC was all wrong" for test forces along
//! one axis; with 5th-order polynomials it was right. Gravity torques pass through the same curves, so their error is
//! felt, too.

use std::fmt;

use nalgebra::SVector;

use crate::common::prelude::*;
use calibration::fit::{CurveFit, Direction, Sample};
use config::JointParameters;
use controller::Output;
use controller::calibration::TorqueCurve;
use sim::rig::{Reading, Rig};
use units::spatial::Jacobian;

/// Returns the configuration with other torque curves, base first.
fn with_curves(curves: &[TorqueCurve]) -> Config {
    let mut curves = curves.iter();
    let replaced = KRAFT_TEXT.lines().map(|line| {
        if line.starts_with("torque_curve =") {
            format!("torque_curve = {:?}\n", curves.next().unwrap().coefficients())
        } else {
            format!("{line}\n")
        }
    });
    parse(KRAFT, &replaced.collect::<String>())
}

/// Returns the straight line through the end of each curve, as in a data sheet.
fn linear(config: &Config) -> Vec<TorqueCurve> {
    let line = |curve: &TorqueCurve| {
        let end = curve.max_torque();
        TorqueCurve::new([curve.at(end) / end, 0.0, 0.0], end).unwrap()
    };
    config.joints.iter().map(|joint| line(joint.calibration.curve())).collect()
}

/// Difference between exerted and commanded force at the grip, in percent of the commanded one.
#[derive(Debug)]
struct Distortion {
    rms: f64,
    worst: f64,
    cycles: u32,
}

impl fmt::Display for Distortion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rms, worst, cycles } = self;
        write!(f, "{rms:.2} % RMS, {worst:.2} % at worst, over {cycles} cycles in contact")
    }
}

/// Presses into the wall along x with the drives of `world` and a node configured by `node`; compares the exerted
/// force at the grip with the commanded one.
fn distortion(world: &Config, node: &Config) -> Distortion {
    let mut bench = Bench::in_world_of(world, node, scenario("contact_10s"), 1, ());
    bench.bring_up().unwrap();
    let (mut squares, mut worst, mut cycles) = (0.0, 0.0_f64, 0);
    let mut engaged_for = 0;
    let (mut last, mut before) = (None, None);
    for _ in 0..6_000 {
        let record = bench.cycle();
        engaged_for = if record.mode == Mode::Engaged { engaged_for + 1 } else { 0 };
        // A cycle's torque acts from the next SYNC on; by the SYNC after that, the current has settled.
        let commanded: Option<Output> = before;
        before = last.replace(record.output);
        let Some(commanded) = commanded.filter(|output| output.f_g_task.force.norm() > 1.0) else {
            continue;
        };
        // 0.6 s after the deadman closes, both reflection and gravity compensation have ramped up.
        if engaged_for < 600 {
            continue;
        }
        let exerted = bench.world_mut().torques();
        let f_g_error = wrench_of(&commanded.j_g, &(exerted - commanded.tau));
        let percent = 100.0 * f_g_error.force.norm() / commanded.f_g_task.force.norm();
        squares += percent * percent;
        worst = worst.max(percent);
        cycles += 1;
    }
    Distortion { rms: (squares / f64::from(cycles)).sqrt(), worst, cycles }
}

/// Returns the wrench at the grip that joint torques exert: `Jᵀ f_g = tau`.
fn wrench_of(j_g: &Jacobian<6>, tau: &SVector<f64, 6>) -> Wrench {
    Wrench::from_components(j_g.matrix().transpose().lu().solve(tau).unwrap().into())
}

/// Returns the curve fitted to a rig's measurements of a joint, and the rig's true curve.
fn calibrated(joint: &JointParameters, seed: u64) -> (TorqueCurve, TorqueCurve) {
    let rig = Rig::new(world::actuator(&joint.plant.actuator), joint.plant.friction.coulomb, seed);
    let true_curve = TorqueCurve::new(rig.torque_curve(), joint.plant.actuator.max_torque).unwrap();
    let samples: Vec<Sample> = rig.measure().into_iter().map(sample).collect();
    let fit = CurveFit::fit(&samples).unwrap();
    assert_eq!(fit.is_reversed, joint.plant.actuator.gear_ratio < 0.0);
    assert!(
        fit.curve.max_torque() >= joint.plant.actuator.max_torque,
        "{}",
        fit.curve.max_torque()
    );
    (
        TorqueCurve::new(fit.curve.coefficients(), joint.plant.actuator.max_torque).unwrap(),
        true_curve,
    )
}

fn sample(reading: Reading) -> Sample {
    Sample {
        torque: reading.torque,
        per_mille: reading.per_mille.into(),
        direction: if reading.is_rising { Direction::Up } else { Direction::Down },
    }
}

#[test]
fn linear_torque_curves_distort_the_felt_force() {
    let truth = config(KRAFT);
    let polynomial = distortion(&truth, &truth);
    let linear = distortion(&truth, &with_curves(&linear(&truth)));
    println!("felt force, straight lines: {linear}");
    println!("felt force, polynomials:    {polynomial}");
    assert!(polynomial.cycles > 400 && linear.cycles > 400);
    // The rest is rounding to 1 ‰ of each target, and the settling of the currents.
    assert!(polynomial.rms < 1.2 && polynomial.worst < 3.0, "{polynomial}");
    assert!(linear.rms > 20.0 * polynomial.rms, "{linear}");
}

#[test]
fn fitted_curves_restore_the_felt_force() {
    let config = config(KRAFT);
    let (fitted, true_curve): (Vec<_>, Vec<_>) =
        config.joints.iter().zip(40..).map(|(joint, seed)| calibrated(joint, seed)).unzip();
    let world = with_curves(&true_curve);
    let measured = distortion(&world, &with_curves(&fitted));
    let before = distortion(&world, &config);
    println!("felt force, before calibration: {before}");
    println!("felt force, calibrated:         {measured}");
    assert!(measured.rms < 2.0 && before.rms > 5.0 * measured.rms);
}

#[test]
fn fit_error_is_below_its_stated_residual() {
    let config = config(KRAFT);
    for (seed, joint) in (0..48).zip(config.joints.iter().cycle()) {
        let rig =
            Rig::new(world::actuator(&joint.plant.actuator), joint.plant.friction.coulomb, seed);
        let true_curve =
            TorqueCurve::new(rig.torque_curve(), joint.plant.actuator.max_torque).unwrap();
        let samples: Vec<Sample> = rig.measure().into_iter().map(sample).collect();
        let fit = CurveFit::fit(&samples).unwrap();
        assert_eq!(fit.doubts(), [], "{seed}");
        let stated = fit.both.residuals.left_out_rms;
        for step in -20..=20 {
            let torque = joint.plant.actuator.max_torque * f64::from(step) / 20.0;
            let error = (fit.curve.at(torque) - true_curve.at(torque)).abs();
            assert!(
                error < stated && error < 0.01 * true_curve.at(joint.plant.actuator.max_torque),
                "{seed}: {error}"
            );
        }
        let friction = fit.friction.torque;
        assert!((friction / joint.plant.friction.coulomb - 1.0).abs() < 0.1, "{seed}: {friction}");
    }
}
