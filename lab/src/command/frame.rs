//! Frame of every experiment: plays the trials with progress, prints the results, writes files, and applies the gate.

use anyhow::Context;
use serde::Serialize;

use crate::command::common::Results;
use crate::command::runner;
use crate::command::table::{self, Table};
use picture::{self, Panel};
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results;

/// Name of the file of the tables, in the folder of `--out`.
const TABLES: &str = "report.md";

/// Name of the file of the figures, in the folder of `--out`.
const FIGURES: &str = "figures.json";

/// Names of the files of an experiment, beside the tables.
#[derive(Debug)]
pub(super) struct Files {
    /// CSV files, in the order of [`Report::csv`].
    pub(super) csv: &'static [&'static str],
    /// Set if the figures are written to [`FIGURES`].
    pub(super) has_figures: bool,
    /// Name of the picture, and its number of panels in a row.
    pub(super) picture: (&'static str, usize),
}

impl Files {
    /// Returns the names in the order in which the files are written.
    fn names(&self) -> impl Iterator<Item = &'static str> + use<> {
        let figures = self.has_figures.then_some(FIGURES);
        self.csv.iter().copied().chain(figures).chain([self.picture.0, TABLES])
    }
}

/// Results of an experiment; `F` are its figures, and `P` returns the panels of its picture.
pub(super) struct Report<F, P> {
    /// Figures for `--json` and [`FIGURES`].
    pub(super) figures: F,
    /// Tables for the terminal and [`TABLES`].
    pub(super) tables: Vec<Table>,
    /// Rows of each CSV file, as [`table::csv`] returns them.
    pub(super) csv: Vec<anyhow::Result<String>>,
    /// Panels of the picture; called with `--out` alone.
    pub(super) panels: P,
    /// Reason for exit code 1.
    pub(super) gate: Option<String>,
}

/// Experiment whose output files do not exist yet, or may be overwritten.
#[derive(Debug)]
pub(super) struct Frame<'a> {
    options: &'a Results,
    files: &'static Files,
    is_quiet: bool,
}

impl<'a> Frame<'a> {
    /// Creates the frame after a check of the output folder, before any trial is played.
    ///
    /// # Errors
    /// Returns an error if an output file exists, and `--force` is not given.
    pub(super) fn new(
        options: &'a Results,
        files: &'static Files,
        is_quiet: bool,
    ) -> Result<Self, Failure> {
        let mut paths = options.out.iter().flat_map(|out| files.names().map(|file| out.join(file)));
        paths.try_for_each(|path| results::ensure_free(&path, options.force))?;
        Ok(Self { options, files, is_quiet })
    }

    /// Plays all jobs on all cores; the results are in the order of the jobs.
    ///
    /// # Errors
    /// Returns the error of the first job that fails.
    pub(super) fn play<J: Sync, R: Send>(
        &self,
        jobs: &[J],
        play: impl Fn(&J) -> Result<R, Failure> + Sync,
    ) -> Result<Vec<R>, Failure> {
        runner::play_all(jobs, self.is_quiet, play)
    }

    /// Runs `compute`, which prepares the jobs, with a progress indicator of this name.
    ///
    /// # Errors
    /// Returns an error if signals cannot be received.
    pub(super) fn prepare<R: Send>(
        &self,
        name: &str,
        compute: impl FnOnce() -> R + Send,
    ) -> Result<R, Failure> {
        runner::prepare(name, self.is_quiet, compute)
    }

    /// Prints the report, and writes its files to the folder of `--out`, all or none.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written, or the gate has a reason to fail (exit 1).
    pub(super) fn conclude<F: Serialize, P: FnOnce() -> Result<Vec<Panel>, Failure>>(
        &self,
        report: Report<F, P>,
    ) -> Result<(), Failure> {
        let Report { figures, tables, csv, panels, gate } = report;
        print::line(&match (self.options.json, self.options.markdown) {
            (true, _) => serde_json::to_string(&figures).or_fail(Kind::File)?,
            (false, true) => table::markdown(&tables),
            (false, false) => table::text(&tables),
        });
        if let Some(folder) = &self.options.out {
            let mut contents =
                csv.into_iter().collect::<Result<Vec<_>, _>>().or_fail(Kind::File)?;
            if self.files.has_figures {
                contents.push(serde_json::to_string_pretty(&figures).or_fail(Kind::File)?);
            }
            contents.push(picture::svg(&panels()?, self.files.picture.1).or_fail(Kind::File)?);
            contents.push(table::markdown(&tables));
            let named = || folder.display().to_string();
            std::fs::create_dir_all(folder).with_context(named).or_fail(Kind::File)?;
            let paths = self.files.names().map(|file| folder.join(file));
            results::export_all(&paths.zip(contents).collect::<Vec<_>>(), self.options.force)?;
        }
        gate.map_or(Ok(()), |reason| Err(Failure::new(Kind::Negative, reason)))
    }
}
