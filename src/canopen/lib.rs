//! CANopen (CiA 301) and the drive profile (CiA 402), as pure machines: frames and time in, frames out.
#![forbid(unsafe_code)]

pub mod abort;
pub mod bits;
pub mod concise;
pub mod data_type;
pub mod device;
pub mod dictionary;
pub mod drive;
pub mod eds;
pub mod emcy;
pub mod error_codes;
pub mod exchange;
pub mod frame;
pub mod guarding;
pub mod heartbeat;
pub mod layout;
pub mod listening;
pub mod load;
pub mod lss;
pub mod master;
pub mod nmt;
pub mod object;
pub mod pdo;
pub mod plan;
pub mod procedure;
pub mod sdo;
pub mod station;
pub mod sync;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
pub mod time_stamp;
pub mod value;
pub mod watchdog;

pub use canopen_rs::ByteString;
pub use canopen_rs::NmtCommand;
pub use canopen_rs::NmtState;
pub use canopen_rs::NodeId;
