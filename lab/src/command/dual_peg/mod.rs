//! `frhc-lab experiment dual-peg`: Table I of the paper, and its ratio over visual error and misalignment.

mod report;

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::command::common::{Results, refused};
use crate::command::frame::{Files, Frame, Report};
use crate::dual_peg::bench::{self, Situation};
use crate::dual_peg::condition::Condition;
use crate::dual_peg::settings::DualPeg;
use crate::dual_peg::statistics::{self, Ratio, TrialStatistics};
use crate::dual_peg::trial::Trial;
use run::exit::{Failure, Kind, OrFail};
use sim::operator_settings::OperatorSettings;
use telemetry::shaking::Shaking;

/// Files of the results.
const FILES: Files = Files { csv: &["trials.csv"], has_figures: true, picture: ("work.svg", 2) };

/// Trials of each operator and condition without misalignment.
const ALIGNED_TRIALS: u32 = 7;

/// Minimum share of successes without misalignment, and maximum excess of one condition's duration over another's.
const MIN_SUCCESS: f64 = 0.95;
const MAX_EXCESS: f64 = 0.2;

/// `frhc-lab experiment dual-peg`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Settings of the experiment.
    #[arg(long, value_name = "FILE", default_value = "lab/config/dual_peg.toml")]
    settings: PathBuf,
    #[command(flatten)]
    results: Results,
}

/// Part of the experiment that a trial belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Series {
    /// Conditions and operators of Table I.
    Table,
    /// Without misalignment and visual error.
    Aligned,
    /// At one visual error, in m.
    VisualError(f64),
    /// At one misalignment, in m.
    Misalignment(f64),
}

/// Trial that is still to be played.
struct Job<'s> {
    series: Series,
    operator: (&'s str, OperatorSettings),
    condition: Condition,
    number: u32,
    situation: Situation,
}

/// Results at one value of a sweep.
#[derive(Clone, Debug, Serialize)]
struct SweepPoint {
    series: Series,
    ratios: Vec<Ratio>,
    pooled: Vec<TrialStatistics>,
}

/// Results of the experiment.
#[derive(Serialize)]
struct Figures {
    table: Vec<TrialStatistics>,
    ratios: Vec<Ratio>,
    aligned: Vec<TrialStatistics>,
    sweep: Vec<SweepPoint>,
    /// Strongest shaking of the arm in free motion, over all trials.
    #[serde(skip_serializing_if = "Option::is_none")]
    shaking: Option<Shaking>,
}

/// Runs the experiment, prints the tables and writes the files.
pub(super) fn run(args: &Arguments, is_quiet: bool) -> Result<(), Failure> {
    let settings = DualPeg::load(&args.settings).or_fail(Kind::Configuration)?;
    let mut operators = operators(&settings)?;
    if args.results.short {
        operators.truncate(1);
    }
    let frame = Frame::new(&args.results, &FILES, is_quiet)?;
    let jobs = jobs(&settings, &operators, &args.results);
    let trials = frame.play(&jobs, |Job { series, operator, condition, number, situation }| {
        let trial = Trial::play(&settings, *condition, *operator, *number, situation);
        trial.map(|trial| (*series, trial)).map_err(|error| refused(&settings.file, error))
    })?;
    let figures = figures(&settings, &trials);
    frame.conclude(Report {
        tables: report::tables(&figures),
        csv: vec![report::csv(&trials)],
        panels: || Ok(report::panels(&figures)),
        gate: gate(&figures.aligned),
        figures: &figures,
    })
}

/// Returns the operators by name.
fn operators(settings: &DualPeg) -> Result<Vec<(&str, OperatorSettings)>, Failure> {
    let named = |name: &'_ String| bench::operator(name).ok_or_else(|| name.clone());
    let found = settings.operators.iter().map(|name| Ok((name.as_str(), named(name)?)));
    found.collect::<Result<_, String>>().map_err(|wrong| {
        let expected = "expected \"steady\", \"relaxed\", \"firm\" or \"nervous\"";
        refused(&settings.file, format!("operators: unknown name \"{wrong}\"; {expected}"))
    })
}

