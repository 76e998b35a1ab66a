//! The programs of the rack: `run`, `commission`, `ctl`, `check`, and what they print, record and keep.
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
mod latch;
mod log_file;
pub mod orders;
pub mod panics;
pub mod print;
pub mod provenance;
mod recorder;
pub mod results;
mod rings;
pub mod run;
pub mod session;
pub mod signals;
mod state;
pub mod stderr;
pub mod time_line;
