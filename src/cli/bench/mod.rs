//! Tools for the bench: short talks with nodes on a live bus.
//!
//! What is said is a [`Procedure`](canopen::procedure::Procedure); a [`Session`] carries it to its
//! end on any [`Bus`](bus::Bus), so the tests run the tools without SocketCAN. Which interface it
//! is, `-i` or a configuration says.

mod interrupt;
mod line;
pub mod objects;
pub mod session;
pub(super) mod words;

pub(super) use line::Beside;
pub(super) use line::Known;
pub(super) use line::Line;

pub use session::Session;
pub use session::SessionError;
