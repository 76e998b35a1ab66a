//! `frhc report`: what happened in a recorded session, as one page for people.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::session_config::configuration;
use crate::whole_file::WholeFile;
use ::report::{Interruption, Page, Subject};
use config::Config;
use progress::Progress;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results::Force;

/// Name of the report in the folder of its session.
const NAME: &str = "report.html";

/// `frhc report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Folder of the session, or of a fault record.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    /// Another session: figures beside each other, curves over one another.
    #[arg(long, value_name = "OTHER")]
    compare: Option<PathBuf>,
    /// Configuration of a fault record that lies in no session, or of a session that has lost its own.
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// File to write [default: report.html in the folder].
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace an existing report.
    #[arg(long)]
    force: bool,
}

/// Writes the report, and prints its path.
pub(super) fn run(args: &ReportArgs, is_quiet: bool) -> Result<(), Failure> {
    let subject = subject(&args.session, args.config.as_deref())?;
    let other = args.compare.as_deref().map(|folder| subject_of(folder, None));
    let other = other.transpose()?;
    let path = args.out.clone().unwrap_or_else(|| args.session.join(NAME));
    let cycles = match &other {
        Some(other) => subject.cycles().zip(other.cycles()).map(|(one, other)| one + other),
        None => subject.cycles(),
    };
    let mut file = WholeFile::create(Some(&path), Force { force: args.force })?;
    let progress = Progress::start(cycles, "cycles", is_quiet).or_fail(Kind::System)?;
    let page = ::report::report(&subject, other.as_ref(), |cycles| {
        progress.advance(cycles);
        !progress.is_interrupted()
    });
    progress.check().or_fail(Kind::Interrupted)?;
    progress.finish();
    let page = page.map_err(|Interruption| progress.interrupted()).or_fail(Kind::Interrupted)?;
    let Page { html, remarks } = page;
    if let Err(error) = file.write_all(html.as_bytes()) {
        return file.abandon(error);
    }
    file.finish()?;
    remarks.iter().for_each(|remark| print::note(remark));
    print::line(&path.display().to_string());
    Ok(())
}

fn subject(folder: &Path, config: Option<&Path>) -> Result<Subject, Failure> {
    let config = config.map(|file| Config::load(file).or_fail(Kind::Configuration));
    subject_of(folder, config.transpose()?)
}

fn subject_of(folder: &Path, config: Option<Config>) -> Result<Subject, Failure> {
    let configure =
        |session: &::replay::Session| configuration(session).map_err(|failure| failure.to_string());
    Subject::open(folder, config, configure).or_fail(Kind::File)
}
