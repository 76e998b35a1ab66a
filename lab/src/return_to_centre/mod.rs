//! Return to centre at the simulated hand (Fig. 4, Eq. 8): force over displacement of one axis.
//!
//! | file        | part                                                                |
//! |-------------|---------------------------------------------------------------------|
//! | [`script`]  | slow motion to both sides along one axis in rate mode, then release |
//! | [`trial`]   | one run: samples of the motion, and the return after the release    |
//! | [`curve`]   | the samples over the displacement, outwards and back                |
//! | [`figures`] | plateau, edge of the deadband, hysteresis, wall                     |

pub mod curve;
pub mod figures;
pub mod script;
pub mod trial;
