//! Recorded session as an MCAP file: ROS 2 messages in CDR for what has a ROS type, JSON with schemas for the rest.
//!
//! ```text
//!  signals::Cycle ──► exporter ──► frames, diagnostics, json ──► messages ──► cdr ──► writer ──► one stream
//!                        └ metadata (session, SHA-256, findings), attachments (configuration)
//! ```
//!
//! docs/sessions.md has the table of topics. Chunks are not compressed: both compressions of MCAP would need a C library.
#![forbid(unsafe_code)]

mod cdr;
mod definitions;
mod diagnostics;
mod exporter;
mod frames;
mod json;
mod messages;
mod topics;
mod writer;

pub use exporter::{Choice, Content, ExportSummary, export};

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
    Write(std::io::Error),
    /// Record that the container refuses.
    #[error("a record cannot be written: {0}")]
    Record(mcap::McapError),
    /// Message that cannot be encoded in CDR.
    #[error("a message cannot be encoded: {0}")]
    Cdr(#[from] cdr_encoding::Error),
    /// Message that cannot be encoded in JSON.
    #[error("a message cannot be encoded: {0}")]
    Json(#[from] serde_json::Error),
}

impl From<mcap::McapError> for ExportError {
    fn from(error: mcap::McapError) -> Self {
        if let mcap::McapError::Io(error) = error {
            return Self::Write(error);
        }
        Self::Record(error)
    }
}
