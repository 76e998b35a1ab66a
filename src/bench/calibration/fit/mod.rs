//! A torque curve from measurements (4.2, Fig. 6): odd least squares of 5th order over both driving directions
//! with the friction between them, how well it fits, and what speaks against it.
//!
//! Not where the measurements come from. Targets are fitted over torques, since that is how the curve
//! is used: the torque is wanted, the target is sought. The abscissa is scaled to its largest value, so
//! that its fifth power is of like size.
//!
//! | file           | content                                                          |
//! |----------------|------------------------------------------------------------------|
//! | `sample`       | one measurement                                                  |
//! | `calibrated`   | all of a joint's samples to its curve                            |
//! | `polynomial`   | a polynomial through samples                                     |
//! | `dry`          | a curve and the dry friction that shifts the directions apart    |
//! | `robust`       | readings that belong to no curve                                 |
//! | `uneven`       | an offset of the load cell, or sides of different strength       |
//! | [`doubt`]      | when a fitted curve is not accepted                              |
//! | [`sweep`]      | Coulomb and viscous friction from torques at constant velocities |
//! | [`posture`]    | gravity from held postures                                       |

mod calibrated;
pub mod doubt;
mod dry;
mod polynomial;
pub mod posture;
mod robust;
mod sample;
mod selection;
pub mod sweep;
mod uneven;

pub use crate::fit::calibrated::{Calibrated, DryFriction, NotCalibrated};
pub use crate::fit::polynomial::{Polynomial, Residuals, line, odd};
pub use crate::fit::sample::{Direction, Outlier, Sample};
pub use crate::fit::uneven::Unevenness;

#[cfg(test)]
mod tests;
