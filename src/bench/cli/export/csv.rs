//! `frhc export csv`: signals of a session at full rate, a row for each cycle.

use std::io::{self, IsTerminal, Write};
use std::num::NonZero;
use std::path::PathBuf;

use clap::Args;

use crate::session_config::configuration;
use crate::session_progress;
use crate::span::{Span, seconds};
use crate::whole_file::WholeFile;
use ::replay::Session;
use progress::Progress;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results::Force;
use signals::{Cycle, Cycles, Findings, Recording, ReplayVerdict, Signal, catalogue, chosen};

/// `frhc export csv`.
#[derive(Debug, Args)]
pub struct Csv {
    /// Folder of the session.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    /// Signals: names, quantities such as `tau`, or patterns such as `*.elbow` [default: all].
    #[arg(value_name = "SIGNAL")]
    signals: Vec<String>,
    /// Write every Nth cycle only.
    #[arg(long, value_name = "N", default_value = "1")]
    every: NonZero<u64>,
    #[command(flatten)]
    span: Span,
    /// File to write [default: stdout].
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

/// Writes the table.
pub(super) fn run(args: &Csv, is_quiet: bool) -> Result<(), Failure> {
    let session = Session::open(&args.session).or_fail(Kind::File)?;
    let config = configuration(&session)?;
    let recording = Recording::new(&session, &config);
    let all = catalogue(&recording);
    let signals = match &*args.signals {
        [] => all,
        names => chosen(&all, names).or_fail(Kind::Usage)?,
    };
    let cycles = recording.cycles().or_fail(Kind::File)?;
    let file = WholeFile::create(args.out.as_deref(), args.force)?;
    // Rows on the terminal show the progress themselves.
    let is_quiet = is_quiet || args.out.is_none() && io::stdout().is_terminal();
    let progress = session_progress::start(&args.session, None, is_quiet)?;
    let table = Table { signals: &signals, span: args.span, every: args.every.get() };
    table.write(file, cycles, &progress)
}

/// Table of signals, a row for each cycle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Table<'a> {
    pub(crate) signals: &'a [Signal],
    pub(crate) span: Span,
    /// Every Nth cycle is written.
    pub(crate) every: u64,
}

impl Table<'_> {
    /// Writes a row for each cycle, and notes the missing parts.
    pub(crate) fn write(
        &self,
        mut file: WholeFile,
        mut cycles: Cycles,
        progress: &Progress,
    ) -> Result<(), Failure> {
        let written = self.rows(&mut file, &mut cycles, progress);
        progress.finish();
        match written {
            Err(error) => return file.abandon(error),
            Ok(()) if progress.is_interrupted() => {
                return Err(Failure::new(Kind::Interrupted, "interrupted: no table was written"));
            }
            Ok(()) => file.finish()?,
        }
        remarks(cycles.findings()).iter().for_each(|remark| print::note(remark));
        Ok(())
    }

    fn rows(
        &self,
        file: &mut WholeFile,
        cycles: &mut Cycles,
        progress: &Progress,
    ) -> io::Result<()> {
        let mut table = csv::Writer::from_writer(file);
        let names = self.signals.iter().map(|signal| &*signal.name);
        table.write_record(["cycle", "time"].into_iter().chain(names))?;
        let mut row = csv::ByteRecord::new();
        while let Some(cycle) = cycles.next() {
            if self.span.is_behind(&cycle) || progress.is_interrupted() {
                break;
            }
            progress.advance(1);
            if !self.span.is_before(&cycle) && cycle.number.is_multiple_of(self.every) {
                fill(&mut row, self.signals, &cycle)?;
                table.write_byte_record(&row)?;
            }
        }
        table.flush()
    }
}

/// Fills a row: cycle, time in s since time zero, and the values; an absent one is empty.
fn fill(row: &mut csv::ByteRecord, signals: &[Signal], cycle: &Cycle<'_>) -> io::Result<()> {
    row.clear();
    let mut field = Vec::with_capacity(32);
    write!(field, "{}", cycle.number)?;
    row.push_field(&field);
    field.clear();
    write!(field, "{:.6}", seconds(cycle))?;
    row.push_field(&field);
    for signal in signals {
        field.clear();
        let value = signal.value(cycle);
        if !value.is_nan() {
            // Prevents `-0`.
            write!(field, "{}", value + 0.0)?;
        }
        row.push_field(&field);
    }
    Ok(())
}

/// Returns remarks on missing parts of a session, a line each; empty for a complete session.
pub(crate) fn remarks(findings: &Findings) -> Vec<String> {
    let verdict = findings.verdict.as_ref().and_then(|verdict| match verdict {
        ReplayVerdict::Equal => None,
        ReplayVerdict::EndsEarly(reason) => Some(format!("the replay ends early: {reason}")),
        ReplayVerdict::Differs { difference, .. } => {
            Some(format!("signals of the replay end where it differs: {difference}"))
        }
        ReplayVerdict::Missing(reason) => Some(format!("without signals of the replay: {reason}")),
    });
    findings.remarks.iter().cloned().chain(verdict).collect()
}
