//! Fidelity at the hand, in the simulation's own truth: does the hand feel K_T times what is sensed?
//!
//! | file           | part                                                          |
//! |----------------|---------------------------------------------------------------|
//! | [`truth`]      | what the hand really feels, and its parts                     |
//! | [`script`]     | free motion, approach, press, slide, release, by four hands   |
//! | [`release`]    | the braking force of the passivity layer after a release      |
//! | [`trial`]      | one run of the script                                         |
//! | [`experiment`] | all runs, and the pooled figures                              |

pub mod experiment;
pub mod release;
pub mod script;
pub mod trial;
pub mod truth;
