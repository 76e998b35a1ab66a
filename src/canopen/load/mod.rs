//! Bus planning: load of each bus, response time of each frame, and alternatives to a plan that does not fit.
//!
//! Computed from the node plans ([`NodePlan`](crate::plan::NodePlan)) before any frame is sent.
//!
//! | file | content |
//! |---|---|
//! | [`pace`] | frequency of a frame: periodic, on change, sporadic |
//! | [`streams`](mod@streams) | planned frames of a bus, one stream per COB-ID |
//! | [`utilisation`] | bus load |
//! | [`response`] | worst-case response time of each frame (Davis et al. 2007) |
//! | [`timeline`] | schedule of a cycle |
//! | [`rates`] | maximum SYNC rate |
//! | [`network`] | all of the above for all buses |
//! | [`lacks`] | parts of a layout that a drive cannot have, by its EDS |
//! | [`abilities`] | changes that a drive's EDS permits |
//! | [`alternatives`] | variants of a network |
//! | [`proposals`] | variants worth proposing, each computed like the one in use |

pub mod abilities;
pub mod alternatives;
pub mod lacks;
pub mod network;
pub mod pace;
pub mod proposals;
pub mod rates;
pub mod response;
pub mod streams;
pub mod timeline;
pub mod utilisation;

pub use streams::streams;
pub use utilisation::{BusLoad, Overload};
