//! Faults on the node's side: adapters and buses, the process, the host's clocks, the link to the commanded side.

use std::time::Duration;

use derive_more::Display;

use canopen::frame::Frame;

/// Fault of a bus at the host's adapter.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Disturbance {
    /// Full transmit queue: no frame is accepted. Frames are received.
    #[display("transmit queue full")]
    QueueFull,
    /// Adapter that accepts frames and sends none; it receives nothing.
    #[display("adapter stuck")]
    AdapterStuck,
    /// Adapter that queues frames in both directions and delivers them when the fault ends.
    #[display("adapter stalled")]
    AdapterStalled,
    /// Unplugged adapter, whose driver reports that the interface is gone.
    #[display("adapter unplugged")]
    AdapterUnplugged,
    /// Interface that is down: no frame is accepted or received, and nothing is reported.
    #[display("interface down")]
    InterfaceDown,
    /// Bus-off reported by the controller: accepted frames are lost, and nothing is received.
    #[display("adapter bus-off")]
    BusOff,
    /// Error passive reported by the controller. Frames still pass.
    #[display("adapter error passive")]
    ErrorPassive,
    /// Error warning reported by the controller. Frames still pass.
    #[display("adapter error warning")]
    ErrorWarning,
    /// Another node sends this frame whenever it wins the arbitration.
    #[display("flooded with {_0}")]
    Flood(Frame),
}

/// Fault of the host. It lasts for the duration of its [`Fault`](crate::Fault), except for a clock that is set.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum HostFault {
    /// Process that does not run; the buses continue.
    #[display("process stopped")]
    ProcessStopped,
    /// Process that stops after the next frame with this COB-ID that it sends or reads. That is within a cycle.
    #[display("process stopped after {_0:03X}h")]
    ProcessStoppedAfter(u16),
    /// Suspension of the host: immediate, or after the next frame with this COB-ID that the process sends or reads. The
    /// buses continue.
    #[display("suspended")]
    Suspended(Option<u16>),
    /// Change of the wall clock to this time since 1970.
    #[display("wall clock set to {} s", _0.as_secs_f64())]
    ClockSet(Duration),
}

/// Fault of the link to the commanded side, mildest first.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, PartialOrd, Ord)]
pub enum LinkFault {
    /// Wrenches are repeated, with their old time stamps.
    #[display("frozen")]
    Frozen,
    /// Messages take longer than the configuration states.
    #[display("slow")]
    Slow,
    /// Commanded side that holds for a local reason.
    #[display("held")]
    Held,
    /// Another node leads the commanded side, whose messages answer that node.
    #[display("answers another node")]
    Foreign,
    /// No message passes in either direction.
    #[display("lost")]
    Lost,
}
