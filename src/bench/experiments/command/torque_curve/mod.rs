//! `frhc experiment torque-curve`: Fig. 6 of the paper, and what its section 4.2 says of it.

mod report;

use std::num::NonZero;

use clap::Args;
use serde::Serialize;

use crate::command::common::{self, Common, Named};
use crate::command::picture;
use crate::command::runner;
use crate::command::table;
use crate::fidelity::trial::Arm;
use crate::torque_curves::calibration::{self, Bench};
use crate::torque_curves::test_force::{self, Curve};
use run::exit::{Failure, Kind, OrFail};

/// Files of the results.
const FILES: [&str; 4] = ["joints.csv", "test_forces.csv", "curves.svg", "report.md"];

/// Panels in a row of the picture.
const COLUMNS: usize = 3;

/// Arms that are tried: friction hides a part of what the curves do.
const ARMS: [Arm; 2] = [Arm::Identified, Arm::Frictionless];

/// `frhc experiment torque-curve`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
    /// Number of seeds, each with other motors; one with --short.
    #[arg(long, value_name = "N", default_value = "3", conflicts_with = "short")]
    seeds: NonZero<u64>,
}

/// The motors of a configuration by one seed.
struct Motors<'n> {
    named: &'n Named,
    seed: u64,
    benches: Vec<Bench>,
}

/// One run with test forces.
struct Job<'m> {
    motors: &'m Motors<'m>,
    arm: Arm,
    curve: Curve,
}

/// All results.
#[derive(Serialize)]
struct Figures<'r> {
    joints: &'r [calibration::Row],
    test_forces: &'r [test_force::Row],
}

/// Runs everything, prints the tables and writes the files.
pub(super) fn run(args: &Arguments, is_quiet: bool) -> Result<(), Failure> {
    let configs = args.common.configs()?;
    args.common.ensure_free(&FILES)?;
    let motors = motors(args, &configs)?;
    let joints: Vec<calibration::Row> = motors.iter().flat_map(rows).collect();
    let felt = play(&motors, is_quiet)?;
    let tables = [report::joints(&joints), report::test_forces(&felt)];
    args.common.print(&Figures { joints: &joints, test_forces: &felt }, &tables)?;
    args.common.write(|| {
        let panels = motors.iter().filter(|motors| motors.seed == args.common.seed);
        let panels: Vec<_> = panels.flat_map(panels_of).collect();
        let picture = picture::svg(&panels, COLUMNS).or_fail(Kind::Bus)?;
        let (joints, felt) = (report::joints_csv(&joints), report::test_forces_csv(&felt));
        let contents = [joints, felt, picture, table::markdown(&tables)];
        Ok(FILES.into_iter().zip(contents).collect())
    })?;
    // A stop with the maker's line is a result.
    let calibrated = felt.iter().filter(|row| row.curve == Curve::Polynomial);
    common::refuse_stopped(calibrated.filter_map(|row| {
        let test_force::Row { config, arm, curve, seed, stopped_by, .. } = row;
        Some((format!("{config}, {arm}, {curve}, seed {seed}"), stopped_by.as_deref()?))
    }))
}

/// Measures the motors of every configuration and seed.
fn motors<'n>(args: &Arguments, configs: &'n [Named]) -> Result<Vec<Motors<'n>>, Failure> {
    let (seed, short) = (args.common.seed, args.common.short);
    let count = if short { 1 } else { args.seeds.get() };
    let seeds = || (0..count).map(|place| seed.wrapping_add(place));
    let each = configs.iter().flat_map(|named| seeds().map(move |seed| (named, seed)));
    each.map(|(named, seed)| {
        let benches = Bench::measure_all(&named.config, seed).or_fail(Kind::Configuration)?;
        Ok(Motors { named, seed, benches })
    })
    .collect()
}

/// Returns the errors of every joint.
fn rows<'m>(motors: &'m Motors<'_>) -> impl Iterator<Item = calibration::Row> + 'm {
    let Motors { named: Named { name, config }, seed, benches } = motors;
    let joints = benches.iter().zip(&config.joints);
    joints.map(move |(bench, joint)| bench.row(name, joint, *seed))
}

fn panels_of<'m>(motors: &'m Motors<'_>) -> impl Iterator<Item = picture::Panel> + 'm {
    let Motors { named: Named { name, config }, benches, .. } = motors;
    benches.iter().zip(&config.joints).map(move |(bench, joint)| report::panel(name, joint, bench))
}

/// Plays the test forces with both curves on both arms.
fn play(motors: &[Motors<'_>], is_quiet: bool) -> Result<Vec<test_force::Row>, Failure> {
    let each = motors.iter().flat_map(|motors| ARMS.map(|arm| (motors, arm)));
    let jobs: Vec<Job<'_>> =
        each.flat_map(|(motors, arm)| Curve::ALL.map(|curve| Job { motors, arm, curve })).collect();
    let rows = runner::play_all(&jobs, is_quiet, |Job { motors, arm, curve }| {
        let Motors { named: Named { name, config }, seed, benches } = motors;
        test_force::Row::play(name, config, benches, (*arm, *curve, *seed)).or_fail(Kind::Drive)
    });
    rows.into_iter().collect()
}
