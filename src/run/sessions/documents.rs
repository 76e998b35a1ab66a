//! Reading of a session's JSON documents.

use std::io::{self, ErrorKind};
use std::path::Path;

use crate::session::SUMMARY;
use config::files;

/// Maximum size of a document of a session, in bytes.
const MAX_DOCUMENT: u64 = 4 << 20;

/// Returns a document of a session; `None` if it is absent.
pub(super) fn document(folder: &Path, name: &str) -> io::Result<Option<serde_json::Value>> {
    let read = files::open_unlinked(&folder.join(name));
    let read = read.and_then(|file| files::at_most(MAX_DOCUMENT, file));
    let named = |error: io::Error| io::Error::new(error.kind(), format!("{name}: {error}"));
    match read {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(named(error)),
        Ok(text) => serde_json::from_slice(&text).map(Some).map_err(|error| named(error.into())),
    }
}

/// Returns the summary of a session, and the number of parts that it states.
pub(super) fn summary(folder: &Path) -> io::Result<(Option<serde_json::Value>, Option<u32>)> {
    let summary = document(folder, SUMMARY)?;
    let stated = summary.as_ref().map(|summary| {
        let parts = summary.pointer("/recording/parts").and_then(serde_json::Value::as_u64);
        parts.and_then(|parts| u32::try_from(parts).ok()).unwrap_or(1)
    });
    Ok((summary, stated))
}
