//! Inputs of a node, recorded in call order.
//!
//! A [`Node`](node::Node) computes from four things only: its configuration, the calls of its owner, the answers of its
//! buses, and the answers of its commanded side. Wrappers record the last three where they enter. So a recorded session
//! can be replayed without drives: the same node, given the same answers, sends the same frames.
//!
//! ```text
//!  owner's calls ──► RecordedNode ──► Node ──► RecordedBus ──► Bus
//!                        │              └────► RecordedRemote ──► Remote
//!                        └── InputSink ◄──── every answer, in call order
//! ```
//!
//! Sent frames are not inputs: they are what a replay has to find again. Their checksum is recorded with each call, so that
//! a replay says in which call they differ first; [`intermediates`] says which quantity of the control law did.
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
