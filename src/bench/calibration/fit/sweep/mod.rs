//! Coulomb and viscous friction of a joint from a slow sweep: torques at constant velocities in both directions.
//!
//! Gravity is subtracted from the torques before the fit, or constant:
//!
//! ```text
//!  torque = load + s coulomb + viscous velocity      s: +1 where the joint moves up, -1 where it moves down
//! ```
//!
//! `load` is the remaining constant torque. At speeds below those of a sweep friction may fall with speed (Stribeck effect;
//! Armstrong-Hélouvry, Dupont and Canudas de Wit 1994). This law does not describe that, so falling friction is refused.

mod doubt;
mod law;

pub use crate::fit::sweep::doubt::FrictionDoubt;
pub use crate::fit::sweep::law::{Estimate, JointFriction, Law, Moving, NoFriction};

#[cfg(test)]
mod tests;
