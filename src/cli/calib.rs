//! `frhc calib`: torque curves from measurements, and those of a configuration.

use std::fs;
use std::path::Path;
use std::path::PathBuf;

use clap::Args;
use clap::Subcommand;

use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::measurements;
use crate::cli::measurements::Measured;
use crate::cli::plot;
use crate::cli::plot::Picture;
use crate::cli::print;
use crate::config::Config;
use crate::controller::fit;
use crate::controller::fit::JointFit;

/// `frhc calib`.
#[derive(Debug, Args)]
pub(super) struct Calib {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Odd fifth-order torque curves from measurements, proven to rise.
    #[command(
        after_help = "Example:\n  frhc sim --config config/kraft_like.toml --calibrate elbow > elbow.csv\n  frhc calib fit elbow.csv --config config/kraft_like.toml --out /tmp/elbow"
    )]
    Fit(Fit),
    /// Whether the torque curves of a configuration rise, how least, and what a step of them is.
    #[command(after_help = "Example:\n  frhc calib check --config config/kraft_like.toml")]
    Check(Check),
}

#[derive(Debug, Args)]
struct Fit {
    /// CSV with columns joint, sweep (up, down), per_mille, torque_nm (or force_n).
    #[arg(value_name = "DATA.csv")]
    data: PathBuf,
    /// Only this joint.
    #[arg(short, long, value_name = "NAME")]
    joint: Option<String>,
    /// The configuration that has the joints' rated torques and gears, for the straight line.
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Leave torque_curves.toml and a picture of each joint here.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// The fits as one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct Check {
    /// The configuration.
    #[arg(short, long, value_name = "FILE")]
    config: PathBuf,
    /// The findings as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Fits, or checks.
pub(super) fn run(args: &Calib) -> Result<(), Failure> {
    match &args.task {
        Task::Fit(args) => run_fit(args),
        Task::Check(args) => run_check(args),
    }
}

/// One joint of a file, fitted.
struct Fitted {
    measured: Measured,
    fit: JointFit,
    /// ‰ per N·m by rated torque and gear.
    line: Option<f64>,
}

fn run_fit(args: &Fit) -> Result<(), Failure> {
    let config =
        args.config.as_deref().map(Config::load).transpose().or_fail(Kind::Configuration)?;
    let measurements = measurements::read(&args.data)?;
    let comments = measurements.comments;
    let wanted =
        |measured: &Measured| args.joint.as_ref().is_none_or(|name| *name == measured.joint);
    let mut fitted = Vec::new();
    let mut rejected = Vec::new();
    for measured in measurements.joints.into_iter().filter(wanted) {
        match fit::fit(&measured.samples) {
            Ok(fit) => {
                let line = config.as_ref().and_then(|config| nominal(config, &measured.joint));
                fitted.push(Fitted { measured, fit, line });
            }
            Err(error) => rejected.push(format!("joint {}: {error}", measured.joint)),
        }
    }
    if fitted.is_empty() && rejected.is_empty() {
        let name = args.joint.as_deref().unwrap_or("");
        let reason = format!("{}: no joint is called \"{name}\"", args.data.display());
        return Err(Failure::new(Kind::Configuration, reason));
    }
    if !rejected.is_empty() {
        // Nothing half done: a joint without a curve leaves no file.
        return Err(Failure::new(Kind::Negative, rejected.join("\n")));
    }
    if let Some(folder) = &args.out {
        leave(folder, &args.data, &comments, &fitted)?;
    }
    if args.json {
        let joints: Vec<_> = fitted.iter().map(json).collect();
        print::line(&serde_json::json!({ "joints": joints }).to_string());
    } else {
        for fitted in &fitted {
            print::line(&text(fitted));
        }
    }
    Ok(())
}

/// What a drive of this joint gives per N·m by its rated torque and gear alone, with its sign.
fn nominal(config: &Config, name: &str) -> Option<f64> {
    let joint = config.joints.iter().find(|joint| joint.name == name)?;
    Some(1e3 / (joint.gear_ratio * joint.rated_torque))
}

/// Everything about one joint, as people read it.
fn text(fitted: &Fitted) -> String {
    let Fitted { measured, fit, .. } = fitted;
    let unit = measured.unit;
    let [c1, c3, c5] = fit.both.coefficients;
    let per_cent = |value: f64| 100.0 * value / fit.curve.at(fit.curve.max_torque());
    let hysteresis = fit.hysteresis.map_or_else(
        || "not measured: one sweep only".to_owned(),
        |width| format!("{width:.4} {unit} between falling and rising commands"),
    );
    let direction = if fit.sign < 0.0 { "against the joint" } else { "with the joint" };
    let one_way = |fit: &fit::Fit| {
        let [c1, c3, c5] = fit.coefficients;
        format!(
            "{c1:.4}, {c3:.5}, {c5:.6}; {:.2} ‰ left over, {} samples",
            fit.residual, fit.samples
        )
    };
    [
        format!("joint {}", measured.joint),
        format!("  curve           {c1:.4} t {c3:+.5} t³ {c5:+.6} t⁵ ‰, t in {unit}, motor turning {direction}"),
        format!("  calibrated      up to ±{:.3} {unit}, cut off beyond", fit.curve.max_torque()),
        format!("  rises           everywhere, least by {:.3} ‰ per {unit} (proven)", fit.curve.least_slope()),
        format!(
            "  left over       {:.2} ‰ rms, {:.2} ‰ at most ({:.2} % of full torque), {} samples",
            fit.both.residual,
            fit.both.largest_residual,
            per_cent(fit.both.largest_residual),
            fit.both.samples
        ),
        format!("  leave one out   {:.2} ‰ rms", fit.both.leave_one_out),
        format!("  straight line   would leave {:.2} ‰ rms over", fit.both.linear_residual),
        format!("  hysteresis      {hysteresis}"),
        format!("  forwards        {}", one_way(&fit.forwards)),
        format!("  backwards       {}", one_way(&fit.backwards)),
    ]
    .join("\n")
}

fn json(fitted: &Fitted) -> serde_json::Value {
    let Fitted { measured, fit, line } = fitted;
    let one_way = |fit: &fit::Fit| {
        serde_json::json!({
            "coefficients": fit.coefficients,
            "samples": fit.samples,
            "residual_per_mille": fit.residual,
            "largest_residual_per_mille": fit.largest_residual,
            "leave_one_out_per_mille": fit.leave_one_out,
            "linear_residual_per_mille": fit.linear_residual,
        })
    };
    serde_json::json!({
        "joint": measured.joint,
        "unit": measured.unit,
        "sign": fit.sign,
        "max_torque": fit.curve.max_torque(),
        "least_slope": fit.curve.least_slope(),
        "hysteresis": fit.hysteresis,
        "nominal_per_mille_per_unit": line,
        "both": one_way(&fit.both),
        "forwards": one_way(&fit.forwards),
        "backwards": one_way(&fit.backwards),
    })
}

/// Leaves the curves as configuration and a picture of each.
fn leave(
    folder: &Path,
    data: &Path,
    comments: &[String],
    fitted: &[Fitted],
) -> Result<(), Failure> {
    fs::create_dir_all(folder).or_fail(Kind::Bus)?;
    let name =
        data.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let mut toml = format!(
        "# Torque curves fitted to {name} by `frhc calib fit`, version {}.\n",
        env!("CARGO_PKG_VERSION")
    );
    for comment in comments {
        toml.push_str(&format!("#   {comment}\n"));
    }
    for Fitted { measured, fit, line } in fitted {
        toml.push_str(&fragment(measured, fit));
        let picture = Picture {
            joint: &measured.joint,
            samples: &measured.samples,
            fit,
            line: *line,
            unit: measured.unit,
        };
        let file = folder.join(format!("{}.svg", file_name(&measured.joint)));
        fs::write(file, plot::svg(&picture)).or_fail(Kind::Bus)?;
    }
    fs::write(folder.join("torque_curves.toml"), toml).or_fail(Kind::Bus)
}

/// The keys of `[[joint]]` that a calibration sets.
fn fragment(measured: &Measured, fit: &JointFit) -> String {
    let [c1, c3, c5] = fit.both.coefficients;
    let key = if measured.unit == "N" { "max_force_n" } else { "max_torque_nm" };
    let hysteresis = fit.hysteresis.map_or_else(
        || "hysteresis not measured".to_owned(),
        |width| format!("hysteresis {width:.4} {}", measured.unit),
    );
    format!(
        "\n# joint {}: {} samples, {:.2} per mille rms left over, {:.2} leaving one out, {hysteresis}\n\
         {key} = {:.6}\ntorque_curve = [{c1:.9e}, {c3:.9e}, {c5:.9e}]\n",
        measured.joint,
        fit.both.samples,
        fit.both.residual,
        fit.both.leave_one_out,
        // Cut, not rounded: beyond the last sample nothing was measured.
        (fit.curve.max_torque() * 1e6).floor() / 1e6,
    )
}

/// A joint's name as that of a file.
fn file_name(joint: &str) -> String {
    joint.chars().map(|letter| if letter.is_alphanumeric() { letter } else { '_' }).collect()
}

fn run_check(args: &Check) -> Result<(), Failure> {
    let config = Config::load(&args.config).or_fail(Kind::Configuration)?;
    let mut found = Vec::new();
    for joint in &config.joints {
        let curve = joint.calibration.curve();
        let target = joint.calibration.max_target();
        if args.json {
            found.push(serde_json::json!({
                "joint": joint.name,
                "max_torque": curve.max_torque(),
                "least_slope": curve.least_slope(),
                "resolution": joint.calibration.resolution(),
                "max_target_per_mille": target.0,
            }));
        } else {
            print::line(&format!(
                "joint {:16} rises everywhere up to {} (least by {:.2} ‰ per unit), a step is {:.4}, the largest target {} ‰",
                joint.name,
                curve.max_torque(),
                curve.least_slope(),
                joint.calibration.resolution(),
                target.0
            ));
        }
    }
    if args.json {
        print::line(&serde_json::json!({ "ok": true, "joints": found }).to_string());
    }
    Ok(())
}
