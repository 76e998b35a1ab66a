//! Force/torque sensor with its own network address: ATI's Net F/T, which sends its records by RDT over UDP.
//!
//! ```text
//!  cycle ── now ──► socket: reads until empty ──► reader: the newest record wins ──► reading: number, wrench
//!                      ▲                             │
//!                      └──── request to stream ◄─────┘   at the start, and again while it is silent
//! ```
//!
//! [`reader`] and [`rdt`] perform no I/O and read no clock: times are arguments. Only [`socket`] performs I/O; it never waits.
//! docs/net-ft.md defines the rules.
#![forbid(unsafe_code)]

pub mod rdt;
pub mod reader;
pub mod scale;
pub mod socket;
