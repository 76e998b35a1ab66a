//! Unix sockets: one that listens at a path, and the one peer of a link. Time is an argument; what waits says so.
#![forbid(unsafe_code)]

mod door;
mod listener;

pub use door::{Arrival, Door, Reception};
pub use listener::{SocketFile, listen, listen_for_messages};
