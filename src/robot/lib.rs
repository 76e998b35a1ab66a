//! The commanded side: what a robot or a virtual object does with a command (Williams 1997, 3.2 and
//! 4.3).
//!
//! Not the world it touches: contact wrenches come in. Nothing here knows the hand controller.
#![forbid(unsafe_code)]

pub mod accommodation;
pub mod object;
pub mod payload;
