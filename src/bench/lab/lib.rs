//! Node and simulation put together, for `demo`, `sim`, campaigns and tests.
//!
//! ```
//! use std::path::Path;
//!
//! use config::Config;
//! use lab::bench::Bench;
//! use sim::scenario::Scenario;
//!
//! let config = Config::load(Path::new("config/kraft_like_500hz.toml")).unwrap();
//! let mut bench = Bench::new(&config, Scenario::parse("seconds = 1.0").unwrap(), 1, false, ());
//! bench.bring_up().unwrap();
//! assert_eq!(bench.cycle().mode.to_string(), "ready");
//! ```
#![forbid(unsafe_code)]

pub mod bench;
pub mod campaign;
pub mod comparison;
pub mod contact_bounds;
pub mod delay;
mod delivery;
mod displacement;
pub mod dual_peg;
pub mod explanation;
pub mod fidelity;
pub mod ntrfc;
pub mod question;
pub mod return_to_centre;
pub mod robot_explanation;
pub mod robot_site;
pub mod side;
mod simulated_joint;
pub mod station;
pub mod torque_curves;
pub mod transmit_queue;
pub mod world;
