//! `frhc demo`: the whole main job in one process.

use std::cell::RefCell;
use std::time::Duration;

use indicatif::ProgressBar;
use indicatif::ProgressDrawTarget;
use indicatif::ProgressStyle;

use crate::canopen::frame::Telegram;
use crate::cli::args::Demo;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::print;
use crate::cli::recorder::Session;
use crate::cli::scenario;
use crate::config::Config;
use crate::lab::bench::Bench;
use crate::sim::scenario::Scenario;
use crate::telemetry::record::Mode;
use crate::telemetry::summary::Summary;
use crate::time::Instant;

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
    let mut session = session.transpose().or_fail(Kind::Bus)?;

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

fn simulate(
    args: &Demo,
    quiet: bool,
    config: &Config,
    scenario: Scenario,
    seconds: f64,
    session: Option<&mut Session>,
) -> Result<Summary, Failure> {
    let length = Duration::try_from_secs_f64(seconds).or_fail(Kind::Usage)?;
    let cycles = length.as_micros().div_ceil(config.period.as_micros().max(1));
    let cycles = u64::try_from(cycles).or_fail(Kind::Usage)?;
    let bar = progress(cycles, quiet);
    let session = RefCell::new(session);
    let tap = |at: Instant, telegram: &Telegram| {
        if let Some(session) = session.borrow_mut().as_mut() {
            session.log.frame(at, telegram);
        }
    };
    let mut bench = Bench::new(config, scenario, args.seed, args.realtime, tap);
    bench.bring_up().or_fail(Kind::Drive)?;
    let mut summary = Summary::default();
    for cycle in 1..=cycles {
        let record = bench.cycle();
        summary.add(&record);
        if let Some(session) = session.borrow_mut().as_mut() {
            session.log.record(&record);
        }
        if cycle % BAR_EVERY == 0 || cycle == cycles {
            bar.set_position(cycle);
            bar.set_message(record.mode.name());
        }
    }
    bar.finish_and_clear();
    let carried = bench.carried();
    summary.bus_load_percent = carried.iter().map(|bus| bus.percent).collect();
    summary.bus_frames = carried.iter().map(|bus| bus.frames).collect();
    bench.stop().or_fail(Kind::Drive)?;
    Ok(summary)
}

/// A bar on a terminal, nothing anywhere else.
fn progress(cycles: u64, quiet: bool) -> ProgressBar {
    let bar = ProgressBar::new(cycles);
    if quiet {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = "{bar:40} {percent:>3} %  {pos}/{len} cycles  {msg}  {elapsed}";
    if let Ok(style) = ProgressStyle::with_template(style) {
        bar.set_style(style);
    }
    bar
}
