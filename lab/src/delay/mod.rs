//! Contact over a link with delay: gains at which the hand rests on a wall, with and without the passivity layer.
//!
//! | file            | part                                                              |
//! |-----------------|-------------------------------------------------------------------|
//! | [`link`]        | delay, jitter, loss; the largest gain that `frhc check` accepts   |
//! | [`script`]      | the hand meets the wall, rests against it, and withdraws          |
//! | [`trial`]       | one run                                                           |
//! | [`measurement`] | its figures and outcome                                           |
//!
//! Only the path from command to wrench is delayed; grip, hand, drives and their cycle are those of every other run.

pub mod link;
pub mod measurement;
pub mod script;
pub mod trial;
