//! Progress bar of long work on stderr, with the remaining time, if stderr is a terminal; and interruption by SIGINT or
//! SIGTERM.
//!
//! A separate thread draws the bar, so that work only counts and never waits for a terminal.
//!
//! ```no_run
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let is_quiet = false;
//! let progress = progress::Progress::start(60_000, "cycles", is_quiet)?;
//! for _ in 0..60_000 {
//!     progress.check()?; // "interrupted after 1234 of 60000 cycles", exit code 130
//!     progress.advance(1);
//! }
//! progress.finish();
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]

mod shown;
mod unit;

pub use shown::{Interruption, NoSignals, Progress};
pub use unit::Unit;
