//! Contract between a node and its far side, a robot in another process: messages, and the rules of acceptance of each
//! end.
//!
//! The crate has no I/O and no clock: bytes and times are arguments. docs/link.md has byte tables, states and test vectors.
//!
//! ```text
//!  node: [`NodeEnd`]                                                              robot: [`FarEnd`]
//!    Command, from the start on, held until the first arming ─────────────────────►  acts while its echo is fresh
//!    ◄──────────────────────────── Feedback with the echo of the newest Command ──   every cycle of the robot
//!    ◄───────────────────────────────────────────────────────────── Capability ──   where a Command asks for it
//! ```
//!
//! Each end draws a random session at its start and numbers its messages. Each message repeats the newest session and
//! number received from the other end: the *echo*. An end knows the send time of the echoed message, which bounds the age
//! of the received message on its own clock.
//!
//! Begin with `node_end.rs` and `far_end.rs`; `link_end.rs` has what both check, `codec.rs` the bytes.
//!
//! ```
//! use contract::{FarEnd, Measurements, Motion, NodeEnd, Order};
//! use std::time::Duration;
//! use units::time::Instant;
//!
//! let at = |ms: u64| Instant::from_micros(1_000 * ms);
//! let mut node = NodeEnd::new(0, 0x5eed);
//! let mut far = FarEnd::new(0, 0xface, Duration::from_millis(100));
//! // After each end has received from the other, echoes bound the age of messages.
//! let hold = Order { motion: Motion::Hold, is_engaged: false, gripper: None };
//! for ms in 1..3 {
//!     far.on_message(at(ms), &node.command(at(ms), &hold));
//!     node.on_message(at(ms), &far.feedback(at(ms), &Measurements::default()));
//! }
//! node.begin_epoch();
//! let rate = Order { motion: Motion::Rate([0.1; 6]), is_engaged: true, gripper: None };
//! far.on_message(at(3), &node.command(at(3), &rate));
//! assert_eq!(far.motion(at(3)), Motion::Rate([0.1; 6]));
//! assert_eq!(far.motion(at(200)), Motion::Hold, "its echo is too old");
//! ```
#![forbid(unsafe_code)]

mod capability;
mod codec;
mod codes;
mod command;
mod far_end;
mod feedback;
mod head;
mod link_end;
mod node_end;
mod peers;
mod pose;
mod reject;
mod round_trips;
mod sent;
#[cfg(test)]
mod tests;

pub use capability::{Capability, InvalidCapability, PayloadRemoval};
pub use command::{Command, Gripper, Motion};
pub use far_end::FarEnd;
pub use feedback::{FarState, Feedback, MAX_WRENCH, Measurements, Reason};
pub use head::{Echo, Head, VERSION};
pub use node_end::{NodeEnd, Order, Sample};
pub use pose::{MAX_DISTANCE, NORM_TOLERANCE, Pose};
pub use reject::{Reject, Rejects};
pub use round_trips::RoundTrips;
