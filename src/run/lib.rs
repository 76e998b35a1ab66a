//! Commands of the rack (`run`, `commission`, `ctl`, `check`, `sessions`), with output, recordings and exit codes.
//!
//! | module | command |
//! |---|---|
//! | [`mod@run`] | `frhc run`: separate threads for the cycle, signals, console and each recording |
//! | [`ctl`] | `frhc ctl`: sends one request to a running node |
//! | [`check`] | `frhc check`: checks configuration, EDS files and gains; opens no bus |
//! | [`sessions`] | `frhc sessions`: lists recorded sessions, and packs them |
//! | [`commission`] | `frhc commission`: proof test of each drive's own stop when its master is lost |
//!
//! [`command::Command`] lists the commands, [`exit`] the exit codes.
//!
//! ```
//! use run::exit::{Failure, Kind};
//!
//! let failure = Failure::new(Kind::Configuration, "mine.toml:7: node.period_ms: must be within 1..=20, got 0");
//! assert!(failure.to_string().contains("mine.toml:7"));
//! ```
#![forbid(unsafe_code)]

mod adjustment_log;
mod batches;
pub mod check;
pub mod command;
pub mod commanded_side;
pub mod commission;
pub mod config_arg;
pub mod console;
pub mod ctl;
pub mod cycle_thread;
mod disk_writers;
pub mod exit;
pub mod fault_records;
pub mod feed_socket;
pub mod gains;
pub mod input_ring;
mod inputs_file;
pub mod interfaces;
pub mod interrupt;
pub mod latch;
mod latest_status;
pub mod limits;
mod log_file;
pub mod log_time;
mod message;
pub mod one_arena;
pub mod panics;
pub mod print;
pub mod provenance;
pub mod realtime_args;
mod record_sink;
mod recorder_thread;
mod recording_state;
pub mod results;
pub mod rings;
mod rows;
pub mod run;
pub mod run_recorder;
#[cfg(test)]
mod scratch;
pub mod session;
mod session_files;
pub mod sessions;
pub mod signal_flag;
mod socket_name;
pub mod sources;
mod state;
pub mod stderr;
pub mod stop_signals;
pub mod stopping;
mod threads;
pub mod viewer_args;
