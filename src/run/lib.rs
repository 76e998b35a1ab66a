//! The programs of the rack: `run`, `commission`, `ctl`, `check`, and what they print, record and keep.
//!
//! | module | command |
//! |---|---|
//! | [`mod@run`] | `frhc run`: a thread for the cycle, one for signals, one for the console, one for each disk |
//! | [`ctl`] | `frhc ctl`: one question to a running node |
//! | [`check`] | `frhc check`: configuration, data sheets, gains; touches no bus |
//! | [`commission`] | `frhc commission`: every drive shows that it stops by itself |
//!
//! [`command::Command`] has them all; [`exit`] the exit codes.
//!
//! ```
//! use run::exit::{Failure, Kind};
//!
//! let failure = Failure::new(Kind::Configuration, "mine.toml:7: node.period_ms: must be within 1..=20, got 0");
//! assert!(failure.to_string().contains("mine.toml:7"));
//! ```
#![forbid(unsafe_code)]

mod archive;
pub mod check;
pub mod command;
pub mod commission;
pub mod configured;
mod console;
pub mod ctl;
pub mod exit;
pub mod fault_records;
pub mod faults;
pub mod gains;
pub mod interfaces;
pub mod keeper;
mod kept;
mod latch;
mod log_file;
pub mod orders;
pub mod panics;
pub mod print;
pub mod provenance;
mod recorder;
pub mod results;
pub mod rings;
pub mod run;
#[cfg(test)]
mod scratch;
pub mod session;
pub mod signals;
mod state;
pub mod stderr;
pub mod time_line;
