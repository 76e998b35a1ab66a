//! CANopen (CiA 301) and the drive profile (CiA 402), as pure machines: frames and time in, frames out.

pub mod abort;
pub mod bits;
pub mod boot_error;
pub mod check;
pub mod commission;
pub mod configuration;
pub mod device;
pub mod dictionary;
pub mod drive;
pub mod duplicate;
pub mod eds;
pub mod emcy;
pub mod error_codes;
pub mod error_history;
pub mod event;
pub mod frame;
pub mod guarding;
pub mod heartbeat;
mod ini;
pub mod layout;
pub mod load;
pub mod master;
pub mod nmt;
pub mod object;
pub mod pdo;
pub mod plan;
#[cfg(test)]
mod scripted;
pub mod sdo;
mod slave;
pub mod station;
pub mod steps;
mod strangers;
pub mod sync;

pub use canopen_rs::ByteString;
pub use canopen_rs::NmtState;
pub use canopen_rs::NodeId;
