//! What one cycle did: a plain value the loop fills and offers to a queue. Nothing here is computed
//! twice: the controller's intermediates are the ones the torques came from.

use std::fmt;

use nalgebra::Isometry3;

use crate::canopen::error_codes;
use crate::controller::Fault;
use crate::controller::Output;
use crate::spatial::Wrench;
use crate::time::Instant;

/// The mode of the node; only its safety changes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Drives are being configured and enabled, at zero torque.
    Boot,
    /// Drives enabled at zero torque.
    Ready,
    /// Gravity compensation; commands and reflection wait for the deadman.
    Armed,
    /// Commands flow, wrenches are felt.
    Engaged,
    /// A fault: torque is off and stays off until a reset.
    Stopped,
}

impl Mode {
    /// In one lower-case word, as `ctl status` prints it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Boot => "boot",
            Self::Ready => "ready",
            Self::Armed => "armed",
            Self::Engaged => "engaged",
            Self::Stopped => "stopped",
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What stopped the node. Joints count from 1, as in the paper; nodes are places in the list of the
/// joints' drives and the switch box, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A drive's samples did not come in time, several cycles in a row.
    SamplesMissing { joint: usize, cycles: u32 },
    /// A drive no longer tells its state, although its positions come.
    StatusMissing { joint: usize },
    /// A drive left `Operation enabled` by itself.
    DriveLeft { joint: usize, statusword: u16 },
    /// A node sent an emergency message.
    Emergency { node: usize, code: u16 },
    /// A node's heartbeat stopped.
    HeartbeatLost { node: usize },
    /// A node started anew in the middle of a run.
    Rebooted { node: usize },
    /// Two nodes seem to have one node-id.
    Duplicate { node: usize },
    /// Somebody else commands this network.
    ForeignMaster,
    /// The controller met a number it cannot use.
    ControllerFault { fault: Fault },
    /// A torque frame could not be sent.
    QueueFull { channel: u8 },
    /// The bus is error passive.
    BusPassive { channel: u8 },
    /// The controller has left the bus.
    BusOff { channel: u8 },
    /// The interface is down.
    BusDown { channel: u8 },
    /// The deadman's two channels contradict each other.
    DeadmanDisagrees,
    /// The loop stood still for several cycles.
    Overrun { cycles: u64 },
    /// A drive did not reach `Operation enabled`.
    EnableTimeout { joint: usize, statusword: u16 },
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StatusMissing { joint } => write!(f, "joint {joint}: statusword missing"),
            Self::SamplesMissing { joint, cycles } => {
                write!(f, "joint {joint}: no sample for {cycles} cycles")
            }
            Self::DriveLeft { joint, statusword } => {
                write!(f, "joint {joint}: drive left operation enabled (6041h = {statusword:04X}h)")
            }
            Self::Emergency { node, code } => {
                let words = error_codes::words(*code);
                write!(f, "{}: emergency {code:04X}h {words}", Who(*node))
            }
            Self::HeartbeatLost { node } => write!(f, "{}: heartbeat lost", Who(*node)),
            Self::Rebooted { node } => write!(f, "{}: rebooted", Who(*node)),
            Self::Duplicate { node } => {
                write!(f, "{}: two nodes seem to have its node-id", Who(*node))
            }
            Self::ForeignMaster => f.write_str("another master is on the bus"),
            Self::ControllerFault { fault } => write!(f, "controller: {fault}"),
            Self::QueueFull { channel } => write!(f, "bus {channel}: transmit queue full"),
            Self::BusPassive { channel } => write!(f, "bus {channel}: error passive"),
            Self::BusOff { channel } => write!(f, "bus {channel}: bus off"),
            Self::BusDown { channel } => write!(f, "bus {channel}: interface down"),
            Self::DeadmanDisagrees => f.write_str("the deadman's channels contradict each other"),
            Self::Overrun { cycles } => write!(f, "the loop stood still for {cycles} cycles"),
            Self::EnableTimeout { joint, statusword } => {
                write!(f, "joint {joint}: not enabled in time (6041h = {statusword:04X}h)")
            }
        }
    }
}

/// A node by its place in the list.
struct Who(usize);

impl fmt::Display for Who {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            drive @ 0..6 => write!(f, "joint {}", drive + 1),
            _ => f.write_str("switch box"),
        }
    }
}

/// One cycle.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// Its number, from 1.
    pub cycle: u64,
    /// When its SYNC was sent.
    pub at: Instant,
    /// The mode it ran in.
    pub mode: Mode,
    /// What stopped the node, while it is stopped.
    pub cause: Option<Cause>,
    /// Whether each joint's sample came in time.
    pub sampled: [bool; 6],
    /// The switch box's inputs; `None` when it is silent.
    pub inputs: Option<u8>,
    /// The wrench of the environment on the object at {S}, payload removed.
    pub f_s: Wrench,
    /// The pose of the object.
    pub x_b_m: Isometry3<f64>,
    /// All the controller computed.
    pub output: Output,
    /// The target torques sent, in per mille of rated torque.
    pub targets: [i16; 6],
}
