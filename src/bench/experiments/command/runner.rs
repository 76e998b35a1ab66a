//! Runs of an experiment on all cores, with a progress bar.

use std::num::NonZero;
use std::thread;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use testbench::threads::each;

/// Plays all jobs on all cores; the results are in the order of the jobs, however long each takes.
pub(super) fn play_all<J: Sync, R: Send>(
    jobs: &[J],
    is_quiet: bool,
    play: impl Fn(&J) -> R + Sync,
) -> Vec<R> {
    let bar = bar(jobs.len(), is_quiet);
    let cores = thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN);
    let results = each(cores, jobs, |job| {
        let result = play(job);
        bar.inc(1);
        result
    });
    bar.finish_and_clear();
    results
}

/// Returns a progress bar, which is shown on a terminal alone.
fn bar(length: usize, is_quiet: bool) -> ProgressBar {
    let bar = ProgressBar::new(u64::try_from(length).unwrap_or(u64::MAX));
    if is_quiet {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = "{bar:40} {percent:>3} %  {pos}/{len} runs  {elapsed}";
    if let Ok(style) = ProgressStyle::with_template(style) {
        bar.set_style(style);
    }
    bar
}
