//! Faults on the node's side: adapters and buses, the process, the host's clocks, the link to the commanded side.

use std::time::Duration;

use derive_more::Display;

use canopen::frame::Frame;

/// Fault of a bus at the host's adapter.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Disturbance {
    /// The transmit queue is full: no frame is accepted. Frames are received.
    #[display("transmit queue full")]
    QueueFull,
    /// The adapter accepts frames and sends none; it receives nothing.
    #[display("adapter stuck")]
    AdapterStuck,
    /// The adapter queues frames in both directions and delivers them when the fault ends.
    #[display("adapter stalled")]
    AdapterStalled,
    /// The adapter is unplugged, and its driver reports that the interface is gone.
    #[display("adapter unplugged")]
    AdapterUnplugged,
    /// The interface is down: no frame is accepted or received, and nothing is reported.
    #[display("interface down")]
    InterfaceDown,
    /// The controller reports bus-off: accepted frames are lost, and nothing is received.
    #[display("adapter bus-off")]
    BusOff,
    /// The controller reports error passive. Frames still pass.
    #[display("adapter error passive")]
    ErrorPassive,
    /// The controller reports an error warning. Frames still pass.
    #[display("adapter error warning")]
    ErrorWarning,
    /// Another node sends this frame whenever it wins the arbitration.
    #[display("flooded with {_0}")]
    Flood(Frame),
}

/// Fault of the host. It lasts for the duration of its [`Fault`](crate::Fault), except for a clock that is set.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum HostFault {
    /// The process does not run; the buses continue.
    #[display("process stopped")]
    ProcessStopped,
    /// The process does not run after the next frame with this COB-ID that it sends or reads, which is within a cycle.
    #[display("process stopped after {_0:03X}h")]
    ProcessStoppedAfter(u16),
    /// The host is suspended immediately, or after the next frame with this COB-ID that the process sends or reads. The buses
    /// continue.
    #[display("suspended")]
    Suspended(Option<u16>),
    /// The wall clock is set to this time since 1970.
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
    /// The commanded side holds for a local reason.
    #[display("held")]
    Held,
    /// Another node leads the commanded side, whose messages answer that node.
    #[display("answers another node")]
    Foreign,
    /// No message passes in either direction.
    #[display("lost")]
    Lost,
}
