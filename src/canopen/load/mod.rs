//! How full a bus is, how long every frame may take on it, and what would fit where this does not.
//!
//! Computed from what the nodes are to be told ([`NodePlan`](crate::plan::NodePlan)), before a
//! frame is sent. One idea a file:
//!
//! | file | what it says |
//! |---|---|
//! | [`pace`] | how often a frame comes: by the clock, on a change, by chance |
//! | [`streams`](mod@streams) | which frames are planned on a bus, one for each COB-ID |
//! | [`payload`] | how long they typically are, from the values they typically hold |
//! | [`utilisation`] | how much of the bus they take, and what is left |
//! | [`response`] | how long each may take from its queue to its end (Davis et al. 2007) |
//! | [`timeline`] | what happens when in a cycle, and how old a torque is when it acts |
//! | [`rates`] | the highest SYNC rate all this allows |
//! | [`network`] | all buses and all of the above for each |
//! | [`abilities`] | what the drives' data sheets permit |
//! | [`alternatives`] | the same network with something done differently |
//! | [`proposals`] | which of those to propose, each computed like the one in use |

pub mod abilities;
pub mod alternatives;
pub mod network;
pub mod pace;
pub mod payload;
pub mod proposals;
pub mod rates;
pub mod response;
pub mod streams;
pub mod timeline;
pub mod utilisation;

pub use streams::streams;
pub use utilisation::BusLoad;
pub use utilisation::Overload;
