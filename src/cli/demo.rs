//! `frhc demo`: the whole main job in one process.

use std::time::Duration;

use indicatif::ProgressBar;
use indicatif::ProgressDrawTarget;
use indicatif::ProgressStyle;

use crate::cli::args::Demo;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::print;
use crate::cli::recorder::Session;
use crate::cli::scenario;
use crate::config::Config;
use crate::lab::bench::Bench;
use crate::telemetry::record::Mode;
use crate::telemetry::summary::Summary;

/// The progress bar moves every so many cycles.
const BAR_EVERY: u64 = 500;

/// Runs the scenario and prints what it came to.
pub(super) fn run(args: &Demo, quiet: bool) -> Result<(), Failure> {
    let config = Config::load(&args.config).or_fail(Kind::Configuration)?;
    let scenario = scenario::load(&args.scenario)?;
    let seconds = args.seconds.unwrap_or_else(|| scenario.seconds());
    if !(seconds > 0.0 && seconds <= 86_400.0) {
        let reason = format!("--seconds {seconds}: more than 0 and at most 86400");
        return Err(Failure::new(Kind::Usage, reason));
    }
    let interfaces: Vec<_> = config.buses.iter().map(|bus| bus.interface.clone()).collect();
    let session = args.out.as_deref().map(|folder| Session::create(folder, &interfaces, 0));
    let session = session.transpose().or_fail(Kind::Bus)?;

    let summary = simulate(args, quiet, &config, scenario, seconds, session.as_mut())?;
    if let Some(session) = session {
        session.finish(&summary).or_fail(Kind::Bus)?;
    }
    if args.json {
        print::line(&serde_json::to_string(&summary).or_fail(Kind::Bus)?);
    } else {
        print::line(&summary.to_string());
    }
    match &summary.stopped_by {
        Some(cause) if summary.final_mode == Mode::Stopped.name() => {
            Err(Failure::new(Kind::Stopped, format!("stopped by {cause}")))
        }
        Some(_) | None => Ok(()),
    }
}
