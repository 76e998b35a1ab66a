//! Contact over a link with delay: gains at which the hand rests on a wall, with and without the passivity layer.
//!
//! | file         | part                                                              |
//! |--------------|-------------------------------------------------------------------|
//! | [`link`]     | a link by its numbers; the largest gain that `frhc check` accepts |
//! | [`script`]   | the hand meets the wall, rests against it, and withdraws          |
//! | [`trial`]    | one run                                                           |
//! | [`measured`] | its figures, and what became of it                                |
//!
//! The way from command to wrench and back is the delay; grip, hand, drives and their cycle are those of every other run.

pub mod link;
pub mod measured;
pub mod script;
pub mod trial;
