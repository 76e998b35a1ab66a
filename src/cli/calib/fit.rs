//! `frhc calib fit`: a file of measurements to torque curves, a report, a fragment of a configuration
//! and pictures.

use std::fs;
use std::path::Path;

use anyhow::Context;

use crate::cli::calib::Fit;
use crate::cli::calib::fragment;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::print;
use crate::config::Config;
use crate::config::Joint;
use crate::config::torque_data::TorqueData;
use crate::controller::fit::Calibrated;
use crate::controller::fit::Polynomial;
use crate::controller::fit::Sample;
use crate::telemetry::digits::significant;
use crate::telemetry::torque_plot::TorquePlot;

/// What one joint's measurements came to.
pub(super) struct Fitted<'a> {
    /// Its name, the configuration's if there is one.
    pub(super) joint: String,
    pub(super) samples: &'a [Sample],
    /// The curve, or why there is none.
    pub(super) outcome: Result<Calibrated, String>,
    /// The straight line to compare with: what it is, and its slope in ‰ per N·m.
    line: (&'static str, f64),
}

/// Fits, reports, writes.
pub(super) fn run(args: &Fit) -> Result<(), Failure> {
    let data = TorqueData::load(&args.data).or_fail(Kind::Configuration)?;
    let config = args.config.as_deref().map(Config::load).transpose();
    let config = config.or_fail(Kind::Configuration)?;
    let all = fit(&data, config.as_ref())?;
    let wanted = |fitted: &Fitted<'_>| {
        args.joint.as_ref().is_none_or(|joint| is_called(&fitted.joint, joint, config.as_ref()))
    };
    let fitted: Vec<Fitted<'_>> = all.into_iter().filter(wanted).collect();
    if let (Some(joint), true) = (&args.joint, fitted.is_empty()) {
        let file = args.data.display();
        return Err(Failure::new(Kind::Usage, format_args!("no joint {joint} in {file}")));
    }
    if args.json {
        print::line(&json(&args.data, &data, &fitted).to_string());
    } else {
        fitted.iter().for_each(|fitted| report(fitted, unit(&data)));
    }
    if let Some(folder) = &args.out {
        write(folder, &args.data, &data, &fitted)?;
    }
    verdict(&fitted)
}

/// Fits every joint of the data.
fn fit<'a>(data: &'a TorqueData, config: Option<&Config>) -> Result<Vec<Fitted<'a>>, Failure> {
    let fit_one = |measured: &'a crate::config::torque_data::Measured| {
        let joint = config.map(|config| find(config, &measured.joint)).transpose()?;
        let name = joint.map_or(&measured.joint, |joint| &joint.name);
        let calibrated = Calibrated::fit(&measured.samples).map_err(|error| error.to_string());
        let calibrated = calibrated.and_then(|calibrated| rounded(&calibrated));
        let outcome = calibrated.and_then(|calibrated| turning_like(joint, calibrated));
        let line = outcome.as_ref().map_or(0.0, |calibrated| calibrated.line.coefficients[0]);
        Ok(Fitted {
            joint: name.clone(),
            samples: &measured.samples,
            outcome,
            line: joint.map_or(("best straight line", line), nominal),
        })
    };
    data.joints.iter().map(fit_one).collect()
}
