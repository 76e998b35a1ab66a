//! Experiments on the simulation: their runs, and `frhc-lab experiment`, which tabulates and draws them; and `frhc-lab peg`.
#![forbid(unsafe_code)]

pub mod command;
pub mod contact_bounds;
pub mod delay;
mod displacement;
pub mod dual_peg;
pub mod fidelity;
pub mod no_trial;
pub mod ntrfc;
mod opening;
pub mod peg_rig;
mod pool;
pub mod return_to_centre;
pub mod torque_curves;
