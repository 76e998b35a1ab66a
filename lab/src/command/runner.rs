//! Runs of an experiment on all cores, with progress. They write no file, so a signal ends the process immediately.

use std::num::NonZero;
use std::thread;

use progress::Progress;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use testbench::threads::each;

/// Plays all jobs on all cores; the results are in the order of the jobs.
///
/// # Errors
/// Returns the error of the first job that fails.
pub(super) fn play_all<J: Sync, R: Send>(
    jobs: &[J],
    is_quiet: bool,
    play: impl Fn(&J) -> Result<R, Failure> + Sync,
) -> Result<Vec<R>, Failure> {
    let total = u64::try_from(jobs.len()).unwrap_or(u64::MAX);
    let progress = Progress::start(total, "runs", is_quiet).or_fail(Kind::System)?;
    let cores = thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN);
    let play_counted = |job: &J| {
        let result = play(job);
        progress.advance(1);
        result
    };
    let results = progress.abandonable(print::error, || each(cores, jobs, play_counted));
    results.into_iter().collect()
}

/// Runs `compute` with a progress indicator of this name.
///
/// # Errors
/// Returns an error if signals cannot be received.
pub(super) fn prepare<R: Send>(
    name: &str,
    is_quiet: bool,
    compute: impl FnOnce() -> R + Send,
) -> Result<R, Failure> {
    let progress = Progress::start(None, "runs", is_quiet).or_fail(Kind::System)?;
    progress.set_state(name);
    Ok(progress.abandonable(print::error, compute))
}
