//! `frhc experiment return-to-centre`: Fig. 4 of the paper, at the hand.

mod report;

use clap::Args;

use crate::command::common::{self, Common, Named};
use crate::command::picture;
use crate::command::runner;
use crate::command::table;
use crate::return_to_centre::script::{AXES, Sweep};
use crate::return_to_centre::trial::Row;
use run::exit::{Failure, Kind, OrFail};

/// Time from the reference to an end, in s, in full and in short.
const LEG_S: [f64; 2] = [8.0, 3.0];

/// Axes of the short form.
const SHORT: [usize; 2] = [0, 5];

/// Files of the results.
const FILES: [&str; 4] = ["axes.csv", "curves.csv", "force.svg", "report.md"];

/// Panels in a row of the picture.
const COLUMNS: usize = 3;

/// `frhc experiment return-to-centre`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
}

/// One run.
struct Job<'n> {
    named: &'n Named,
    sweep: Sweep,
}

/// Runs everything, prints the table and writes the files.
pub(super) fn run(args: &Arguments, is_quiet: bool) -> Result<(), Failure> {
    let (seed, short) = (args.common.seed, args.common.short);
    let configs = args.common.configs()?;
    args.common.ensure_free(&FILES)?;
    let jobs: Vec<Job<'_>> = configs.iter().flat_map(|named| jobs(named, short)).collect();
    let rows = runner::play_all(&jobs, is_quiet, |Job { named, sweep }| {
        let row = Row::play(&named.name, &named.config, sweep, seed);
        row.or_fail(Kind::Configuration)
    });
    let rows: Vec<Row> = rows.into_iter().collect::<Result<_, _>>()?;
    let tables = [report::table(&rows)];
    args.common.print(&rows, &tables)?;
    args.common.write(|| {
        let picture = picture::svg(&report::panels(&rows), COLUMNS).or_fail(Kind::Bus)?;
        let [axes, curves] = [report::csv(&rows), report::curves(&rows)];
        let contents = [axes, curves, picture, table::markdown(&tables)];
        Ok(FILES.into_iter().zip(contents).collect())
    })?;
    common::refuse_stopped(rows.iter().filter_map(|row| {
        Some((format!("{}, {}", row.config, row.axis), row.stopped_by.as_deref()?))
    }))
}

/// Returns the runs of one configuration.
fn jobs(named: &Named, is_short: bool) -> impl Iterator<Item = Job<'_>> {
    let [full, short] = LEG_S;
    let leg_s = if is_short { short } else { full };
    let axes = (0..AXES.len()).filter(move |axis| !is_short || SHORT.contains(axis));
    axes.map(move |axis| Job { named, sweep: Sweep::of(&named.config, axis, leg_s) })
}
