//! Recorded session as an MCAP file: ROS 2 messages in CDR for what has a ROS type, JSON with schemas for the rest.
//!
//! ```text
//!  signals::Cycle ──► exporter ──► frames, diagnostics, json ──► messages ──► cdr ──► writer ──► container ──► one stream
//!       pace ────────────┤                                                          └ chunk (LZ4), record
//!                        └ metadata (session, SHA-256, findings), attachments (configuration)
//! ```
//!
//! docs/sessions.md has the table of topics. The records are written here, as mcap's own crate compresses with C libraries only.
#![forbid(unsafe_code)]

mod cdr;
mod chunk;
mod container;
mod definitions;
mod diagnostics;
mod exporter;
mod frames;
mod json;
mod messages;
mod pace;
mod record;
mod topics;
mod writer;

pub use exporter::{Choice, Content, ExportSummary, Extent, export};
pub use pace::Pace;

use thiserror::Error;

use ::replay::SessionError;

/// Reason why a session cannot be exported.
#[derive(Debug, Error)]
pub enum ExportError {
    /// Session that cannot be read.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// File that cannot be written.
    #[error(transparent)]
    Write(#[from] std::io::Error),
    /// Message that cannot be encoded in CDR.
    #[error("a message cannot be encoded: {0}")]
    Cdr(#[from] cdr_encoding::Error),
    /// Message that cannot be encoded in JSON.
    #[error("a message cannot be encoded: {0}")]
    Json(#[from] serde_json::Error),
}
