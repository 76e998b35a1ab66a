//! What one cycle did: a plain value the loop fills and offers to a queue. Nothing here is computed
//! twice: the controller's intermediates are the ones the torques came from.

use std::fmt;

use nalgebra::Isometry3;

use crate::cause::Cause;
use controller::Output;
use units::spatial::Wrench;
use units::time::Instant;

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
    /// S1: the weight of the arm is carried on, nothing else acts and nothing is commanded, until a reset.
    ReflectionOff,
    /// S2: a fault; torque is zero, and after a moment the drives are off.
    ZeroTorque,
    /// S3: a fault; the drives are off until a reset.
    DrivesOff,
}

impl Mode {
    /// All of them, in the order of the mode graph.
    pub const ALL: [Self; 7] = [
        Self::Boot,
        Self::Ready,
        Self::Armed,
        Self::Engaged,
        Self::ReflectionOff,
        Self::ZeroTorque,
        Self::DrivesOff,
    ];

    /// Whether a cause has latched it: only a reset leads out.
    pub const fn is_latched(self) -> bool {
        match self {
            Self::Boot | Self::Ready | Self::Armed | Self::Engaged => false,
            Self::ReflectionOff | Self::ZeroTorque | Self::DrivesOff => true,
        }
    }

    /// Whether torque is zero and stays so until a reset.
    pub const fn is_stopped(self) -> bool {
        matches!(self, Self::ZeroTorque | Self::DrivesOff)
    }

    /// Returns whether anything but zero torque may be sent.
    pub const fn may_push(self) -> bool {
        match self {
            Self::Armed | Self::Engaged | Self::ReflectionOff => true,
            Self::Boot | Self::Ready | Self::ZeroTorque | Self::DrivesOff => false,
        }
    }

    /// In one lower-case word, as `ctl status` prints it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Boot => "boot",
            Self::Ready => "ready",
            Self::Armed => "armed",
            Self::Engaged => "engaged",
            Self::ReflectionOff => "reflection-off",
            Self::ZeroTorque => "zero-torque",
            Self::DrivesOff => "drives-off",
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
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
    /// Cycles so far that took longer than they may: torques too late to be sent, or a SYNC that was skipped.
    pub overruns: u64,
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
    /// The target torques that were sent last, in per mille of rated torque.
    pub targets: [i16; 6],
    /// What the node has seen of other clients, and could not see of its drives.
    pub others: Others,
}

/// Counts since the node was started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Others {
    /// SDO uploads that other clients have begun at the nodes of this master.
    pub uploads: u64,
    /// Objects of the proof that could not be read again, at this moment.
    pub unread: usize,
}
