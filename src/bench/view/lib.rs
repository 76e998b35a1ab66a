//! Display of a running node, in a browser or a terminal, from its telemetry (docs/telemetry.md). This room has no access to
//! the node's console.
#![forbid(unsafe_code)]

pub mod command;
pub mod feed;
pub mod server;
pub mod top;
