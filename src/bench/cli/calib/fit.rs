//! `frhc calib fit`: fits torque curves to measurements; writes a report, a fragment of a configuration, and plots.

use std::fs;
use std::path::Path;

use anyhow::Context;

use crate::calib::plot::TorquePlot;
use crate::calib::session::{CurveResult, Evidence, Session};
use crate::calib::{Fit, fragment, judgement, report};
use calibration::torque_data::TorqueData;
use config::{Config, JointParameters};
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results::{self, Force};

/// Fits the curves, prints the report and writes the files.
pub(super) fn run(args: &Fit) -> Result<(), Failure> {
    let data = TorqueData::load(&args.data).or_fail(Kind::Configuration)?;
    let config = args.config.as_deref().map(Config::load).transpose();
    let config = config.or_fail(Kind::Configuration)?;
    let name = args.data.file_name().unwrap_or(args.data.as_os_str());
    let session = Session {
        file: name.to_string_lossy().into_owned(),
        data: &data,
        joints: fit_all(&data, config.as_ref(), args.joint.as_deref())?,
    };
    if args.json {
        print::line(&report::json(&session).to_string());
    } else {
        print::line(&report::text(&session));
    }
    if let Some(folder) = &args.out {
        write(folder, &session, args.force)?;
    }
    verdict(&session)
}

/// Fits every joint of the data, or the `wanted` one.
fn fit_all<'a>(
    data: &'a TorqueData,
    config: Option<&Config>,
    wanted: Option<&str>,
) -> Result<Vec<CurveResult<'a>>, Failure> {
    let wanted = wanted.map(|name| called(config, name, Kind::Usage)).transpose()?;
    let mut joints: Vec<CurveResult<'a>> = Vec::new();
    for measured in &data.joints {
        let (name, joint) = called(config, &measured.joint, Kind::Configuration)?;
        if joints.iter().any(|other| other.joint == name) {
            let reason = format_args!("joint {name} occurs both by name and by number");
            return Err(Failure::new(Kind::Configuration, reason));
        }
        if wanted.as_ref().is_none_or(|(wanted, _)| *wanted == name) {
            joints.push(judgement::judge(name, measured, data.is_force, joint));
        }
    }
    match wanted {
        Some((name, _)) if joints.is_empty() => {
            Err(Failure::new(Kind::Usage, format_args!("no measurements of joint {name}")))
        }
        Some(_) | None => Ok(joints),
    }
}

/// Returns name and configuration of a joint given by name or number; without a configuration the name as written.
pub(super) fn called<'c>(
    config: Option<&'c Config>,
    written: &str,
    kind: Kind,
) -> Result<(String, Option<&'c JointParameters>), Failure> {
    let Some(config) = config else { return Ok((written.to_owned(), None)) };
    let joint = config.joint(written).ok_or_else(|| {
        let file = config.file.display();
        Failure::new(kind, format_args!("{file}: no joint {written}"))
    })?;
    Ok((joint.name.clone(), Some(joint)))
}

/// Writes the fragment and the plots to `folder`, all or none.
fn write(folder: &Path, session: &Session<'_>, force: Force) -> Result<(), Failure> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string()).or_fail(Kind::File)?;
    let mut files = vec![(folder.join("torque_curves.toml"), fragment::text(session))];
    for CurveResult { joint, measured, evidence, .. } in &session.joints {
        let Some(Evidence { fit, line, .. }) = evidence else { continue };
        let plot = TorquePlot {
            joint,
            provenance: &report::origin(session, measured),
            unit: report::unit(session.data.is_force),
            samples: &measured.samples,
            calibrated: fit,
            line: *line,
        };
        files.push((folder.join(format!("{}.svg", file_name(joint))), plot.svg()?));
    }
    results::export_all(&files, force)
}

/// Replaces characters that are unsafe in file names.
fn file_name(joint: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || c == '-';
    joint.chars().map(|c| if is_plain(c) { c } else { '_' }).collect()
}

/// Returns a failure if a joint has no valid curve.
fn verdict(session: &Session<'_>) -> Result<(), Failure> {
    let rejected = session.joints.iter().flat_map(|fitted| {
        let joint = format!("{}: joint {}", session.file, fitted.joint);
        fitted.reasons.iter().map(move |reason| format!("{joint}: {reason}"))
    });
    let rejected: Vec<String> = rejected.collect();
    if rejected.is_empty() {
        Ok(())
    } else {
        Err(Failure::new(Kind::Negative, rejected.join("\n")))
    }
}
