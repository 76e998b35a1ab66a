//! `frhc`: the CANopen master of a force-reflecting hand controller.
//!
//! The program's parts are crates, the folders of `src/`. Here they become one program: the commands of the rack
//! ([`run`]), and those that a rack does without (`cli`, the feature `simulation`).
#![forbid(unsafe_code)]

mod program;

pub use program::main;
