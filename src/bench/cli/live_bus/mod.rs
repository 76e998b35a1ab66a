//! Short exchanges with nodes on a live bus, for the tools `scan`, `sdo`, `nmt` and `lss`.
//!
//! An exchange is a [`Procedure`](canopen_tools::procedure::Procedure); a [`Session`] runs it on any [`Bus`](bus::Bus), so
//! the tests need no SocketCAN. `-i` or a configuration selects the interface.

mod bus_args;
pub(super) mod node_arg;
pub mod objects;
pub(super) mod parsers;
pub mod session;

pub(super) use bus_args::{BusArgs, ForceArg, SelectedBus};
pub(super) use node_arg::NodeArg;

pub use session::{Session, SessionError};
