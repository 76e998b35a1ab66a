//! `frhc sim --calibrate`: measurements of a joint whose torque curve nobody knows, to practise on.

use std::path::PathBuf;

use clap::Args;

use config::Config;
use config::torque_data::Measured;
use config::torque_data::TorqueData;
use controller::arm::JointKind;
use controller::fit::Direction;
use controller::fit::Sample;
use lab::world;
use run::exit::Failure;
use run::exit::Kind;
use run::print;
use run::results;
use run::results::Force;
use sim::rig::Reading;
use sim::rig::Rig;
use telemetry::digits::significant;

/// What `frhc sim` takes to be a calibration rig.
#[derive(Debug, Args)]
pub(super) struct Calibrate {
    /// No bus: this joint, by name or number, against a load cell, with another torque curve than
    /// configured. Writes what is measured, for `frhc calib fit`.
    #[arg(long, value_name = "JOINT", conflicts_with_all = ["interfaces", "scenario"])]
    pub(super) calibrate: Option<String>,
    /// Leave the measurements here, not on stdout.
    #[arg(short, long, value_name = "FILE", requires = "calibrate")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) force: Force,
    /// Tell the torque curve that is to be found out, on stderr.
    #[arg(long, requires = "calibrate")]
    pub(super) reveal: bool,
}

/// Measures `joint` and writes what was measured.
pub(super) fn run(
    args: &Calibrate,
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
            "driven slowly from end to end and back, twice; every reading at rest".to_owned(),
        ],
        joints: vec![Measured {
            joint: joint.name.clone(),
            samples: rig.measure().into_iter().map(sample).collect(),
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
