//! `frhc-lab experiment fidelity`.

mod report;

use std::num::NonZero;

use clap::{Args, ValueEnum};

use crate::command::common::{self, Common, NamedConfig, refused};
use crate::command::frame::{Files, Frame, Report};
use crate::fidelity::experiment::{Condition, FidelityResult};
use crate::fidelity::script::{Course, HANDS, Hand};
use crate::fidelity::worst_cases::WorstCases;
use crate::no_trial::NoTrial;
use picture::{Ink, Panel, Series};
use run::exit::{Failure, Kind, OrFail};
use telemetry::fidelity::Sample;
use units::spatial::Wrench;

/// Time between two points of the picture, in s.
const RESOLUTION: f64 = 5e-3;

/// Files of the results.
const FILES: Files = Files { csv: &["runs.csv"], has_figures: false, picture: ("force.svg", 1) };

/// `frhc-lab experiment fidelity`.
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

/// Runs the experiment, prints the tables and writes the files.
pub(super) fn run(args: &Arguments, is_quiet: bool) -> Result<(), Failure> {
    let configs = args.common.configs()?;
    if let Some(NamedConfig { config, .. }) =
        configs.iter().find(|one| one.config.remote.wall.is_none())
    {
        return Err(refused(&config.file, NoTrial::NoWall));
    }
    let frame = Frame::new(&args.common.results, &FILES, is_quiet)?;
    let conditions = conditions(args);
    let hands = if args.common.results.short { HANDS.split_at(1).0 } else { &HANDS };
    let participants = || {
        let seeds = || args.common.results.seeds(args.seeds);
        hands.iter().flat_map(move |hand| seeds().map(move |seed| (hand, seed)))
    };
    let each = configs.iter().flat_map(|named| conditions.iter().map(move |one| (named, *one)));
    let jobs =
        each.flat_map(|(named, condition)| participants().map(move |who| (named, condition, who)));
    let jobs: Vec<(&NamedConfig, Condition, _)> = jobs.collect();
    let rows = frame.play(&jobs, |(NamedConfig { name, config }, condition, who)| {
        FidelityResult::play(name, config, *condition, *who, |_, _| {}).or_fail(Kind::Drive)
    })?;
    let pooled = WorstCases::new(&rows);
    frame.conclude(Report {
        tables: report::tables(&pooled).into(),
        csv: vec![report::csv(&rows)],
        panels: || {
            // The picture shows the first run of each configuration.
            let first =
                jobs.chunk_by(|(a, ..), (b, ..)| std::ptr::eq(*a, *b)).filter_map(<[_]>::first);
            first.map(|(named, condition, who)| panel(named, *condition, *who)).collect()
        },
        gate: common::none_stopped(rows.iter().filter_map(|row| {
            let FidelityResult { config, condition, hand, seed, stopped_by, .. } = row;
            let Condition { course, arm, .. } = condition;
            let run = format!("{config}, {course}, {arm}, {hand}, seed {seed}");
            Some((run, stopped_by.as_deref()?))
        })),
        figures: pooled,
    })
}

fn conditions(args: &Arguments) -> Vec<Condition> {
    let all = if args.common.results.short { Condition::short() } else { Condition::full() };
    let is_asked = |condition: &Condition| match args.part {
        None => true,
        Some(Part::Still) => condition.course == Course::Full,
        Some(Part::Releases) => condition.course != Course::Full,
    };
    all.into_iter().filter(is_asked).collect()
}

/// Plays a run again for the panel of its forces.
fn panel(
    NamedConfig { name, config }: &NamedConfig,
    condition: Condition,
    participant: (&'static Hand, u64),
) -> Result<Panel, Failure> {
    let (mut reference, mut felt) = (Vec::new(), Vec::new());
    let each = |t: f64, sample: Option<&Sample>| {
        let is_due = reference.last().is_none_or(|[last, _]: &[f64; 2]| t - last >= RESOLUTION);
        if is_due {
            // Cycles without a sample leave a gap in the curve.
            let force =
                |of: fn(&Sample) -> &Wrench| sample.map_or(f64::NAN, |one| of(one).force.norm());
            reference.push([t, force(|sample| &sample.reference)]);
            felt.push([t, force(|sample| &sample.felt)]);
        }
    };
    FidelityResult::play(name, config, condition, participant, each).or_fail(Kind::Drive)?;
    let series = [
        Series::new("force at the hand", Ink::Line, felt),
        Series::new("K_T times the sensed force", Ink::Line, reference),
    ];
    Ok(Panel::new(format!("{name}, {} hand", participant.0), ["s", "N"], series))
}
