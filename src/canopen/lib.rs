//! CANopen (CiA 301) and the drive profile (CiA 402) as state machines without I/O: frames and time in, frames out.
//!
//! A state machine has three methods: `on_frame` takes a received frame, `on_time` handles expired timers, `deadline`
//! returns the time of the next timer. Frames to send are appended to a list. The caller waits, and owns clock and socket.
//! `examples/boot_one_drive.rs` boots a drive with the [`master`].
//!
//! | begin with | for |
//! |---|---|
//! | [`plan`], [`layout`] | what a node is configured with, from its [`eds`] |
//! | `master/steps.rs` | the boot of a node as data, with its picture; [`master`] runs it |
//! | [`exchange`], [`drive`] | the cycle: which bits of which frame are whose, resolved once from all layouts |
//! | [`sdo`] | one transfer |
//! | [`load`] | bits, response times and timeline of a bus |
//!
//! ```
//! use std::time::Duration;
//!
//! use canopen::NodeId;
//! use canopen::frame::Frame;
//! use canopen::object::Object;
//! use canopen::sdo::Transfer;
//! use units::time::Instant;
//!
//! // Reads the statusword (6041h) of node 3 by SDO.
//! let (now, mut out) = (Instant::ZERO, Vec::new());
//! let node = NodeId::new(3).unwrap();
//! let mut read = Transfer::read(node, Object { index: 0x6041, sub: 0 }, Duration::from_millis(50), now, &mut out);
//! assert_eq!(out, [Frame::new(0x603, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0])]);
//!
//! let reply = Frame::new(0x583, [0x4B, 0x41, 0x60, 0, 0x37, 0x12, 0, 0]);
//! assert!(read.on_frame(now, &reply, &mut out).is_some());
//! ```
#![forbid(unsafe_code)]

pub mod abort;
pub mod bits;
pub mod data_type;
pub mod drive;
pub mod eds;
pub mod emcy;
pub mod error_codes;
pub mod exchange;
pub mod fact;
pub mod frame;
pub mod guarding;
pub mod heartbeat;
pub mod layout;
pub mod listening;
pub mod load;
pub mod master;
pub mod nameplate;
pub mod nmt;
pub mod object;
pub mod pdo;
pub mod plan;
pub mod sdo;
pub mod setting;
pub mod sync;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
pub mod time_stamp;
mod used;
pub mod watchdog;

pub use canopen_rs::{ByteString, NmtCommand, NmtState, NodeId, Value};
