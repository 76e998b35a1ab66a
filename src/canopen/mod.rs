//! CANopen (CiA 301) and the drive profile (CiA 402), as pure machines: frames and time in, frames out.

pub mod abort;
pub mod bits;
pub mod commission;
pub mod dbc;
pub mod decode;
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
pub mod master;
pub mod nmt;
pub mod object;
pub mod pdo;
pub mod plan;
#[cfg(test)]
mod scripted;
pub mod sdo;
pub mod signals;
pub mod station;
pub mod sync;
pub mod words;

pub use canopen_rs::NmtState;
pub use canopen_rs::NodeId;
