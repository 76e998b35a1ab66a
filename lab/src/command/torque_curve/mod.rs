//! `frhc-lab experiment torque-curve`: torque curves and test forces of the paper (section 4.2, Fig. 6).

mod report;

use std::num::NonZero;

use clap::Args;
use serde::Serialize;

use crate::command::common::{self, Common, NamedConfig};
use crate::command::frame::{Files, Frame, Report};
use crate::fidelity::trial::Arm;
use crate::torque_curves::calibration::{CurveErrors, JointCurves};
use crate::torque_curves::test_force::{Curve, TestForceResult};
use config::JointParameters;
use run::exit::{Failure, Kind, OrFail};

/// Files of the results.
const FILES: Files = Files {
    csv: &["joints.csv", "test_forces.csv"],
    has_figures: false,
    picture: ("curves.svg", 3),
};

/// Simulated arms: friction hides a part of the curves' effect.
const ARMS: [Arm; 2] = [Arm::Identified, Arm::Frictionless];

/// `frhc-lab experiment torque-curve`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
    /// Number of seeds, each with other motors; one with --short.
    #[arg(long, value_name = "N", default_value = "3", conflicts_with = "short")]
    seeds: NonZero<u64>,
}

/// Measured motors of a configuration, with the curves of one seed.
struct Motors<'n> {
    named: &'n NamedConfig,
    seed: u64,
    joint_curves: Vec<JointCurves>,
}

/// Results of the experiment.
#[derive(Serialize)]
struct Figures {
    joints: Vec<CurveErrors>,
    test_forces: Vec<TestForceResult>,
}

/// Runs the experiment, prints the tables and writes the files.
pub(super) fn run(args: &Arguments, is_quiet: bool) -> Result<(), Failure> {
    let configs = args.common.configs()?;
    let frame = Frame::new(&args.common.results, &FILES, is_quiet)?;
    let motors = frame.prepare("torque curves", || motors(args, &configs))??;
    let each = motors.iter().flat_map(|motors| ARMS.map(|arm| (motors, arm)));
    let jobs = each.flat_map(|(motors, arm)| Curve::ALL.map(|curve| (motors, arm, curve)));
    let jobs: Vec<(&Motors<'_>, Arm, Curve)> = jobs.collect();
    let test_forces = frame.play(&jobs, |(motors, arm, curve)| {
        let Motors { named: NamedConfig { name, config }, seed, joint_curves } = motors;
        TestForceResult::play(name, config, joint_curves, (*arm, *curve, *seed))
            .or_fail(Kind::Drive)
    })?;
    let joints = motors.iter().flat_map(|motors| {
        motors.each().map(|(joint, curves)| curves.row(&motors.named.name, joint, motors.seed))
    });
    let figures = Figures { joints: joints.collect(), test_forces };
    let Figures { joints, test_forces } = &figures;
    // Only stops with the polynomial fail the experiment.
    let calibrated = test_forces.iter().filter(|row| row.curve == Curve::Polynomial);
    frame.conclude(Report {
        tables: vec![report::joints(joints), report::test_forces(test_forces)],
        csv: vec![report::joints_csv(joints), report::test_forces_csv(test_forces)],
        panels: || {
            let first = motors.iter().filter(|motors| motors.seed == args.common.results.seed);
            let panels = first.flat_map(|motors| {
                motors
                    .each()
                    .map(|(joint, curves)| report::panel(&motors.named.name, joint, curves))
            });
            Ok(panels.collect())
        },
        gate: common::none_stopped(calibrated.filter_map(|row| {
            let TestForceResult { config, arm, curve, seed, stopped_by, .. } = row;
            Some((format!("{config}, {arm}, {curve}, seed {seed}"), stopped_by.as_deref()?))
        })),
        figures: &figures,
    })
}

impl Motors<'_> {
    /// Returns the joints, each with its measurement.
    fn each(&self) -> impl Iterator<Item = (&JointParameters, &JointCurves)> {
        self.named.config.joints.iter().zip(&self.joint_curves)
    }
}

/// Measures the motors of every configuration and seed.
fn motors<'n>(args: &Arguments, configs: &'n [NamedConfig]) -> Result<Vec<Motors<'n>>, Failure> {
    let seeds = || args.common.results.seeds(args.seeds);
    let each = configs.iter().flat_map(|named| seeds().map(move |seed| (named, seed)));
    each.map(|(named, seed)| {
        let joint_curves =
            JointCurves::measure_all(&named.config, seed).or_fail(Kind::Configuration)?;
        Ok(Motors { named, seed, joint_curves })
    })
    .collect()
}
