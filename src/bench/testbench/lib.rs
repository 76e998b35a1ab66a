//! Node and simulation put together, for `demo`, `sim`, campaigns, experiments and tests.
//!
//! Begin with [`mod@bench`]: node, drives and operator in one process. [`far_robot`] is the simulated arm as a far side,
//! [`explanation`] one cycle with every intermediate.
//!
//! ```
//! use std::path::Path;
//!
//! use config::Config;
//! use testbench::bench::Bench;
//! use sim::scenario::Scenario;
//!
//! let config = Config::load(Path::new("config/kraft_like_500hz.toml")).unwrap();
//! let mut bench = Bench::new(&config, Scenario::parse("seconds = 1.0").unwrap(), 1, ());
//! bench.bring_up().unwrap();
//! assert_eq!(bench.cycle().mode.to_string(), "ready");
//! ```
#![forbid(unsafe_code)]

pub mod bench;
pub mod comparison;
pub mod delayed;
mod delivery;
pub mod disturbed;
pub mod explanation;
pub mod far_robot;
pub mod linked_robot;
pub mod lost_zero;
pub mod question;
pub mod robot_explanation;
pub mod robot_site;
pub mod side;
mod simulated_joint;
pub mod station;
pub mod threads;
pub mod transmit_queue;
pub mod truth;
pub mod world;
