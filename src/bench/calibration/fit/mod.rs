//! Torque curve from measurements (4.2, Fig. 6): odd least squares of 5th order over both driving directions with the
//! friction between them, its quality, and doubts about it.
//!
//! Targets are fitted over torques, since the controller looks up the target of a torque. The abscissa is scaled to its
//! largest value, which keeps its fifth power at a similar size. The files of the measurements are read elsewhere.
//!
//! | file           | content                                                          |
//! |----------------|------------------------------------------------------------------|
//! | `sample`       | one measurement                                                  |
//! | `curve_fit`    | the fit of all samples of a joint                                |
//! | `polynomial`   | a polynomial through samples                                     |
//! | `dry`          | a curve with the dry friction between the directions             |
//! | `robust`       | outliers among readings                                          |
//! | `uneven`       | an offset of the load cell, or sides of different strength       |
//! | [`doubt`]      | reasons not to accept a fitted curve                             |
//! | [`sweep`]      | Coulomb and viscous friction from torques at constant velocities |
//! | [`posture`]    | gravity from held postures                                       |

mod curve_fit;
pub mod doubt;
mod dry;
mod polynomial;
pub mod posture;
mod robust;
mod sample;
mod selection;
pub mod sweep;
mod uneven;

pub use crate::fit::curve_fit::{CurveFit, DryFriction, NoTorqueCurve};
pub use crate::fit::polynomial::{Polynomial, Residuals, line, odd};
pub use crate::fit::sample::{Direction, Outlier, Sample};
pub use crate::fit::uneven::Unevenness;

#[cfg(test)]
mod tests;
