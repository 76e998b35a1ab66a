//! `frhc export mcap`: a recorded session as one MCAP file.

use std::io;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::session_config::configuration;
use crate::session_progress;
use crate::span::Span;
use crate::whole_file::WholeFile;
use ::replay::Session;
use mcap_export::{Choice, Content, ExportError, ExportSummary, Extent, Pace};
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results::Force;
use signals::{Cycle, Recording};
use units::wording::counted;

/// `frhc export mcap`.
#[derive(Debug, Args)]
pub struct Mcap {
    /// Folder of the session.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    #[command(flatten)]
    span: Span,
    /// Leave out the topics in JSON: rosbags refuses files that have them.
    #[arg(long)]
    ros_only: bool,
    /// Write /tf, status and torques of every cycle, not 100 times a second: twice the size.
    #[arg(long)]
    full_rate: bool,
    /// File to write [default: stdout, unless it is a terminal].
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

/// Writes the file, and prints its topics with their numbers of messages.
pub(super) fn run(args: &Mcap, is_quiet: bool) -> Result<(), Failure> {
    if args.out.is_none() && io::stdout().is_terminal() {
        let reason = "an MCAP file is not for a terminal; give its name by --out";
        return Err(Failure::new(Kind::Usage, reason));
    }
    let session = Session::open(&args.session).or_fail(Kind::File)?;
    let config = configuration(&session)?;
    // Signals are watched before there is a file to remove.
    let progress = session_progress::start(&args.session, None, is_quiet)?;
    let mut file = WholeFile::create(args.out.as_deref(), args.force)?;
    let choose = |cycle: &Cycle<'_>| {
        progress.advance(1);
        if progress.is_interrupted() || args.span.is_behind(cycle) {
            Choice::End
        } else if args.span.is_before(cycle) {
            Choice::Skip
        } else {
            Choice::Export
        }
    };
    let content = if args.ros_only { Content::RosTypes } else { Content::All };
    let pace = if args.full_rate { Pace::Full } else { Pace::Reduced };
    let recording = Recording::new(&session, &config);
    let exported = mcap_export::export(&recording, Extent { content, pace }, &mut file, choose);
    progress.finish();
    if progress.is_interrupted() {
        return Err(Failure::new(Kind::Interrupted, "interrupted: no file was written"));
    }
    let exported = match exported {
        Ok(exported) => exported,
        Err(ExportError::Write(error)) => return file.abandon(error),
        Err(error) => return Err(error).or_fail(Kind::File),
    };
    file.finish()?;
    if let Some(path) = &args.out {
        report(path, &exported);
    }
    exported.warnings.iter().for_each(|warning| print::note(warning));
    Ok(())
}

/// Prints the topics, each with its number of messages.
fn report(path: &Path, exported: &ExportSummary) {
    print::line(&format!("{}: {}", path.display(), counted(exported.cycles, "cycle")));
    for (topic, messages) in &exported.messages {
        print::line(&format!("{topic:<26} {messages:>9}"));
    }
}
