//! Lookup of buses, node-ids and EDS files that several sections name.

use std::fmt;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;

use crate::files::Files;
use crate::problem::{Problems, Sheet};
use crate::value::Value;
use crate::{files, raw};
use canopen::NodeId;
use canopen::eds::{Eds, Severity};
use canopen::frame::Channel;

/// Reads a node-id, which must be within 1..=127 (CiA 301).
pub(super) fn node_id(value: &Value<u8>, problems: &mut Problems<'_>) -> Option<NodeId> {
    let raw = value.get()?;
    let node = NodeId::new(raw).ok();
    if node.is_none() {
        problems.add(value, format_args!("must be a node-id within 1..=127, got {raw}"));
    }
    node
}

/// Returns the channel of the bus with this name. Returns `None` after a problem.
pub(super) fn channel(
    value: &Value<String>,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<Channel> {
    let name = value.as_ref()?;
    let named = |bus: &raw::Bus| bus.name.as_ref() == Some(name);
    let found = (0..).map(Channel).zip(raw.bus.all()).find(|(_, bus)| named(bus));
    // A bus whose name is invalid may be meant.
    let is_unsure =
        raw.bus.is_noted() || raw.bus.all().iter().any(|bus| bus.name.as_ref().is_none());
    if found.is_none() && !is_unsure {
        problems.add(value, format_args!("no bus is called \"{}\"", name.escape_debug()));
    }
    found.map(|(channel, _)| channel)
}

/// Returns the EDS that `file` names. Each is read and checked once for all nodes.
pub(super) fn eds(
    value: &Value<String>,
    file: &Path,
    problems: &mut Problems<'_>,
) -> Option<Arc<Eds>> {
    let path = files::beside(file, value.as_ref()?);
    let known = problems.sheets().get(&path).cloned();
    let sheet = known.unwrap_or_else(|| read(problems.files(), &path));
    problems.sheets().insert(path, sheet.clone());
    match sheet {
        Ok(sheet) => Some(sheet.eds),
        Err(reason) => {
            problems.add_of_node(value, reason);
            None
        }
    }
}

/// Reads and lints an EDS file, or returns the reason why it cannot be used.
fn read(files: &Files, path: &Path) -> Result<Sheet, String> {
    let named = |reason: &dyn fmt::Display| format!("{}: {reason}", path.display());
    let bytes = files.read(path).map_err(|error| {
        let is_missing = error.kind() == ErrorKind::NotFound;
        let hint = "; a path starts at the folder of the configuration";
        named(&format_args!("{error}{}", if is_missing { hint } else { "" }))
    })?;
    let eds = Eds::parse(&bytes).map_err(|error| named(&error))?;
    if let Some(end) = eds.truncation() {
        let reason = "the file ends inside a section; frhc check --eds says all that is missing";
        return Err(format!("{}:{end}: {reason}", path.display()));
    }
    let lint = eds.lint();
    let errors = lint.iter().filter(|finding| finding.severity == Severity::Error).count();
    let gaps = lint.into_iter().filter(|finding| finding.gap.is_some()).collect();
    Ok(Sheet { eds: Arc::new(eds), errors, gaps })
}
