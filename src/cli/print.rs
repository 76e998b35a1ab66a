//! The only place that prints: data on stdout, messages on stderr. A reader that hung up is no
//! failure of ours.

use std::io::Write;

use crate::cli::stderr;

/// Data.
pub(super) fn line(text: &str) {
    write(std::io::stdout().lock(), text);
}

/// A message.
pub(super) fn note(text: &str) {
    match stderr::lines() {
        Some(lines) => lines.say(format!("{text}\n").as_bytes()),
        None => write(std::io::stderr().lock(), text),
    }
}

/// What went wrong, one line each.
pub(super) fn error(text: &str) {
    for line in text.lines() {
        note(&format!("frhc: {line}"));
    }
}

fn write(mut to: impl Write, text: &str) {
    writeln!(to, "{text}").ok();
}
