//! Faults on the node's side: adapters and buses, the process, the host's clocks, the link to the commanded side.

use std::time::Duration;

use crate::described::described;
use canopen::frame::Frame;

described! {
    /// A fault of a bus, as its host sees it.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Disturbance {
        /// The transmit queue is full: no frame is accepted. Frames are received.
        QueueFull => "transmit queue full";
        /// The adapter accepts frames and sends none; it receives nothing.
        AdapterStuck => "adapter stuck";
        /// The adapter queues frames in both directions and delivers them when the fault ends.
        AdapterStalled => "adapter stalled";
        /// The adapter is unplugged, and its driver reports that the interface is gone.
        AdapterUnplugged => "adapter unplugged";
        /// The interface is down: no frame is accepted or received, and nothing is reported.
        InterfaceDown => "interface down";
        /// The controller reports bus-off: accepted frames are lost, and nothing is received.
        BusOff => "adapter bus-off";
        /// The controller reports error passive. Frames still pass.
        ErrorPassive => "adapter error passive";
        /// The controller reports an error warning. Frames still pass.
        ErrorWarning => "adapter error warning";
        /// Another node sends this frame whenever it wins the arbitration.
        Flood(frame: Frame) => "flooded with {frame}";
    }

    /// A fault of the host. All but a clock that is set last for the duration of their [`Fault`](crate::Fault).
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum HostFault {
        /// The process does not run. The buses go on.
        ProcessStopped => "process stopped";
        /// The same, from the next frame with this COB-ID on that the process sends or reads: within a cycle.
        ProcessStoppedAfter(cob_id: u16) => "process stopped after {cob_id:03X}h";
        /// The host is suspended. The buses go on.
        Suspended => "suspended";
        /// The wall clock is set to this time since 1970.
        ClockSet(wall: Duration) => "wall clock set to {} s", wall.as_secs_f64();
    }

    /// A fault of the link to the commanded side, mildest first.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub enum LinkFault {
        /// Wrenches are repeated, with their old time stamps.
        Frozen => "frozen";
        /// No message passes in either direction.
        Lost => "lost";
    }
}
