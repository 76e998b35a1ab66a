//! What several sections name: buses, node-ids, EDS files.

use std::path::Path;

use crate::files;
use crate::problem::Problems;
use crate::raw;
use canopen::NodeId;
use canopen::eds::Eds;
use canopen::frame::Channel;

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
        problems.add(key, format_args!("no bus is called \"{}\"", name.escape_debug()));
    }
    found.map(|(channel, _)| channel)
}

/// The EDS called `name` in `file`.
pub(super) fn eds(key: &str, file: &Path, name: &str, problems: &mut Problems<'_>) -> Option<Eds> {
    let path = files::beside(file, name);
    let named = |reason: &dyn std::fmt::Display| format!("{}: {reason}", path.display());
    if let Some(known) = problems.sheets().get(&path) {
        let known = known.clone();
        return whole(key, known, problems);
    }
    let read = files::read_by(problems.trust(), &path).map_err(|error| named(&error));
    let bytes = problems.take(key, read)?;
    let eds = Eds::parse(&bytes).map_err(|error| named(&error));
    let eds = problems.take(key, eds)?;
    let gap = eds.gap().map(|gap| {
        named(&format_args!(
            "{gap}: the file is not whole; frhc check --eds says all that is missing"
        ))
    });
    problems.sheets().insert(path.clone(), (eds.clone(), gap.clone()));
    whole(key, (eds, gap), problems)
}

/// The EDS, and what it lost noted under `key`.
fn whole(key: &str, (eds, gap): (Eds, Option<String>), problems: &mut Problems<'_>) -> Option<Eds> {
    gap.into_iter().for_each(|gap| problems.add(key, gap));
    Some(eds)
}
