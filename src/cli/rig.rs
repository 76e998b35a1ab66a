//! `frhc sim --calibrate`: simulated measurements of a joint with an unknown torque curve, as practice for `calib fit`.

use std::path::PathBuf;

use clap::Args;

use config::Config;
use config::torque_data::{Measured, TorqueData};
use controller::arm::JointKind;
use controller::fit::{Direction, Sample};
use lab::world;
use run::exit::{Failure, Kind};
use run::print;
use run::results::{self, Force};
use sim::rig::{Reading, Rig};
use telemetry::digits::significant;

/// Options of the simulated calibration rig.
#[derive(Debug, Args)]
pub(super) struct CalibrationRig {
    /// Open no bus; simulate measurements of this joint (name or number) against a load cell, with a torque curve
    /// other than configured, and print them as input of `frhc calib fit`.
    #[arg(long, value_name = "JOINT", conflicts_with_all = ["interfaces", "scenario"])]
    pub(super) calibrate: Option<String>,
    /// Write the measurements to this file instead of stdout.
    #[arg(short, long, value_name = "FILE", requires = "calibrate")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) force: Force,
    /// Print the true torque curve on stderr.
    #[arg(long, requires = "calibrate")]
    pub(super) reveal: bool,
}

/// Simulates measurements of `joint` and writes them.
pub(super) fn run(
    args: &CalibrationRig,
    config: &Config,
    joint: &str,
    seed: u64,
) -> Result<(), Failure> {
    let joint = config.joint(joint).ok_or_else(|| {
        Failure::new(Kind::Usage, format_args!("{}: no joint {joint}", config.file.display()))
    })?;
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
        joints: vec![Measured {
            joint: joint.name.clone(),
            samples: rig.measure().into_iter().map(sample).collect(),
            ..Measured::default()
        }],
        ..TorqueData::default()
    };
    match &args.out {
        None => print::line(data.to_string().trim_end()),
        Some(path) => results::export(path, data.to_string().as_bytes(), args.force)?,
    }
    Ok(())
}

fn sample(Reading { is_rising, per_mille, torque }: Reading) -> Sample {
    let direction = if is_rising { Direction::Up } else { Direction::Down };
    Sample { torque, per_mille: per_mille.into(), direction }
}
