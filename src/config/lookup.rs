//! What several sections name: buses, node-ids, EDS files.

use std::path::Path;

use crate::canopen::NodeId;
use crate::canopen::eds::Eds;
use crate::canopen::frame::Channel;
use crate::config::files;
use crate::config::problem::Problems;
use crate::config::raw;

/// A node-id, 1 to 127.
pub(super) fn node_id(key: &str, raw: u8, problems: &mut Problems<'_>) -> Option<NodeId> {
    let node = NodeId::new(raw).ok();
    if node.is_none() {
        problems.add(key, format_args!("{raw} is no node-id: 1 to 127"));
    }
    node
}

/// The channel of the bus called `name`.
pub(super) fn channel(
    key: &str,
    raw: &raw::File,
    name: &str,
    problems: &mut Problems<'_>,
) -> Option<Channel> {
    let found = (0..).map(Channel).zip(&raw.bus).find(|(_, bus)| bus.name == name);
    if found.is_none() {
        problems.add(key, format_args!("no bus is called \"{name}\""));
    }
    found.map(|(channel, _)| channel)
}

/// The EDS called `name` in `file`.
pub(super) fn eds(key: &str, file: &Path, name: &str, problems: &mut Problems<'_>) -> Option<Eds> {
    let path = files::beside(file, name);
    let read = files::read_by(problems.trust(), &path);
    let read = read.map_err(|error| format!("{}: {error}", path.display()));
    let bytes = problems.take(key, read)?;
    let parsed = Eds::parse(&bytes).map_err(|error| format!("{}: {error}", path.display()));
    problems.take(key, parsed)
}
