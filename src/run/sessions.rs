//! `frhc sessions`: recorded sessions, listed and packed.

mod documents;
mod list;
mod pack;

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, Subcommand};

use crate::exit::{Failure, Kind, OrFail};
use crate::interrupt::Interrupt;
use crate::print;
use crate::sessions::list::Row;
use crate::sessions::pack::PackReport;
use crate::sources::DESCRIPTION;

/// `frhc sessions`.
#[derive(Debug, Subcommand)]
pub enum Sessions {
    /// Lists recorded sessions: time, duration, size, parts, and how each has ended.
    #[command(after_help = "Example:\n  frhc sessions list /var/lib/frhc")]
    List(List),
    /// Packs the finished parts of recorded sessions with gzip. Every command reads both.
    #[command(
        after_help = "A part is finished once the next one has begun, and all are once summary.json is there; a part that is being \
            written is left as it is. A packed part is compared with the plain one before that is removed. Ctrl-C ends it \
            with whole files.\n\nExample:\n  frhc sessions pack /var/lib/frhc"
    )]
    Pack(Pack),
}

/// `frhc sessions list`.
#[derive(Debug, Args)]
pub struct List {
    /// Folder of sessions, or of one session.
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    /// Print one JSON object per session.
    #[arg(long)]
    json: bool,
}

/// `frhc sessions pack`.
#[derive(Debug, Args)]
pub struct Pack {
    /// Folders of sessions, or folders that sessions lie in.
    #[arg(value_name = "SESSION", required = true)]
    sessions: Vec<PathBuf>,
}

/// Executes the command.
///
/// # Errors
/// When a folder has no session, a file cannot be read or written, or a signal was received.
pub fn run(command: &Sessions) -> Result<(), Failure> {
    match command {
        Sessions::List(args) => list(args),
        Sessions::Pack(args) => pack(args),
    }
}

fn list(args: &List) -> Result<(), Failure> {
    let rows: Vec<_> = sessions_in(&args.folder)?.iter().map(|it| Row::read(it)).collect();
    if args.json {
        for session in &rows {
            print::line(&serde_json::to_string(session).or_fail(Kind::File)?);
        }
    } else {
        list::table(&rows).iter().for_each(|line| print::line(line));
    }
    let unreadable = rows.iter().filter(|row| row.is_unreadable()).count();
    if unreadable == 0 {
        return Ok(());
    }
    let reason = format!("{}: {unreadable} of {} unreadable", args.folder.display(), rows.len());
    Err(Failure::new(Kind::File, reason))
}

fn pack(args: &Pack) -> Result<(), Failure> {
    let interrupt = Interrupt::watch().context("cannot receive signals").or_fail(Kind::System)?;
    let mut total = PackReport::default();
    for given in &args.sessions {
        for folder in sessions_in(given)? {
            let packed = pack::pack(&folder, &|| interrupt.is_set());
            let named = || folder.display().to_string();
            let is_interrupted =
                packed.as_ref().is_err_and(|error| error.kind() == ErrorKind::Interrupted);
            if is_interrupted {
                let reason = format!("interrupted; {total}");
                return Err(Failure::new(Kind::Interrupted, reason));
            }
            let packed = packed.with_context(named).or_fail(Kind::File)?;
            print::line(&format!("{}: {packed}", named()));
            total += packed;
        }
    }
    if args.sessions.len() > 1 || total.sessions > 1 {
        print::line(&format!("total: {total}"));
    }
    Ok(())
}

/// Returns the session in `folder`, or the sessions in its subfolders, by name.
fn sessions_in(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let is_session = |folder: &Path| folder.join(DESCRIPTION).symlink_metadata().is_ok();
    if is_session(folder) {
        return Ok(vec![folder.to_path_buf()]);
    }
    let found = fs::read_dir(folder).with_context(|| folder.display().to_string());
    let found = found.or_fail(Kind::File)?.flatten();
    // Symbolic links are not followed.
    let folders = found.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
    let mut sessions: Vec<_> = folders.map(|entry| entry.path()).collect();
    sessions.retain(|folder| is_session(folder));
    sessions.sort();
    match sessions.is_empty() {
        true => {
            let reason = format!("{}: no session is in this folder", folder.display());
            Err(Failure::new(Kind::File, reason))
        }
        false => Ok(sessions),
    }
}
