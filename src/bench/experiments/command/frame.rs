//! Frame of every experiment: it plays the trials with progress, prints the results, writes their files, and applies the gate.

use anyhow::Context;
use serde::Serialize;

use crate::command::common::Results;
use crate::command::runner;
use crate::command::table::{self, Table};
use picture::{self, Panel};
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results;

/// Name of the tables as a file.
const TABLES: &str = "report.md";

/// Name of the figures as a file.
const FIGURES: &str = "figures.json";

/// Names of the files of an experiment, beside the tables.
#[derive(Debug)]
pub(super) struct Files {
    /// CSV files, in the order of [`Report::csv`].
    pub(super) csv: &'static [&'static str],
    /// The figures are a file, too.
    pub(super) has_figures: bool,
    /// Picture, and its panels in a row.
    pub(super) picture: (&'static str, usize),
}

impl Files {
    /// Returns the names in the order in which the files are made.
    fn names(&self) -> impl Iterator<Item = &'static str> + use<> {
        let figures = self.has_figures.then_some(FIGURES);
        self.csv.iter().copied().chain(figures).chain([self.picture.0, TABLES])
    }
}

/// Results of an experiment; `F` are its figures, and `P` returns the panels of its picture.
pub(super) struct Report<F, P> {
    /// Figures, for JSON.
    pub(super) figures: F,
    /// Tables.
    pub(super) tables: Vec<Table>,
    /// Rows of each CSV file, as [`table::csv`] returns them.
    pub(super) csv: Vec<anyhow::Result<String>>,
    /// Panels of the picture; called with `--out` alone.
    pub(super) panels: P,
    /// Reason for exit code 1.
    pub(super) gate: Option<String>,
}

/// An experiment with its options, whose files are free.
#[derive(Debug)]
pub(super) struct Frame<'a> {
    options: &'a Results,
    files: &'static Files,
    is_quiet: bool,
}

impl<'a> Frame<'a> {
    /// Refuses a folder that already has one of the files, before anything runs.
    ///
    /// # Errors
    /// A file exists, and `--force` is not given.
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
    /// Those of the first job that cannot be played.
    pub(super) fn play<J: Sync, R: Send>(
        &self,
        jobs: &[J],
        play: impl Fn(&J) -> Result<R, Failure> + Sync,
    ) -> Result<Vec<R>, Failure> {
        runner::play_all(jobs, self.is_quiet, play)
    }

    /// Computes what the jobs need; `name` is shown meanwhile.
    ///
    /// # Errors
    /// Signals cannot be received.
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
    /// A file that cannot be made or written, or else the gate's reason (exit 1).
    pub(super) fn conclude<F: Serialize, P: FnOnce() -> Result<Vec<Panel>, Failure>>(
        &self,
        report: Report<F, P>,
    ) -> Result<(), Failure> {
        let Report { figures, tables, csv, panels, gate } = report;
        print::line(&match (self.options.json, self.options.markdown) {
            (true, _) => serde_json::to_string(&figures).or_fail(Kind::Bus)?,
            (false, true) => table::markdown(&tables),
            (false, false) => table::text(&tables),
        });
        if let Some(folder) = &self.options.out {
            let mut contents = csv.into_iter().collect::<Result<Vec<_>, _>>().or_fail(Kind::Bus)?;
            if self.files.has_figures {
                contents.push(serde_json::to_string_pretty(&figures).or_fail(Kind::Bus)?);
            }
            contents.push(picture::svg(&panels()?, self.files.picture.1).or_fail(Kind::Bus)?);
            contents.push(table::markdown(&tables));
            let named = || folder.display().to_string();
            std::fs::create_dir_all(folder).with_context(named).or_fail(Kind::Bus)?;
            let paths = self.files.names().map(|file| folder.join(file));
            results::export_all(&paths.zip(contents).collect::<Vec<_>>(), self.options.force)?;
        }
        gate.map_or(Ok(()), |reason| Err(Failure::new(Kind::Negative, reason)))
    }
}
