//! Return to centre at the hand (Fig. 4, Eq. 8), in the simulation's own truth: force against displacement of one axis.
//!
//! | file        | part                                                                |
//! |-------------|---------------------------------------------------------------------|
//! | [`script`]  | slowly to both sides along one axis in rate mode, then lets go      |
//! | [`trial`]   | one run: samples on the way, and the way back when let go           |
//! | [`curve`]   | the samples over the displacement, on the way out and back          |
//! | [`figures`] | plateau, edge of the deadband, hysteresis, wall                     |

pub mod curve;
pub mod figures;
pub mod script;
pub mod trial;
