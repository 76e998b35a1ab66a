//! Progress of a pass over a recorded session, in its cycles.

use std::fs;
use std::path::Path;

use progress::Progress;
use run::exit::{Failure, Kind, OrFail};

/// Starts a progress bar over the cycles of a session up to `last`. Their number is in the summary, which is absent after a
/// crash.
pub(super) fn start(
    session: &Path,
    last: Option<u64>,
    is_quiet: bool,
) -> Result<Progress, Failure> {
    let summary = fs::read(session.join("summary.json")).unwrap_or_default();
    let summary: Option<serde_json::Value> = serde_json::from_slice(&summary).ok();
    let recorded = summary.and_then(|summary| summary.get("cycles")?.as_u64());
    let total = recorded.map(|cycles| cycles.min(last.unwrap_or(cycles)));
    Progress::start(total, "cycles", is_quiet).or_fail(Kind::System)
}
