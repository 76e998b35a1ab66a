//! Recorded session as a sequence of cycles, and the named signals of a cycle.
//!
//! ```text
//!  bus.log ────► WireCycles ──┐ positions, targets, wrench, mode, load
//!                             ├──► Cycles ──► Cycle ──► Signal (name, unit, frame) ──► value
//!  inputs.bin ─► Replay ──────┘ every intermediate of the law, while the replay sends the same frames
//! ```
#![forbid(unsafe_code)]

mod catalogue;
mod cycles;
mod envelope;
mod reading;
mod signal;
mod wire;

pub use catalogue::{catalogue, placeholders};
pub use cycles::{Cycle, Cycles, Findings, Recording, ReplayVerdict};
pub use envelope::{Bucket, Envelope, Span};
pub use signal::{Signal, Source, UnknownSignal, chosen};
pub use wire::{Ending, Wire, WireCycles};
