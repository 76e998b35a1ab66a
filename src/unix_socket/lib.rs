//! Unix sockets: one that listens at a path, the one peer of a link, and readers of a stream. Time is an argument; what waits says so.
#![forbid(unsafe_code)]

mod audience;
mod door;
mod listener;

pub use audience::{Audience, MAX_READERS};
pub use door::{Arrival, Door, Reception};
pub use listener::{SocketFile, listen, listen_for_messages};
