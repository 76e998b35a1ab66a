//! Coulomb and viscous friction of a joint from a slow sweep: torques at constant velocities, both ways.
//!
//! Not where the torques come from. Gravity has been taken off, or is the same everywhere:
//!
//! ```text
//!  torque = load + s coulomb + viscous velocity      s: +1 where the joint moves up, -1 where it moves down
//! ```
//!
//! `load` is what gravity leaves. Below the speeds of a sweep friction may fall with speed (Stribeck); this law does
//! not describe that (Armstrong-Hélouvry, Dupont and Canudas de Wit 1994), so falling friction is refused.

mod doubt;
mod law;

pub use crate::fit::sweep::doubt::FrictionDoubt;
pub use crate::fit::sweep::law::{Estimate, JointFriction, Law, Moving, NoFriction};

#[cfg(test)]
mod tests;
