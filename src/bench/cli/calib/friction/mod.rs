//! `frhc calib friction`: fits Coulomb and viscous friction to recorded sweeps; writes a report and a fragment of a
//! configuration. No bus is opened.

mod fragment;
mod judgement;
mod report;
mod sweep;

use std::fs;
use std::path::Path;

use anyhow::Context;

use crate::calib::Friction;
use crate::calib::friction::judgement::FrictionResult;
use calibration::torque_data::SweepData;
use config::Config;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results;

/// Fits friction, prints the report and writes the fragment.
pub(super) fn run(args: &Friction) -> Result<(), Failure> {
    let config = Config::load(&args.config.config).or_fail(Kind::Configuration)?;
    let mut problems = Vec::new();
    let mut files = Vec::new();
    for path in &args.files {
        match SweepData::load(path) {
            Ok(data) => files.push(data),
            Err(invalid) => problems.extend(invalid.0),
        }
    }
    let swept = sweep::join(&config, &files, problems).or_fail(Kind::Configuration)?;
    let wanted = args.joint.as_deref().map(|name| wanted(&config, name)).transpose()?;
    let is_wanted = |name: &str| wanted.is_none_or(|wanted| wanted == name);
    let swept = swept.into_iter().filter(|swept| is_wanted(&swept.parameters.name));
    let joints: Vec<FrictionResult<'_>> = swept.map(judgement::judge).collect();
    if let Some(name) = wanted.filter(|_| joints.is_empty()) {
        return Err(Failure::new(Kind::Usage, format_args!("no readings of joint {name}")));
    }
    if args.json {
        print::line(&report::json(&joints).to_string());
    } else {
        print::line(&report::text(&joints));
    }
    if let Some(folder) = &args.out {
        write(folder, &fragment::text(&files, &joints), args)?;
    }
    verdict(&joints)
}

/// Returns the name of a joint given by name or number.
fn wanted<'c>(config: &'c Config, name: &str) -> Result<&'c str, Failure> {
    let joint = config.joint(name).ok_or_else(|| {
        Failure::new(Kind::Usage, format_args!("{}: no joint {name}", config.file.display()))
    })?;
    Ok(&joint.name)
}

fn write(folder: &Path, fragment: &str, args: &Friction) -> Result<(), Failure> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string()).or_fail(Kind::File)?;
    results::export(&folder.join("friction.toml"), fragment.as_bytes(), args.force)
}

/// Returns a failure if a joint has no valid friction.
fn verdict(joints: &[FrictionResult<'_>]) -> Result<(), Failure> {
    let rejected = joints.iter().flat_map(|judged| {
        let joint = format!("{}: joint {}", judged.swept.files(), judged.name());
        judged.reasons.iter().map(move |reason| format!("{joint}: {reason}"))
    });
    let rejected: Vec<String> = rejected.collect();
    if rejected.is_empty() {
        Ok(())
    } else {
        Err(Failure::new(Kind::Negative, rejected.join("\n")))
    }
}
