//! `frhc-lab experiment return-to-centre`: Fig. 4 of the paper, at the hand.

mod report;

use clap::Args;

use crate::command::common::{self, Common, NamedConfig, Results};
use crate::command::frame::{Files, Frame, Report};
use crate::return_to_centre::script::{AXES, Sweep};
use crate::return_to_centre::trial::SweepResult;
use run::exit::{Failure, Kind, OrFail};

/// Time from the reference to an end, in s, in full and in short.
const LEG_S: [f64; 2] = [8.0, 3.0];

/// Axes of the short form.
const SHORT: [usize; 2] = [0, 5];

/// Files of the results.
const FILES: Files =
    Files { csv: &["axes.csv", "curves.csv"], has_figures: false, picture: ("force.svg", 3) };

/// `frhc-lab experiment return-to-centre`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
}

/// Runs the experiment, prints the table and writes the files.
pub(super) fn run(args: &Arguments, is_quiet: bool) -> Result<(), Failure> {
    let Results { seed, short, .. } = args.common.results;
    let configs = args.common.configs()?;
    let frame = Frame::new(&args.common.results, &FILES, is_quiet)?;
    let [full_s, short_s] = LEG_S;
    let leg_s = if short { short_s } else { full_s };
    let axes = (0..AXES.len()).filter(|axis| !short || SHORT.contains(axis));
    let axes: Vec<usize> = axes.collect();
    let of = |named| axes.iter().map(move |axis| (named, *axis));
    let jobs: Vec<(&NamedConfig, usize)> = configs.iter().flat_map(of).collect();
    let rows = frame.play(&jobs, |(NamedConfig { name, config }, axis)| {
        SweepResult::play(name, config, &Sweep::new(config, *axis, leg_s), seed)
            .or_fail(Kind::Configuration)
    })?;
    frame.conclude(Report {
        figures: &rows,
        tables: vec![report::table(&rows)],
        csv: vec![report::csv(&rows), report::curves(&rows)],
        panels: || Ok(rows.iter().map(report::panel).collect()),
        gate: common::none_stopped(rows.iter().filter_map(|row| {
            Some((format!("{}, {}", row.config, row.axis), row.stopped_by.as_deref()?))
        })),
    })
}
