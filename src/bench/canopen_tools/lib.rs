//! CANopen tools: decoding of traffic, files for other programs, and diagnostic procedures.
//!
//! Decoder and DBC share the description of the signals ([`signals`]), made from the plans of the nodes
//! ([`members`]).
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

pub mod bus_figures;
pub mod candump;
pub mod concise;
pub mod dbc;
pub mod dcf;
pub mod decode;
pub mod diagnostics;
pub mod fixed;
pub mod lss;
pub mod members;
pub mod object_text;
pub mod procedure;
pub mod screen;
pub mod sheet;
pub mod signals;
pub mod value;
