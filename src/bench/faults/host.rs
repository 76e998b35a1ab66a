//! Faults on the node's side: adapters and buses, the process, the host's clocks, the link to the commanded side.

use std::fmt;
use std::time::Duration;

use canopen::frame::Frame;

/// A fault of a bus, as its host sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disturbance {
    /// The transmit queue is full: no frame is accepted. Frames are received.
    QueueFull,
    /// The adapter accepts frames and sends none; it receives nothing.
    AdapterStuck,
    /// The adapter queues frames in both directions and delivers them when the fault ends.
    AdapterStalled,
    /// The adapter is unplugged, and its driver reports that the interface is gone.
    AdapterUnplugged,
    /// The interface is down: no frame is accepted or received, and nothing is reported.
    InterfaceDown,
    /// The controller reports bus-off: accepted frames are lost, and nothing is received.
    BusOff,
    /// The controller reports error passive. Frames still pass.
    ErrorPassive,
    /// The controller reports an error warning. Frames still pass.
    ErrorWarning,
    /// Another node sends this frame whenever it wins the arbitration.
    Flood(Frame),
}

/// A fault of the host. All but a clock that is set last for the duration of their [`Fault`](crate::Fault).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostFault {
    /// The process does not run. The buses go on.
    ProcessStopped,
    /// The same, from the next frame with this COB-ID on that the process sends or reads: within a cycle.
    ProcessStoppedAfter(u16),
    /// The host is suspended. The buses go on.
    Suspended,
    /// The wall clock is set to this time since 1970.
    ClockSet(Duration),
}

/// A fault of the link to the commanded side, mildest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LinkFault {
    /// Wrenches are repeated, with their old time stamps.
    Frozen,
    /// No message passes in either direction.
    Lost,
}

impl fmt::Display for Disturbance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::QueueFull => f.write_str("transmit queue full"),
            Self::AdapterStuck => f.write_str("adapter stuck"),
            Self::AdapterStalled => f.write_str("adapter stalled"),
            Self::AdapterUnplugged => f.write_str("adapter unplugged"),
            Self::InterfaceDown => f.write_str("interface down"),
            Self::BusOff => f.write_str("adapter bus-off"),
            Self::ErrorPassive => f.write_str("adapter error passive"),
            Self::ErrorWarning => f.write_str("adapter error warning"),
            Self::Flood(frame) => write!(f, "flooded with {frame}"),
        }
    }
}

impl fmt::Display for HostFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ProcessStopped => f.write_str("process stopped"),
            Self::ProcessStoppedAfter(cob_id) => write!(f, "process stopped after {cob_id:03X}h"),
            Self::Suspended => f.write_str("suspended"),
            Self::ClockSet(wall) => write!(f, "wall clock set to {} s", wall.as_secs_f64()),
        }
    }
}

impl fmt::Display for LinkFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Frozen => "frozen",
            Self::Lost => "lost",
        })
    }
}
