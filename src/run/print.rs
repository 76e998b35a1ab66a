//! The only place that prints: data on stdout, messages on stderr.
//!
//! Data that cannot be written fails the command: the first error is kept, nothing is written after it, and
//! [`finish`] returns it. A reader that hung up (`| head`) has seen enough, which is no failure.

use std::fs::File;
use std::io;
use std::io::ErrorKind;
use std::io::Write;
use std::os::fd::AsFd;
use std::sync::LazyLock;
use std::sync::OnceLock;

use crate::exit::Failure;
use crate::exit::Kind;
use crate::stderr;
use telemetry::digits;

/// Stdout without buffer. `std::io::stdout` takes a descriptor that is not open for writing for a sink.
static STDOUT: LazyLock<io::Result<File>> =
    LazyLock::new(|| io::stdout().as_fd().try_clone_to_owned().map(File::from));

/// The first failure to write data.
static FAILED: OnceLock<io::Error> = OnceLock::new();

/// Prints data.
pub fn line(text: &str) {
    if !is_over() {
        keep(data().and_then(|mut to| to.write_all(format!("{text}\n").as_bytes())));
    }
}

/// Stdout, for data that is written piece by piece; its outcome is to be [kept](keep).
///
/// # Errors
/// When the descriptor cannot be duplicated.
pub fn data() -> io::Result<&'static File> {
    STDOUT.as_ref().map_err(|error| error.kind().into())
}

/// Keeps the error of writing data, for [`finish`].
pub fn keep(written: io::Result<()>) {
    if let Err(error) = written {
        // Only the first one counts.
        FAILED.set(error).ok();
    }
}

/// Returns whether data can no longer be written: a command that only prints may end.
pub fn is_over() -> bool {
    FAILED.get().is_some()
}

/// Ends the output.
///
/// # Errors
/// When data is missing because it could not be written.
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
    match stderr::lines() {
        Some(lines) => lines.say(format!("{text}\n").as_bytes()),
        // Without stderr there is no place left to complain.
        None => writeln!(io::stderr().lock(), "{text}").unwrap_or_default(),
    }
}

/// Prints an error, each of its lines with the program's name. A number in it may be anything somebody typed.
pub fn error(text: &str) {
    for line in digits::shortened(text).lines() {
        note(&format!("frhc: {line}"));
    }
}
