//! Sections of a report, in their order.

pub(crate) mod boot;
pub(crate) mod bus;
pub(crate) mod fault_frames;
pub(crate) mod grip;
pub(crate) mod joints;
pub(crate) mod parts;
pub(crate) mod summary;
pub(crate) mod timing;
pub(crate) mod verdict;
