//! `frhc`: the CANopen master of a force-reflecting hand controller.
//!
//! Imports run down only; `tests/architecture.rs` checks it.
//!
//! ```text
//!  6   main · cli · lab                        anyhow and tokio's runtime live here
//!  5   node                                    one cycle, one mode: where everything meets
//!  4   config · bus · remote · telemetry       edges: files, frames, networks, records
//!  3   canopen     controller     robot   sim  pure machines
//!  2   spatial                                 wrench, twist, Jacobian: kinds with named parts
//!  1   time · written                          a number; TOML as people write it
//! ```
#![forbid(unsafe_code)]

pub mod bus;
pub mod canopen;
pub mod cli;
pub mod config;
pub mod controller;
pub mod lab;
pub mod node;
pub mod remote;
pub mod robot;
pub mod sim;
pub mod spatial;
pub mod telemetry;
pub mod time;
pub mod written;
