//! Fidelity at the hand: the force on the simulated hand, compared with K_T times the sensed force.
//!
//! | file            | part                                                          |
//! |-----------------|---------------------------------------------------------------|
//! | [`place`]       | places of the wall, and the posture of the arm there          |
//! | [`script`]      | free motion, approach, press, slide, release, by four hands   |
//! | [`hold`]        | still contact after each motion                               |
//! | [`release`]     | the force on a hand that withdraws                            |
//! | [`trial`]       | the arm of a run                                              |
//! | [`experiment`]  | conditions, and one run                                       |
//! | [`worst_cases`] | the worst of all seeds and hands                              |

pub mod experiment;
pub mod hold;
pub mod place;
pub mod release;
pub mod script;
pub mod trial;
pub mod worst_cases;
