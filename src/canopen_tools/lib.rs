//! CANopen for people: frames in words, files for other programs, and what a bench asks of a network.
//!
//! The decoder and the DBC share one description of the signals ([`signals`]), made from the plans of the nodes ([`members`]).
//!
//! ```
//! use canopen_tools::decode::Decoder;
//!
//! let mut decoder = Decoder::generic();
//! let bus = decoder.listen(None);
//! let heartbeat = decoder.on_frame(bus, None, 0x703, &[0x05]);
//! assert!(heartbeat.to_string().contains("operational"));
//! ```
#![forbid(unsafe_code)]

pub mod bench;
pub mod dbc;
pub mod dcf;
pub mod decode;
pub mod members;
pub mod signals;
pub mod words;
