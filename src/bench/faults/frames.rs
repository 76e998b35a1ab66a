//! Faults of a device's frames: which of them, what happens to them, and how often.

use std::fmt;
use std::time::Duration;

/// A fault of some frames of a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameFault {
    /// The frames that may be affected.
    pub selection: Selection,
    /// Effect on an affected frame.
    pub effect: Effect,
    /// Extent among the selected frames.
    pub extent: Extent,
}

/// Frames of a device that a fault selects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// All frames that the device sends or receives.
    All,
    /// Those of one service.
    Service(Service),
    /// Those with this COB-ID.
    CobId(u16),
}

/// A service of a device; its dictionary says with which COB-ID.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// A TPDO, from 1.
    Tpdo(u16),
    /// An RPDO, from 1.
    Rpdo(u16),
    /// Emergency messages.
    Emergency,
    /// Heartbeat, boot-up message and node guarding.
    Heartbeat,
    /// Requests to the SDO server, and its responses.
    Sdo,
    /// The SYNC that the device consumes.
    Sync,
    /// NMT commands.
    Nmt,
}

/// Extent of a fault among the selected frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// Every frame.
    Always,
    /// A random share of them, 0 to 1.
    Share(f64),
    /// This many, from the first on.
    First(u32),
}

/// Effect on a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// The frame is lost.
    Drop,
    /// The frame is received twice.
    Duplicate,
    /// The frame is received later.
    Delay {
        /// The delay.
        by: Duration,
        /// Later frames of the same COB-ID may overtake it.
        reorders: bool,
    },
    /// The set bits of this mask are inverted in its data.
    Corrupt([u8; 8]),
    /// Its data is that of the first frame since the fault began.
    Freeze,
    /// Its data has this length, 0 to 8 bytes.
    Resize(u8),
}

impl FrameFault {
    /// Returns a fault of every frame of `service`.
    pub const fn of(service: Service, effect: Effect) -> Self {
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

impl fmt::Display for Selection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str("frames"),
            Self::Service(service) => write!(f, "{service}"),
            Self::CobId(cob_id) => write!(f, "{cob_id:03X}h"),
        }
    }
}

/// The word for it in a scenario.
impl fmt::Display for Service {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tpdo(number) => write!(f, "tpdo{number}"),
            Self::Rpdo(number) => write!(f, "rpdo{number}"),
            Self::Emergency => f.write_str("emcy"),
            Self::Heartbeat => f.write_str("heartbeat"),
            Self::Sdo => f.write_str("sdo"),
            Self::Sync => f.write_str("sync"),
            Self::Nmt => f.write_str("nmt"),
        }
    }
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Drop => f.write_str("lost"),
            Self::Duplicate => f.write_str("twice"),
            Self::Delay { by, .. } => write!(f, "{} ms late", by.as_secs_f64() * 1e3),
            Self::Corrupt(_) => f.write_str("corrupted"),
            Self::Freeze => f.write_str("frozen"),
            Self::Resize(bytes) => write!(f, "of {bytes} bytes"),
        }
    }
}
