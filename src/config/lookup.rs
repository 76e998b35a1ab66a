//! Buses, node-ids and EDS files, which several sections name.

use std::path::Path;

use crate::problem::Problems;
use crate::value::Value;
use crate::{files, raw};
use canopen::NodeId;
use canopen::eds::Eds;
use canopen::frame::Channel;

/// Reads a node-id, 1 to 127.
pub(super) fn node_id(value: &Value<u8>, problems: &mut Problems<'_>) -> Option<NodeId> {
    let raw = value.get()?;
    let node = NodeId::new(raw).ok();
    if node.is_none() {
        problems.add(value, format_args!("must be a node-id within 1..=127, got {raw}"));
    }
    node
}

/// Returns the channel of the bus of this name.
pub(super) fn channel(
    value: &Value<String>,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<Channel> {
    let name = value.as_ref()?;
    let named = |bus: &raw::Bus| bus.name.as_ref() == Some(name);
    let found = (0..).map(Channel).zip(raw.bus.all()).find(|(_, bus)| named(bus));
    // A bus without a name may be the one.
    let is_unsure =
        raw.bus.is_noted() || raw.bus.all().iter().any(|bus| bus.name.as_ref().is_none());
    if found.is_none() && !is_unsure {
        problems.add(value, format_args!("no bus is called \"{}\"", name.escape_debug()));
    }
    found.map(|(channel, _)| channel)
}

/// Returns the EDS that `file` names.
pub(super) fn eds(value: &Value<String>, file: &Path, problems: &mut Problems<'_>) -> Option<Eds> {
    let path = files::beside(file, value.as_ref()?);
    let named = |reason: &dyn std::fmt::Display| format!("{}: {reason}", path.display());
    if let Some(known) = problems.sheets().get(&path) {
        let known = known.clone();
        return whole(value, known, problems);
    }
    let read = files::read_by(problems.trust(), &path).map_err(|error| named(&error));
    let bytes = problems.take(value, read)?;
    let eds = Eds::parse(&bytes).map_err(|error| named(&error));
    let eds = problems.take(value, eds)?;
    let gap = eds.gap().map(|gap| {
        named(&format_args!(
            "{gap}: the file is not whole; frhc check --eds says all that is missing"
        ))
    });
    problems.sheets().insert(path.clone(), (eds.clone(), gap.clone()));
    whole(value, (eds, gap), problems)
}

/// Returns the EDS; its incompleteness is a problem at the key that names it.
fn whole(
    value: &Value<String>,
    (eds, gap): (Eds, Option<String>),
    problems: &mut Problems<'_>,
) -> Option<Eds> {
    gap.into_iter().for_each(|gap| problems.add(value, gap));
    Some(eds)
}
