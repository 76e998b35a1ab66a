//! A running node on a screen. What is shown is read from the node's telemetry (docs/telemetry.md); nothing here can reach its console.
#![forbid(unsafe_code)]

pub mod command;
pub mod feed;
pub mod server;
pub mod top;
