//! Faults of a device's frames: selection, effect and extent.

use std::fmt;
use std::time::Duration;

use derive_more::Display;

/// Fault of frames of a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameFault {
    /// Frames that may be affected.
    pub selection: Selection,
    /// Effect on an affected frame.
    pub effect: Effect,
    /// Extent among the selected frames.
    pub extent: Extent,
}

/// Frames of a device that a fault selects.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Selection {
    /// All frames that the device sends or receives.
    #[display("frames")]
    All,
    /// Frames of one service.
    Service(Service),
    /// Frames with this COB-ID.
    #[display("{_0:03X}h")]
    CobId(u16),
}

/// Communication object of a device, displayed by its word in a scenario. The device's dictionary has its COB-ID.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Service {
    /// TPDO by its number, from 1.
    #[display("tpdo{_0}")]
    Tpdo(u16),
    /// RPDO by its number, from 1.
    #[display("rpdo{_0}")]
    Rpdo(u16),
    /// Emergency messages.
    #[display("emcy")]
    Emergency,
    /// Heartbeat, boot-up message and node guarding.
    #[display("heartbeat")]
    Heartbeat,
    /// Requests to the SDO server, and its responses.
    #[display("sdo")]
    Sdo,
    /// SYNC that the device consumes.
    #[display("sync")]
    Sync,
    /// NMT commands.
    #[display("nmt")]
    Nmt,
}

/// Effect on a frame.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Effect {
    /// Lost frame.
    #[display("lost")]
    Drop,
    /// Frame that is received twice.
    #[display("twice")]
    Duplicate,
    /// Frame that is received later.
    #[display("{} ms late", by.as_secs_f64() * 1e3)]
    Delay {
        /// Delay.
        by: Duration,
        /// Later frames of the same COB-ID may overtake it.
        reorders: bool,
    },
    /// Mask of the bits that are inverted in the data.
    #[display("corrupted")]
    Corrupt([u8; 8]),
    /// Data of the first frame since the start of the fault, in every later one.
    #[display("frozen")]
    Freeze,
    /// Length of the data, 0 to 8 bytes.
    #[display("of {_0} bytes")]
    Resize(u8),
}

/// Extent of a fault among the selected frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// Every frame.
    Always,
    /// Random share of them, 0 to 1.
    Share(f64),
    /// This many, from the first on.
    First(u32),
}

impl Service {
    /// Services that a device has once.
    pub const UNNUMBERED: [Self; 5] =
        [Self::Emergency, Self::Heartbeat, Self::Sdo, Self::Sync, Self::Nmt];
}

impl FrameFault {
    /// Returns a fault of every frame of `service`.
    pub const fn on_service(service: Service, effect: Effect) -> Self {
        Self { selection: Selection::Service(service), effect, extent: Extent::Always }
    }

    /// Returns the fault with another extent.
    #[must_use]
    pub const fn to(self, extent: Extent) -> Self {
        Self { extent, ..self }
    }
}

/// As in `tpdo1 lost, 20 %`.
impl fmt::Display for FrameFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.selection, self.effect)?;
        match self.extent {
            Extent::Always => Ok(()),
            Extent::Share(share) => write!(f, ", {} %", 100.0 * share),
            Extent::First(1) => f.write_str(", once"),
            Extent::First(count) => write!(f, ", {count} times"),
        }
    }
}
