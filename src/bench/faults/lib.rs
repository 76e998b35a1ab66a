//! Vocabulary of the faults of scenarios, campaigns and tests: target, kind, start and duration.
//!
//! `sim` applies faults of devices and their frames, `memory_bus` those of buses and host, and `testbench` forces reported by
//! the commanded side.
//!
//! ```
//! use std::time::Duration;
//!
//! use faults::{DeviceFault, Fault, FaultKind, Target};
//! use units::numbering::Joint;
//!
//! let target = Target::Joint(Joint::of::<3>());
//! let fault = Fault::new(Duration::from_secs(1), target, FaultKind::Device(DeviceFault::SafeTorqueOff));
//! assert_eq!(fault.to_string(), "joint 3: safe torque off");
//! ```
#![forbid(unsafe_code)]

mod device;
mod frames;
mod host;

pub use device::{ContactFault, DeviceFault, Disconnection, Input, SensorFault};
pub use frames::{Effect, Extent, FrameFault, Selection, Service};
pub use host::{Disturbance, HostFault, LinkFault};

use std::fmt;
use std::time::Duration;

use derive_more::Display;

use canopen::frame::{Channel, Frame};
use units::numbering::Joint;

/// Fault: target, kind, start and duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// Time after the first SYNC.
    pub start: Duration,
    /// Duration; `None` for one that is momentary or never ends.
    pub duration: Option<Duration>,
    /// Part of the system that has it.
    pub target: Target,
    /// Defect or disturbance of the target.
    pub kind: FaultKind,
}

/// Part of the system that has a fault.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Target {
    /// Drive of one joint.
    #[display("joint {_0}")]
    Joint(Joint),
    /// All six drives.
    #[display("every drive")]
    Drives,
    /// CiA 401 device with deadman and buttons.
    #[display("switch box")]
    SwitchBox,
    /// One bus, with the host's adapter to it.
    #[display("bus {}", _0.0)]
    Bus(Channel),
    /// Commanded side, or the link to it.
    #[display("link")]
    Link,
    /// Host: the node's process and the clocks.
    #[display("host")]
    Host,
}

/// Where a fault acts, with its figures; displayed in words.
#[derive(Clone, Copy, Debug, Display, PartialEq)]
pub enum FaultKind {
    /// Lost connection of a device to its bus.
    Disconnection(Disconnection),
    /// Frames of a device are lost or changed.
    Frames(FrameFault),
    /// Second node that sends the data of joint `by` under the target's identifier.
    #[display("{service} sent twice, once with joint {by}'s data")]
    Imitation {
        /// Joint whose data is sent twice.
        by: Joint,
        /// Service that is imitated.
        service: Service,
    },
    /// Failure of the device itself.
    Device(DeviceFault),
    /// Wrong value measured by a drive.
    Sensor(SensorFault),
    /// Input of the switch box that differs from its switch.
    #[display("{_0} {_1}")]
    Contact(Input, ContactFault),
    /// Frame of a node outside the configuration.
    #[display("foreign frame {frame}")]
    ForeignFrame {
        /// Identifier and data, sent on the target's bus.
        frame: Frame,
        /// Time between two of them; `None` for a single one.
        period: Option<Duration>,
    },
    /// Failure of the link to the commanded side.
    Link(LinkFault),
    /// Force along x that the commanded side reports, in N. It may be NaN or infinite.
    #[display("reports a force of {_0} N")]
    SensedForce(f64),
    /// Failure of a bus, or of the host's adapter to it.
    Bus(Disturbance),
    /// Failure of the host.
    Host(HostFault),
}

impl Fault {
    /// Returns a fault without an end.
    pub const fn new(start: Duration, target: Target, kind: FaultKind) -> Self {
        Self { start, duration: None, target, kind }
    }

    /// Returns the fault with an end.
    #[must_use]
    pub const fn lasting(self, duration: Duration) -> Self {
        Self { duration: Some(duration), ..self }
    }

    /// Returns a fault of the host with a duration.
    pub const fn of_host(start: Duration, fault: HostFault, duration: Duration) -> Self {
        Self::new(start, Target::Host, FaultKind::Host(fault)).lasting(duration)
    }

    /// Returns a fault of one bus without an end.
    pub const fn of_bus(start: Duration, channel: Channel, disturbance: Disturbance) -> Self {
        Self::new(start, Target::Bus(channel), FaultKind::Bus(disturbance))
    }

    /// Returns whether the fault is on the node's side of the buses, so that simulated devices cannot apply it.
    pub const fn is_of_host(&self) -> bool {
        matches!(self.kind, FaultKind::Bus(_) | FaultKind::Host(_) | FaultKind::SensedForce(_))
    }
}

impl FaultKind {
    /// Returns whether the fault has no duration.
    pub const fn is_momentary(&self) -> bool {
        match self {
            Self::Device(fault) => fault.is_momentary(),
            Self::Host(fault) => matches!(fault, HostFault::ClockSet(_)),
            Self::ForeignFrame { period, .. } => period.is_none(),
            Self::Disconnection(_)
            | Self::Frames(_)
            | Self::Imitation { .. }
            | Self::Sensor(_)
            | Self::Contact(..)
            | Self::Link(_)
            | Self::SensedForce(_)
            | Self::Bus(_) => false,
        }
    }
}

/// As in `joint 3: unplugged`.
impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.target, self.kind)?;
        match (self.duration, self.is_of_host()) {
            (Some(duration), true) => write!(f, " for {} ms", 1e3 * duration.as_secs_f64()),
            (Some(_) | None, _) => Ok(()),
        }
    }
}
