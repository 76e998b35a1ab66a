//! Fidelity at the hand, in the simulation's own truth: does the hand feel K_T times what is sensed?
//!
//! | file           | part                                                          |
//! |----------------|---------------------------------------------------------------|
//! | [`place`]      | places of the wall, and the posture of the arm there          |
//! | [`script`]     | free motion, approach, press, slide, release, by four hands   |
//! | [`hold`]       | still contact after each motion                               |
//! | [`release`]    | the force on a hand that withdraws                            |
//! | [`trial`]      | the arm of a run                                              |
//! | [`experiment`] | one run, and all of them                                      |
//! | [`pooled`]     | the worst of all seeds and hands                              |

pub mod experiment;
pub mod hold;
pub mod place;
pub mod pooled;
pub mod release;
pub mod script;
pub mod trial;
