//! Output of the program: data on stdout, messages on stderr.
//!
//! A failed write of data fails the command: nothing is written after the first error, and [`finish`] returns it. A
//! closed pipe (`| head`) is not a failure.

use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsFd;
use std::sync::{LazyLock, OnceLock};

use crate::exit::{Failure, Kind};
use crate::message::printable;
use crate::stderr;

/// Unbuffered stdout. `std::io::stdout` would silently discard output to a descriptor not open for writing.
static STDOUT: LazyLock<io::Result<File>> =
    LazyLock::new(|| io::stdout().as_fd().try_clone_to_owned().map(File::from));

/// First error of writing data.
static FAILED: OnceLock<io::Error> = OnceLock::new();

/// Prints a line of data.
pub fn line(text: &str) {
    if !has_failed() {
        record_result(data().and_then(|mut to| to.write_all(format!("{text}\n").as_bytes())));
    }
}

/// Returns stdout, for data written piece by piece; pass the result of each write to [`record_result`].
///
/// # Errors
/// When the descriptor cannot be duplicated.
pub fn data() -> io::Result<&'static File> {
    STDOUT.as_ref().map_err(|error| error.kind().into())
}

/// Records the result of writing data, for [`finish`]. Only the first error counts.
pub fn record_result(written: io::Result<()>) {
    if let Err(error) = written {
        FAILED.set(error).ok();
    }
}

/// Returns whether a write of data has failed, so that a command that only prints may end.
pub fn has_failed() -> bool {
    FAILED.get().is_some()
}

/// Returns the result of the command's output.
///
/// # Errors
/// Returns the first error of writing data.
pub fn finish() -> Result<(), Failure> {
    match FAILED.get() {
        Some(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::new(Kind::File, format!("stdout: {error}")))
        }
        Some(_) | None => Ok(()),
    }
}

/// Prints a message.
pub fn note(text: &str) {
    match stderr::queue() {
        Some(queue) => queue.send(format!("{text}\n").as_bytes()),
        // A failure of stderr cannot be reported anywhere.
        None => writeln!(io::stderr().lock(), "{text}").unwrap_or_default(),
    }
}

/// Prints an error, each line after the program's name.
pub fn error(text: &str) {
    for line in text.lines() {
        note(&format!("frhc: {}", printable(line)));
    }
}
