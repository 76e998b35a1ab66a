//! `frhc experiment fidelity`.

use std::num::NonZero;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::cli::experiment::{picture, report};
use crate::cli::scenario;
use config::Config;
use lab::fidelity::experiment::{Participants, Row, pooled};
use lab::fidelity::script::Hand;
use lab::fidelity::trial::{Arm, NoTrial};
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results::{self, Force};
use telemetry::fidelity::Sample;

/// The configurations without `--config`.
const CONFIGS: [&str; 3] =
    ["config/kraft_like.toml", "config/kraft_like_500hz.toml", "config/jpl_like.toml"];

/// Time between two points of the picture, in s.
const RESOLUTION: f64 = 5e-3;

/// `frhc experiment fidelity`.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// A configuration; repeatable. Default: three of those in config/.
    #[arg(short, long, value_name = "FILE")]
    config: Vec<PathBuf>,
    /// First seed of the operators' tremor: the same seed is the same experiment, bit for bit.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Number of seeds.
    #[arg(long, value_name = "N", default_value = "3", conflicts_with = "short")]
    seeds: NonZero<u64>,
    /// One hand and one seed.
    #[arg(long)]
    short: bool,
    /// Folder for runs.csv, force.svg and report.md.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Prints the pooled figures as JSON.
    #[arg(long)]
    json: bool,
    /// Prints the table as Markdown.
    #[arg(long, conflicts_with = "json")]
    markdown: bool,
}

/// A configuration with its name in tables.
struct Named {
    name: String,
    config: Config,
}

/// One run.
struct Job<'n> {
    named: &'n Named,
    arm: Arm,
    participant: (&'static Hand, u64),
}

/// Runs everything, prints the table and writes the files.
pub(super) fn run(args: &Arguments, quiet: bool) -> Result<(), Failure> {
    let configs = configs(args)?;
    let folder = args.out.as_deref();
    let files = ["runs.csv", "force.svg", "report.md"];
    for file in folder.iter().flat_map(|folder| files.map(|file| folder.join(file))) {
        results::ensure_free(&file, args.force)?;
    }
    let rows = rows(&configs, &participants(args), quiet)?;
    let pooled = pooled(&rows);
    let text = if args.json {
        serde_json::to_string(&pooled).or_fail(Kind::Bus)?
    } else if args.markdown {
        report::markdown(&pooled)
    } else {
        report::text(&pooled)
    };
    print::line(&text);
    if let Some(folder) = folder {
        std::fs::create_dir_all(folder).or_fail(Kind::Bus)?;
        let contents = [report::csv(&rows), picture(&configs, args)?, report::markdown(&pooled)];
        let contents = files.iter().map(|file| folder.join(file)).zip(contents);
        results::export_all(&contents.collect::<Vec<_>>(), args.force)?;
    }
    let stopped: Vec<&Row> = rows.iter().filter(|row| row.stopped_by.is_some()).collect();
    let Some(first) = stopped.first() else { return Ok(()) };
    let Row { config, arm, hand, seed, stopped_by, .. } = first;
    let cause = stopped_by.as_deref().unwrap_or_default();
    let count = stopped.len();
    let reason =
        format!("{count} runs stopped; the first, {config}, {arm}, {hand}, seed {seed}: {cause}");
    Err(Failure::new(Kind::Negative, reason))
}

fn configs(args: &Arguments) -> Result<Vec<Named>, Failure> {
    let files = match &*args.config {
        [] => CONFIGS.iter().map(PathBuf::from).collect(),
        named => named.to_vec(),
    };
    let named = |file: &PathBuf| {
        let config = Config::load(file).or_fail(Kind::Configuration)?;
        scenario::require_switch_box(&config)?;
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if config.remote.wall.is_none() {
            let reason = format!("{}: {}", file.display(), NoTrial::NoWall);
            return Err(Failure::new(Kind::Configuration, reason));
        }
        Ok(Named { name, config })
    };
    files.iter().map(named).collect()
}

fn participants(args: &Arguments) -> Participants {
    if args.short {
        Participants::short(args.seed)
    } else {
        Participants::full(args.seed, args.seeds)
    }
}

/// Plays all runs on all cores; the rows are in the order of the runs.
fn rows(configs: &[Named], participants: &Participants, quiet: bool) -> Result<Vec<Row>, Failure> {
    let jobs: Vec<Job<'_>> = configs
        .iter()
        .flat_map(|named| Arm::ALL.map(|arm| (named, arm)))
        .flat_map(|(named, arm)| {
            participants.each().map(move |participant| Job { named, arm, participant })
        })
        .collect();
    let bar = bar(jobs.len(), quiet);
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, NonZero::get) {
            scope.spawn(|| {
                while let place = next.fetch_add(1, Ordering::Relaxed)
                    && let Some(Job { named, arm, participant }) = jobs.get(place)
                {
                    let row = Row::play(&named.name, &named.config, *arm, *participant, |_, _| {});
                    done.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).push((place, row));
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    let mut done = done.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    done.sort_by_key(|(place, _)| *place);
    done.into_iter().map(|(_, row)| row.or_fail(Kind::Drive)).collect()
}

/// Plays one run of each configuration for the picture of its forces.
fn picture(configs: &[Named], args: &Arguments) -> Result<String, Failure> {
    let mut panels = Vec::new();
    for Named { name, config } in configs {
        let mut forces = Vec::new();
        let each = |t: f64, sample: Option<&Sample>| {
            let is_due = forces.last().is_none_or(|[last, ..]: &[f64; 3]| t - last >= RESOLUTION);
            let sample = sample.filter(|_| is_due);
            forces.extend(sample.map(|one| [t, one.wanted.force.norm(), one.felt.force.norm()]));
        };
        let first = participants(args).each().next();
        let Some(participant) = first else { continue };
        Row::play(name, config, Arm::Identified, participant, each).or_fail(Kind::Drive)?;
        panels.push(picture::Panel { title: format!("{name}, {} hand", participant.0), forces });
    }
    picture::svg(&panels).or_fail(Kind::Bus)
}

/// Returns a progress bar, which is shown on a terminal alone.
fn bar(length: usize, quiet: bool) -> ProgressBar {
    let bar = ProgressBar::new(u64::try_from(length).unwrap_or(u64::MAX));
    if quiet {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = "{bar:40} {percent:>3} %  {pos}/{len} runs  {elapsed}";
    if let Ok(style) = ProgressStyle::with_template(style) {
        bar.set_style(style);
    }
    bar
}
