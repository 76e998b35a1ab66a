//! Head of each line.

use serde::Serialize;

/// Version of the lines.
const VERSION: u64 = 1;

/// Head of each line.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Head {
    version: u64,
    kind: &'static str,
}

impl Head {
    pub(super) const fn new(kind: &'static str) -> Self {
        Self { version: VERSION, kind }
    }
}
