//! `frhc experiment fidelity`.

mod report;

use std::num::NonZero;

use clap::{Args, ValueEnum};

use crate::command::common::{self, Common, Named};
use crate::command::picture::{self, Ink, Panel, Series};
use crate::command::runner;
use crate::command::table;
use crate::fidelity::experiment::{Condition, Participants, Row};
use crate::fidelity::pooled::Pooled;
use crate::fidelity::script::{Course, Hand};
use crate::fidelity::trial::NoTrial;
use run::exit::{Failure, Kind, OrFail};
use telemetry::fidelity::Sample;
use units::spatial::Wrench;

/// Time between two points of the picture, in s.
const RESOLUTION: f64 = 5e-3;

/// Files of the results.
const FILES: [&str; 3] = ["runs.csv", "force.svg", "report.md"];

/// `frhc experiment fidelity`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
    /// Number of seeds; one with --short, which also takes one hand alone.
    #[arg(long, value_name = "N", default_value = "3", conflicts_with = "short")]
    seeds: NonZero<u64>,
    /// Part of the experiment: still contact with drag in free motion, or releases. Default: both.
    #[arg(long, value_name = "PART")]
    part: Option<Part>,
}

/// Part of the experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    /// Still contact, and drag in free motion.
    Still,
    /// Releases in both modes.
    Releases,
}

/// One run.
struct Job<'n> {
    named: &'n Named,
    condition: Condition,
    participant: (&'static Hand, u64),
}

/// Runs everything, prints the table and writes the files.
pub(super) fn run(args: &Arguments, is_quiet: bool) -> Result<(), Failure> {
    let configs = args.common.configs()?;
    configs.iter().try_for_each(require_wall)?;
    args.common.ensure_free(&FILES)?;
    let rows = rows(&configs, args, is_quiet)?;
    let pooled = Pooled::new(&rows);
    let tables = report::tables(&pooled);
    args.common.print(&pooled, &tables)?;
    args.common.write(|| {
        let picture = picture(&configs, args)?;
        let contents = [report::csv(&rows), picture, table::markdown(&tables)];
        Ok(FILES.into_iter().zip(contents).collect())
    })?;
    common::refuse_stopped(rows.iter().filter_map(|row| {
        let Row { config, condition, hand, seed, stopped_by, .. } = row;
        let Condition { course, arm, .. } = condition;
        Some((format!("{config}, {course}, {arm}, {hand}, seed {seed}"), stopped_by.as_deref()?))
    }))
}

fn require_wall(named: &Named) -> Result<(), Failure> {
    if named.config.remote.wall.is_some() {
        return Ok(());
    }
    let reason = format!("{}: {}", named.config.file.display(), NoTrial::NoWall);
    Err(Failure::new(Kind::Configuration, reason))
}

fn participants(args: &Arguments) -> Participants {
    let (seed, short) = (args.common.seed, args.common.short);
    if short { Participants::short(seed) } else { Participants::full(seed, args.seeds) }
}

fn conditions(args: &Arguments) -> Vec<Condition> {
    let all = if args.common.short { Condition::short() } else { Condition::full() };
    let is_asked = |condition: &Condition| match args.part {
        None => true,
        Some(Part::Still) => condition.course == Course::Full,
        Some(Part::Releases) => condition.course != Course::Full,
    };
    all.into_iter().filter(is_asked).collect()
}

/// Plays all runs; the rows are in the order of the runs.
fn rows(configs: &[Named], args: &Arguments, is_quiet: bool) -> Result<Vec<Row>, Failure> {
    let (conditions, participants) = (conditions(args), participants(args));
    let jobs: Vec<Job<'_>> = configs
        .iter()
        .flat_map(|named| conditions.iter().map(move |condition| (named, *condition)))
        .flat_map(|(named, condition)| {
            participants.each().map(move |participant| Job { named, condition, participant })
        })
        .collect();
    let rows = runner::play_all(&jobs, is_quiet, |Job { named, condition, participant }| {
        Row::play(&named.name, &named.config, *condition, *participant, |_, _| {})
    });
    rows.into_iter().map(|row| row.or_fail(Kind::Drive)).collect()
}

/// Plays one run of each configuration for the picture of its forces.
fn picture(configs: &[Named], args: &Arguments) -> Result<String, Failure> {
    let mut panels = Vec::new();
    for Named { name, config } in configs {
        let (mut wanted, mut felt) = (Vec::new(), Vec::new());
        let each = |t: f64, sample: Option<&Sample>| {
            let is_due = wanted.last().is_none_or(|[last, _]: &[f64; 2]| t - last >= RESOLUTION);
            if is_due {
                // A gap where nothing can be compared.
                let force = |of: fn(&Sample) -> &Wrench| {
                    sample.map_or(f64::NAN, |one| of(one).force.norm())
                };
                wanted.push([t, force(|sample| &sample.wanted)]);
                felt.push([t, force(|sample| &sample.felt)]);
            }
        };
        let (Some(participant), Some(condition)) =
            (participants(args).each().next(), conditions(args).first().copied())
        else {
            continue;
        };
        Row::play(name, config, condition, participant, each).or_fail(Kind::Drive)?;
        panels.push(Panel {
            title: format!("{name}, {} hand", participant.0),
            axes: ["s", "N"],
            places: Vec::new(),
            series: vec![
                Series::new("force at the hand", Ink::Line, felt),
                Series::new("K_T times the sensed force", Ink::Line, wanted),
            ],
        });
    }
    picture::svg(&panels, 1).or_fail(Kind::Bus)
}
