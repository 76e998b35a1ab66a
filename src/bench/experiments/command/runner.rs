//! Runs of an experiment on all cores, with a progress bar.

use std::num::NonZero;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Plays all jobs on all cores; the results are in the order of the jobs, however long each takes.
pub(super) fn play_all<J: Sync, R: Send>(
    jobs: &[J],
    is_quiet: bool,
    play: impl Fn(&J) -> R + Sync,
) -> Vec<R> {
    let bar = bar(jobs.len(), is_quiet);
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, NonZero::get) {
            scope.spawn(|| {
                while let place = next.fetch_add(1, Ordering::Relaxed)
                    && let Some(job) = jobs.get(place)
                {
                    let result = play(job);
                    let mut done = done.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                    done.push((place, result));
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    let mut done = done.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    done.sort_by_key(|(place, _)| *place);
    done.into_iter().map(|(_, result)| result).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_jobs() {
        let jobs: Vec<u64> = (0..40).collect();
        let slow_first = |job: &u64| (0..2_000_000 / (job + 1)).fold(*job, |sum, one| sum ^ one);
        let expected: Vec<u64> = jobs.iter().map(slow_first).collect();
        assert_eq!(play_all(&jobs, true, slow_first), expected);
    }
}
