//! Display of a running node, in a browser or a terminal, from its telemetry (docs/telemetry.md). This room has no access to
//! the node's console.
//!
//! Begin with `feed.rs`, which reads the lines of one node after another. `server` passes them to browsers, slow ones miss
//! some; `assets` is the page in JavaScript without a library, whose `main.js` comes first; `top` is the terminal.
#![forbid(unsafe_code)]

pub mod command;
pub mod feed;
pub mod server;
pub mod top;
