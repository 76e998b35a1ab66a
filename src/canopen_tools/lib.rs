//! CANopen for people: frames in words, files for other programs, and what a bench asks of a network.
#![forbid(unsafe_code)]

pub mod bench;
pub mod dbc;
pub mod dcf;
pub mod decode;
pub mod members;
pub mod signals;
pub mod words;
