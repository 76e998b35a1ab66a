//! Note on a request whose response takes long: a reset may boot the drives, a request for zeros may home them.

use std::time::Duration;

use crate::console::ConsoleCommand;

/// Time without a response after which the note is printed.
pub(super) const NOTE_AFTER: Duration = Duration::from_millis(500);

/// Returns what a request waits for, by the mode in the node's status; `None` without an answer.
pub(super) fn note(ask: ConsoleCommand, mode: Option<&str>, limit: Duration) -> String {
    let is_homing = matches!(ask, ConsoleCommand::Zero(_));
    let work = match mode {
        Some("boot") if is_homing => "the node homes drives".to_owned(),
        Some("boot") => "the node boots its drives again".to_owned(),
        Some(mode) => format!("the node has not answered, in mode {mode}"),
        None => "the node answers nothing".to_owned(),
    };
    format!("{ask}: {work}; waits for at most {} s", limit.as_secs())
}
