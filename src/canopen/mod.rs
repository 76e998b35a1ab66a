//! CANopen (CiA 301) and the drive profile (CiA 402), as pure machines: frames and time in, frames out.

pub mod abort;
pub mod bits;
pub mod commission;
pub mod device;
pub mod dictionary;
pub mod drive;
pub mod eds;
pub mod emcy;
pub mod frame;
pub mod heartbeat;
mod ini;
pub mod layout;
pub mod load;
pub mod lss;
pub mod master;
pub mod nmt;
pub mod object;
pub mod pdo;
pub mod plan;
pub mod procedure;
#[cfg(test)]
mod scripted;
pub mod sdo;
pub mod station;
pub mod sync;
pub mod time_stamp;

pub use canopen_rs::NmtState;
pub use canopen_rs::NodeId;
