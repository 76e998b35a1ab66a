//! Inputs of a node, recorded in call order.
//!
//! A [`Node`](node::Node) depends on four inputs only: its configuration, the calls of its owner, and the answers of
//! its buses and of its commanded side. Wrappers record the last three where they enter. A recorded session can be
//! replayed without drives: with the same answers the same node sends the same frames.
//!
//! ```text
//!  owner's calls ──► RecordedNode ──► Node ──► RecordedBus ──► Bus
//!                        │              └────► RecordedRemote ──► Remote
//!                        └── InputSink ◄──── every answer, in call order
//! ```
//!
//! Sent frames are not inputs, but a replay must reproduce them. Their checksum is recorded with each call, so that a
//! replay names the first call in which they differ. [`intermediates`] names the first quantity of the control law.
#![forbid(unsafe_code)]

mod checksum;
mod input;
pub mod intermediates;
mod recorded_bus;
mod recorded_node;
mod recorded_remote;
pub mod table;
mod writer;

pub use checksum::Checksum;
pub use input::{Call, Input, InputSink};
pub use recorded_bus::RecordedBus;
pub use recorded_node::RecordedNode;
pub use recorded_remote::RecordedRemote;
pub use writer::{HAS_GRIPPER, InputWriter, Last, NUMBERS};