/// Returns every trial of the experiment, or of its short form.
fn jobs<'s>(
    settings: &'s DualPeg,
    operators: &[(&'s str, OperatorSettings)],
    results: &Results,
) -> Vec<Job<'s>> {
    let mut jobs = Vec::new();
    let mut add = |series, conditions: &[Condition], trials: u32| {
        for operator in operators {
            for condition in conditions {
                jobs.extend((0..trials).map(|number| Job {
                    series,
                    operator: *operator,
                    condition: *condition,
                    number,
                    situation: situation(settings, series, number, results.seed),
                }));
            }
        }
    };
    let trials = |full: u32| if results.short { 1 } else { full };
    add(Series::Table, &Condition::ALL, trials(settings.trials));
    add(Series::Aligned, &Condition::ALL, trials(ALIGNED_TRIALS));
    if !results.short {
        let (papers, sweep) = ([Condition::NEITHER, Condition::BOTH], &settings.sweep);
        for error in &sweep.visual_errors {
            add(Series::VisualError(*error), &papers, sweep.trials);
        }
        for offset in &sweep.misalignments {
            add(Series::Misalignment(*offset), &papers, sweep.trials);
        }
    }
    jobs
}

/// Draws the initial pose of a trial. Trials of the same number have the same seed for every operator and condition.
fn situation(settings: &DualPeg, series: Series, number: u32, seed: u64) -> Situation {
    let DualPeg { task, misalignment, turn, .. } = settings;
    let (offset, turn, error) = match series {
        Series::Table => (*misalignment, *turn, task.visual_error),
        Series::Aligned => ([0.0; 2], [0.0; 2], 0.0),
        Series::VisualError(error) => (*misalignment, *turn, error),
        Series::Misalignment(offset) => ([offset; 2], *turn, task.visual_error),
    };
    let seed = seed.wrapping_mul(1_000_003).wrapping_add(u64::from(number));
    Situation::drawn(settings, seed, offset, turn, error)
}

fn figures(settings: &DualPeg, trials: &[(Series, Trial)]) -> Figures {
    let names = &settings.operators;
    let of = |series: Series| {
        let of_series = trials.iter().filter(|(one, _)| *one == series);
        let all: Vec<Trial> = of_series.map(|(_, trial)| trial.clone()).collect();
        TrialStatistics::all(&all, names)
    };
    let ratios = |pooled: &[TrialStatistics]| statistics::ratios(pooled, names);
    let mut swept: Vec<Series> = Vec::new();
    for (series, _) in trials {
        let is_swept = matches!(series, Series::VisualError(_) | Series::Misalignment(_));
        if is_swept && !swept.contains(series) {
            swept.push(*series);
        }
    }
    let sweep = swept.into_iter().map(|series| {
        let pooled = of(series);
        SweepPoint { series, ratios: ratios(&pooled), pooled }
    });
    let table = of(Series::Table);
    Figures {
        ratios: ratios(&table),
        table,
        aligned: of(Series::Aligned),
        sweep: sweep.collect(),
        shaking: Shaking::strongest(trials.iter().filter_map(|(_, trial)| trial.shaking)),
    }
}

/// Returns the reason to fail: aligned pegs that are not inserted, or that take longer in one condition than in another.
fn gate(aligned: &[TrialStatistics]) -> Option<String> {
    let share_of = |condition: Condition| {
        let of = aligned.iter().filter(|one| one.condition == condition);
        let (inserted, trials) = TrialStatistics::counts(of);
        f64::from(inserted) / f64::from(trials.max(1))
    };
    let shares = Condition::ALL.map(|condition| (condition, share_of(condition)));
    if let Some((condition, share)) = shares.iter().find(|(_, share)| *share < MIN_SUCCESS) {
        let percent = 100.0 * share;
        return Some(format!("{condition}: {percent:.0} % of the aligned pegs were inserted"));
    }
    let slow = aligned.iter().find_map(|one| {
        let others = aligned.iter().filter(|other| other.operator == one.operator);
        let least = others.map(|other| other.seconds).fold(f64::INFINITY, f64::min);
        (one.seconds > least * (1.0 + MAX_EXCESS)).then_some((one, least))
    });
    let (TrialStatistics { operator, condition, seconds, .. }, least) = slow?;
    Some(format!(
        "aligned pegs take {operator} {seconds:.1} s with {condition}, {least:.1} s in another condition"
    ))
}
