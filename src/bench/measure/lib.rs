//! Measurements that find the facts of an arm: `frhc measure`.
//!
//! `command` is the command line. `sign` judges what the trials of a drive have led to, which the node makes while a person holds the
//! deadman. `direction` asks a person for motions and judges them, from positions alone; `feed` reads these from a running node.
//! `words` are what the person reads. `measured` is the file beside the configuration, with what has been
//! measured.
#![forbid(unsafe_code)]

pub mod command;
pub mod direction;
mod feed;
pub mod measured;
pub mod sign;
mod words;
