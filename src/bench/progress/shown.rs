//! Progress bar of a piece of work, and its interruption by a signal.

use std::fmt::Write;
use std::io;
use std::panic::resume_unwind;
use std::process;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use thiserror::Error;

use crate::unit::{self, Unit};
use run::exit::INTERRUPTED;
use run::interrupt::Interrupt;

/// Time between two drawings.
const DRAW_PERIOD: Duration = Duration::from_millis(100);

/// Time between two checks for signals.
const WATCH_PERIOD: Duration = Duration::from_millis(50);

/// Maximum number of positions of a bar.
const POSITIONS: u64 = 1_000;

/// Amount of work between two positions if the total is unknown.
const UNKNOWN_STEP: u64 = 1_000;

/// Counter of completed work with a progress bar, which is shown on a terminal at stderr until this is dropped.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    unit: Unit,
    total: Option<u64>,
    done: AtomicU64,
    /// Amount of work between two positions of the bar.
    step: u64,
    interrupt: Interrupt,
}

/// Signals cannot be received.
#[derive(Debug, Error)]
#[error("cannot receive signals: {0}")]
pub struct NoSignals(#[from] io::Error);

/// Interruption by a signal, with the amount of completed work.
#[derive(Debug, Error, PartialEq, Eq)]
#[error("interrupted after {0}")]
pub struct Interruption(String);

impl Progress {
    /// Starts a progress bar and a watch for signals. The bar is hidden if `is_quiet`.
    ///
    /// # Errors
    /// Returns an error if signals cannot be received.
    pub fn start(
        total: impl Into<Option<u64>>,
        unit: impl Into<Unit>,
        is_quiet: bool,
    ) -> Result<Self, NoSignals> {
        let interrupt = Interrupt::watch()?;
        Ok(Self::onto(target(is_quiet), total.into(), unit.into(), interrupt))
    }

    fn onto(
        target: ProgressDrawTarget,
        total: Option<u64>,
        unit: Unit,
        interrupt: Interrupt,
    ) -> Self {
        let bar = ProgressBar::with_draw_target(total, target).with_style(style(total, unit));
        if !bar.is_hidden() {
            bar.enable_steady_tick(DRAW_PERIOD);
        }
        let step = total.map_or(UNKNOWN_STEP, |total| (total / POSITIONS).max(1));
        Self { bar, unit, total, done: AtomicU64::new(0), step, interrupt }
    }

    /// Counts completed work. Takes some nanoseconds, on any thread.
    pub fn advance(&self, amount: u64) {
        let before = self.done.fetch_add(amount, Ordering::Relaxed);
        let done = before.saturating_add(amount);
        if before / self.step != done / self.step {
            self.bar.set_position(done);
        }
    }

    /// Shows a word beside the bar.
    pub fn set_state(&self, state: &str) {
        if !self.bar.is_hidden() {
            self.bar.set_message(format!("{state}  "));
        }
    }

    /// Calls `print` while the bar is hidden.
    pub fn suspend<R>(&self, print: impl FnOnce() -> R) -> R {
        self.bar.suspend(print)
    }

    /// Returns the time since the start.
    pub fn elapsed(&self) -> Duration {
        self.bar.elapsed()
    }

    /// Returns whether SIGINT or SIGTERM was received.
    pub fn is_interrupted(&self) -> bool {
        self.interrupt.is_set()
    }

    /// Checks for SIGINT and SIGTERM. Cheap enough for every piece of work.
    ///
    /// # Errors
    /// Returns an error if a signal was received; the error has the amount of completed work.
    pub fn check(&self) -> Result<(), Interruption> {
        if self.is_interrupted() { Err(self.interrupted()) } else { Ok(()) }
    }

    /// Runs work that writes no file and has long pieces, on a separate thread. SIGINT and SIGTERM end the process
    /// immediately, with [`INTERRUPTED`], after `report` was called with the message.
    pub fn abandonable<R: Send>(
        &self,
        report: impl FnOnce(&str),
        work: impl FnOnce() -> R + Send,
    ) -> R {
        thread::scope(|scope| {
            let (alive, ended) = channel::<()>();
            let worker = scope.spawn(move || {
                // Dropped when the work has ended, or has panicked.
                let _alive = alive;
                work()
            });
            while ended.recv_timeout(WATCH_PERIOD) != Err(RecvTimeoutError::Disconnected) {
                if let Err(interrupted) = self.check() {
                    report(&interrupted.to_string());
                    process::exit(INTERRUPTED.into());
                }
            }
            worker.join().unwrap_or_else(|panic| resume_unwind(panic))
        })
    }

    /// Removes the bar; returns the message of an interruption.
    pub fn interrupted(&self) -> Interruption {
        self.finish();
        let done = self.done.load(Ordering::Relaxed);
        Interruption(self.unit.amount(done, self.total, " of "))
    }

    /// Removes the bar, as dropping does.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}

/// Returns where a bar is drawn: stderr, if that is a terminal that moves its cursor.
fn target(is_quiet: bool) -> ProgressDrawTarget {
    if is_quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() }
}

/// Returns the line of a bar, which fits any width of the terminal.
fn style(total: Option<u64>, unit: Unit) -> ProgressStyle {
    let template = match total {
        Some(_) => "{wide_bar} {percent:>3} %  {done}  {msg}{spent}{left}",
        None => "{spinner} {done}  {msg}{spent}",
    };
    let style = ProgressStyle::with_template(template);
    let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
    style
        .with_key("done", move |state: &ProgressState, to: &mut dyn Write| {
            write(to, &unit.amount(state.pos(), state.len(), "/"));
        })
        .with_key("spent", |state: &ProgressState, to: &mut dyn Write| {
            write(to, &unit::words(state.elapsed()));
        })
        .with_key("left", |state: &ProgressState, to: &mut dyn Write| {
            // The remaining time is unknown at first.
            if state.pos() > 0 {
                write(to, &format!(", {} left", unit::words(state.eta())));
            }
        })
}

/// Writes into a line, which cannot fail.
fn write(to: &mut dyn Write, text: &str) {
    to.write_str(text).unwrap_or_default();
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hidden(total: Option<u64>) -> Progress {
        let target = ProgressDrawTarget::hidden();
        Progress::onto(target, total, Unit::Count("cycles"), Interrupt::default())
    }

    #[test]
    fn signal_ends_the_work_with_what_was_done() {
        let progress = hidden(Some(60_000));
        progress.advance(1_233);
        progress.check().unwrap();
        progress.advance(1);
        progress.interrupt.set();
        let ended = progress.check().unwrap_err().to_string();
        assert_eq!(ended, "interrupted after 1234 of 60000 cycles");
        let unknown = hidden(None);
        unknown.advance(7);
        assert_eq!(unknown.interrupted().to_string(), "interrupted after 7 cycles");
    }

    #[test]
    fn abandonable_work_returns_its_result() {
        assert_eq!(hidden(None).abandonable(|_| {}, || 7), 7);
    }

    #[test]
    fn bar_moves_once_in_a_thousandth_of_the_work() {
        let progress = hidden(Some(60_000));
        (0..59).for_each(|_| progress.advance(1));
        assert_eq!(progress.bar.position(), 0);
        progress.advance(1);
        assert_eq!(progress.bar.position(), 60);
        progress.advance(180);
        assert_eq!(progress.bar.position(), 240);
    }
}
