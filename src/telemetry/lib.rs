//! Telemetry outside the loop: records, summaries and fault records for people and files.
//!
//! ```
//! use telemetry::digits::significant;
//!
//! assert_eq!(significant(0.123_456, 3), 0.123);
//! ```
#![forbid(unsafe_code)]

pub mod contact;
pub mod contact_posture;
pub mod digits;
pub mod feed;
pub mod fidelity;
pub mod gripper_status;
pub mod hold_status;
pub mod link_report;
pub mod losses;
pub mod manifest;
pub mod origin;
pub mod parts;
pub mod recording;
pub mod recording_lock;
pub mod session;
pub mod shaking;
pub mod status;
pub mod summary;
pub mod timing;
pub mod token_bucket;
pub mod trial_status;
pub mod trip;
pub mod way_out;
