//! Recorded sessions, replayed. The node of a session gets the same configuration and inputs again, without drives,
//! operator or robot, and must send the same frames.
//!
//! ```text
//!  inputs.bin ──► Source ──► ReplayedBus ──────► Node ──► frames, compared with the session's checksums
//!                       └──► ReplayedRemote ────►   └───► intermediates of the law, compared with its digests
//! ```
#![forbid(unsafe_code)]

mod bounded_lines;
mod bus_log;
mod bus_log_parts;
mod fault_record;
mod input_parts;
mod outcome;
mod part_file;
mod reader;
pub mod recorder_line;
mod replay;
mod replayed_bus;
mod replayed_remote;
mod session;
mod source;

pub use bounded_lines::{BoundedLines, MAX_LINE};
pub use bus_log_parts::BusLog;
pub use fault_record::{FaultRecord, FaultRecordError};
pub use input_parts::{InputParts, PartError, PartErrorKind};
pub use outcome::{Difference, End, Outcome, Place};
pub use part_file::PartFile;
pub use reader::{InputReader, ReadError};
pub use replay::Replay;
pub use session::{Session, SessionError};
