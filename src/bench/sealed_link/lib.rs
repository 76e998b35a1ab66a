//! Link to a commanded side elsewhere: authenticated datagrams that are fresh or have no effect.
//!
//! No I/O and no clock. Bytes that are not authentic change only a counter of [`reject::Rejects`]; authentic but stale
//! content takes no effect.
//!
//! ```text
//!  node                                                        robot
//!   [`initiator`] ── initiation ─────────────────────────────► [`responder`]
//!                 ◄─ cookie: proof of the address required ──
//!                 ── initiation, with the cookie ─────────────►
//!                 ◄──────────────────────────────── response ──
//!                 ── command ─────────────────────────────────►  the session starts
//!                 ◄───────────────────────────────── sample ──
//! ```
//!
//! The handshake is Noise_IK_25519_ChaChaPoly_BLAKE2s: each side knows the other's static key and accepts no other.
//! Each [`session`] has keys of its own, so a recording is useless in the next; a node starts one at each arming.
//!
//! ```
//! use sealed_link::window::Window;
//!
//! let mut window = Window::default();
//! assert!(window.check(7).is_ok());
//! window.take(7);
//! assert!(window.check(7).is_err(), "a replay");
//! assert!(window.check(6).is_ok(), "late, but new");
//! ```
#![forbid(unsafe_code)]

pub mod cookie;
pub mod datagram;
pub mod freshness;
pub mod handshake;
pub mod initiator;
pub mod reject;
pub mod responder;
pub mod session;
pub mod window;

#[cfg(test)]
mod tests;
