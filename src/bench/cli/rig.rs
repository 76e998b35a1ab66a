//! `frhc sim --calibrate` and `--calibrate-friction`: simulated measurements of a joint with an unknown torque curve or
//! unknown friction, as practice for `calib fit` and `calib friction`.

use std::path::PathBuf;

use clap::Args;

use calibration::fit::{Direction, Sample};
use calibration::torque_data::{JointReadings, JointSweep, SweepData, SweepReading, TorqueData};
use config::{Config, JointParameters};
use controller::arm::JointKind;
use run::exit::{Failure, Kind};
use run::print;
use run::results::{self, Force};
use sim::friction_rig::{FrictionRig, FrictionRigSettings, SlowReading};
use sim::rig::{Reading, Rig};
use telemetry::digits::significant;
use testbench::world;

/// Options of the simulated calibration rig.
#[derive(Debug, Args)]
pub(super) struct CalibrationRig {
    /// Open no bus; simulate measurements of this joint (name or number) against a load cell, with a torque curve
    /// other than configured, and print them as input of `frhc calib fit`.
    #[arg(long, value_name = "JOINT", group = "rig", conflicts_with_all = ["interfaces", "scenario"])]
    calibrate: Option<String>,
    /// Open no bus; simulate a slow sweep of this joint (name or number) and held postures, with friction other than
    /// configured, and print them as input of `frhc calib friction`.
    #[arg(long, value_name = "JOINT", group = "rig", conflicts_with_all = ["interfaces", "scenario"])]
    calibrate_friction: Option<String>,
    /// Write the measurements to this file instead of stdout.
    #[arg(short, long, value_name = "FILE", requires = "rig")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print the true torque curve or friction on stderr.
    #[arg(long, requires = "rig")]
    reveal: bool,
}

impl CalibrationRig {
    /// Returns whether measurements are simulated instead of drives on a bus.
    pub(super) const fn is_chosen(&self) -> bool {
        self.calibrate.is_some() || self.calibrate_friction.is_some()
    }
}

/// Simulates measurements of the chosen joint and writes them.
pub(super) fn run(args: &CalibrationRig, config: &Config, seed: u64) -> Result<(), Failure> {
    let mut text = String::new();
    if let Some(joint) = &args.calibrate {
        text = curve(args, find(config, joint)?, seed);
    }
    if let Some(joint) = &args.calibrate_friction {
        text = friction(args, config, find(config, joint)?, seed)?;
    }
    match &args.out {
        None => print::line(text.trim_end()),
        Some(path) => results::export(path, text.as_bytes(), args.force)?,
    }
    Ok(())
}

fn find<'c>(config: &'c Config, joint: &str) -> Result<&'c JointParameters, Failure> {
    config.joint(joint).ok_or_else(|| {
        Failure::new(Kind::Usage, format_args!("{}: no joint {joint}", config.file.display()))
    })
}

/// Returns measurements of a joint against a load cell.
fn curve(args: &CalibrationRig, joint: &JointParameters, seed: u64) -> String {
    let rig = Rig::new(world::actuator(&joint.plant.actuator), joint.plant.friction.coulomb, seed);
    if args.reveal {
        let [c1, c3, c5] = rig.torque_curve().map(|c| significant(c, 7));
        print::note(&format!("torque_curve = [{c1}, {c3}, {c5}]"));
    }
    let is_force = joint.plant.link.kind == JointKind::Prismatic;
    let unit = if is_force { "N" } else { "N·m" };
    let data = TorqueData {
        is_force,
        provenance: vec![
            format!(
                "simulated drive of joint {}, seed {seed}, by frhc sim --calibrate",
                joint.name
            ),
            format!("load cell on a lever, noise {:.4} {unit} RMS at the joint", rig.noise()),
            "driven slowly from end to end and back, twice; readings at rest".to_owned(),
        ],
        joints: vec![JointReadings {
            joint: joint.name.clone(),
            samples: rig.measure().into_iter().map(sample).collect(),
            ..JointReadings::default()
        }],
        ..TorqueData::default()
    };
    data.to_string()
}

/// Returns a slow sweep of a joint, and held postures.
fn friction(
    args: &CalibrationRig,
    config: &Config,
    joint: &JointParameters,
    seed: u64,
) -> Result<String, Failure> {
    let place = config.joints.iter().position(|other| other.name == joint.name);
    let place = place.filter(|place| !is_coupled(config, *place)).ok_or_else(|| {
        let reason = "is coupled with others; no sweep moves it alone";
        Failure::new(Kind::Usage, format_args!("joint {} {reason}", joint.name))
    })?;
    let plant = config.plant();
    let settings = FrictionRigSettings {
        actuator: world::actuator(&joint.plant.actuator),
        joint: place,
        resistance: world::resistance(&joint.plant),
        start: world::start(&plant),
    };
    let rig = FrictionRig::new(world::arm(&plant), settings, seed);
    let is_linear = joint.plant.link.kind == JointKind::Prismatic;
    let unit = if is_linear { "N" } else { "N·m" };
    if args.reveal {
        let [coulomb, viscous] = rig.friction().map(|value| significant(value, 6));
        print::note(&format!("coulomb = {coulomb}\nviscous = {viscous}"));
    }
    let data = SweepData {
        is_linear,
        provenance: vec![
            format!(
                "simulated drive of joint {}, seed {seed}, by frhc sim --calibrate-friction",
                joint.name
            ),
            format!(
                "mean of 6077h over each plateau, noise {:.4} {unit} RMS at the joint",
                rig.noise()
            ),
            "swept up and down at six speeds, then held in eight postures from both sides"
                .to_owned(),
        ],
        joints: vec![JointSweep {
            joint: joint.name.clone(),
            readings: rig.measure().into_iter().map(sweep_reading).collect(),
        }],
        ..SweepData::default()
    };
    Ok(data.to_string())
}

/// Returns whether the actuator of a joint moves others, or is moved by them.
pub(super) fn is_coupled(config: &Config, place: usize) -> bool {
    let matrix = config.controller.calibration.coupling().matrix();
    let is_other = |number: f64, other: usize| {
        let alone = if other == place { 1.0 } else { 0.0 };
        (number - alone).abs() > f64::EPSILON
    };
    let row = matrix.row(place).iter().enumerate().any(|(other, number)| is_other(*number, other));
    row || matrix.column(place).iter().enumerate().any(|(other, number)| is_other(*number, other))
}

fn sweep_reading(SlowReading { velocity, is_rising, per_mille, q }: SlowReading) -> SweepReading {
    let direction = if is_rising { Direction::Up } else { Direction::Down };
    let velocity = significant(velocity, 6);
    SweepReading { line: 0, velocity, direction, per_mille, q: Some(q.into()) }
}

fn sample(Reading { is_rising, per_mille, torque }: Reading) -> Sample {
    let direction = if is_rising { Direction::Up } else { Direction::Down };
    Sample { torque, per_mille: per_mille.into(), direction }
}
