//! The link to a commanded side elsewhere: authenticated datagrams that are fresh or have no effect.
//!
//! Nothing here sends, receives or reads a clock. Bytes that are not authentic change nothing but a counter
//! of [`reject::Rejects`]; what is authentic and late changes nothing that acts.
//!
//! ```text
//!  node                                                        robot
//!   [`initiator`] ── initiation ─────────────────────────────► [`responder`]
//!                 ◄─ cookie: show that you are at that address ──
//!                 ── initiation, with the cookie ─────────────►
//!                 ◄──────────────────────────────── response ──
//!                 ── command ─────────────────────────────────►  the session is taken up
//!                 ◄───────────────────────────────── sample ──
//! ```
//!
//! The handshake is Noise_IK_25519_ChaChaPoly_BLAKE2s: each side knows the other's static key beforehand
//! and accepts no other. A [`session`] has keys of its own, so what was recorded in one says nothing in the
//! next; a node begins one at each arming.
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
