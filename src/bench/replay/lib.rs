//! Recorded sessions, replayed: the node of a session gets the same configuration and the same inputs again, without drives,
//! operator or robot, and must send the same frames.
//!
//! ```text
//!  inputs.bin ──► Source ──► ReplayedBus ──────► Node ──► frames, compared with the session's checksums
//!                       └──► ReplayedRemote ────►   └───► intermediates of the law, compared with its digests
//! ```
#![forbid(unsafe_code)]

mod bus_log;
mod fault_record;
mod outcome;
mod reader;
pub mod recorder_line;
mod replay;
mod replayed_bus;
mod replayed_remote;
mod session;
mod source;

pub use fault_record::{FaultRecord, FaultRecordError};
pub use outcome::{Difference, End, Outcome, Place};
pub use reader::{InputReader, ReadError};
pub use replay::Replay;
pub use session::{Session, SessionError};
